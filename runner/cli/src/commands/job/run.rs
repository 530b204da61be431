//! `softplug job …`

use std::fs::File;
use std::io;
use std::thread::sleep;
use std::time::Duration;

use serde::Serialize;
use softplug_live::plain_text;
use softplug_service::view::{JobOrder, JobState, JobView};
use ureq::SendBody;

use super::{Arguments, Feed, List, Submit, Verb};
use crate::commands::remote::client::{Client, pairs, query, segment, times};
use crate::commands::remote::show;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::screen::Screen;
use crate::table::Table;

/// Between two looks at a job that is waited for.
const LOOK: Duration = Duration::from_millis(250);

#[derive(Serialize)]
struct Restart {
    from_block: Option<u64>,
    from_byte: Option<u64>,
}

#[derive(Serialize)]
struct Priority {
    priority: i32,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let client = Client::new(&arguments.remote)?;
    let order =
        |id: u32, verb: &str| client.post::<JobView>(&format!("/jobs/{id}/{verb}"), None::<&()>);
    let (job, waits) = match &arguments.verb {
        Verb::List(of) => return list(&client, of, screen),
        Verb::Show(of) => (client.get(&format!("/jobs/{}", of.id))?, false),
        Verb::Wait(of) => (client.get(&format!("/jobs/{}", of.id))?, true),
        Verb::Submit(of) => (submit(&client, of)?, of.wait),
        Verb::Feed(of) => (feed(&client, of)?, of.wait),
        Verb::Pause(of) => (order(of.id, "pause")?, false),
        Verb::Resume(of) => (order(of.id, "resume")?, false),
        Verb::Abort(of) => (order(of.id, "abort")?, false),
        Verb::Acknowledge(of) => (order(of.id, "acknowledge")?, false),
        Verb::Restart(of) => {
            let order = Restart { from_block: of.from_block, from_byte: of.from_byte };
            (client.post(&format!("/jobs/{}/restart", of.id), Some(&order))?, false)
        }
        Verb::Priority(of) => {
            let order = Priority { priority: of.priority };
            (client.put(&format!("/jobs/{}/priority", of.id), &order)?, false)
        }
    };
    if !waits {
        screen.say(show::job(&job));
        screen.document(&job);
        return Ok(Exit::Done);
    }
    let job = wait(&client, job, screen)?;
    screen.say(show::job(&job));
    screen.document(&job);
    Ok(match job.state {
        JobState::Done => Exit::Done,
        JobState::Aborted | JobState::Interrupted => Exit::Incomplete,
        JobState::Failed | JobState::Queued | JobState::Running | JobState::Paused => Exit::Failed,
    })
}

fn list(client: &Client, of: &List, screen: &Screen) -> Result<Exit, Failure> {
    let [since, until] = times(&of.within);
    let path = query(
        &format!("/jobs?limit={}", of.limit),
        [
            ("link", of.link.as_deref()),
            ("state", of.state.as_deref()),
            ("kind", of.kind.as_deref()),
            ("find", of.find.as_deref()),
            ("since_ms", since.as_deref()),
            ("until_ms", until.as_deref()),
        ],
    );
    let jobs: Vec<JobView> = client.get(&path)?;
    let mut table = Table::new(["job", "link", "program", "state", "left", "message"]);
    for job in &jobs {
        table.row([
            job.id.to_string(),
            job.link.clone(),
            show::what(job),
            job.state.name().to_owned(),
            plain_text(&job.progress.text),
            plain_text(job.message.as_deref().unwrap_or_default()),
        ]);
    }
    screen.say(table);
    screen.document(&jobs);
    Ok(Exit::Done)
}

fn submit(client: &Client, of: &Submit) -> Result<JobView, Failure> {
    let order = JobOrder {
        kind: of.kind.clone(),
        program: of.program.clone(),
        fields: pairs(&of.fields),
        priority: of.priority,
        from_block: of.from_block,
    };
    client.post(&format!("/links/{}/jobs", segment(&of.link)), Some(&order))
}

fn feed(client: &Client, of: &Feed) -> Result<JobView, Failure> {
    let is_input = of.file.as_os_str() == "-";
    let name = of.file.file_name().and_then(|name| name.to_str()).map(str::to_owned);
    let program = of.program.clone().or(name.filter(|_| !is_input));
    let fields = serde_json::to_string(&pairs(&of.fields)).map_err(Failure::internal)?;
    let path = query(
        &format!("/links/{}/feed?fields={}", segment(&of.link), segment(&fields)),
        [("program", program.as_deref()), ("kind", of.kind.as_deref())],
    );
    if is_input {
        return client.send("POST", &path, SendBody::from_owned_reader(io::stdin()));
    }
    let file = File::open(&of.file).map_err(|error| files::unreadable(&of.file, &error))?;
    client.send("POST", &path, file)
}

fn wait(client: &Client, mut job: JobView, screen: &Screen) -> Result<JobView, Failure> {
    let mut told = None;
    while !job.state.is_final() {
        // Also what it waits for: somebody has to press a key at the machine.
        let now = (job.state, job.progress.is_held, job.progress.awaits.clone());
        if told.as_ref() != Some(&now) {
            screen.note(show::job(&job));
            told = Some(now);
        }
        sleep(LOOK);
        job = client.get(&format!("/jobs/{}", job.id))?;
    }
    Ok(job)
}
