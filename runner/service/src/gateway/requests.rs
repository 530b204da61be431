//! What machines ask for: programs by name from the panel, words of a memory.

use softplug_abi::{Failure, RequestId};
use softplug_catalogue::Notations;
use softplug_live::reactor::Command;
use softplug_live::store::Mark;

use super::link::{EndsAs, Link};
use super::{Control, Shared};
use crate::jobs::{self, Data, Job, JobSpec, Origin, Reception, Subject, Weight};
use crate::programs::ProgramName;
use std::io::{Read, Seek, SeekFrom};

/// Most bytes of an answer: a telegram's count has 16 bits, a word two bytes.
const ANSWER: u64 = 2 * 65_535;
/// A program that the panel asks for goes before all that waits.
const PANEL: i32 = i32::MAX;

/// A request with its fields as text.
#[derive(Clone, Debug)]
struct Asked {
    request: RequestId,
    kind: String,
    fields: Vec<(String, String)>,
}

/// What a request comes to.
enum Answer {
    Data(Vec<u8>),
    /// Granted; this job sends it.
    Job(Box<Job>),
    Refused(Failure),
}

/// Where it is looked for, and where it is put.
struct WhereFrom {
    search: Vec<String>,
    names: Notations,
    place: String,
}

impl WhereFrom {
    fn name_of(&self, shared: &Shared, data: Data) -> Option<String> {
        shared.parts.snapshots.name_of(data, &self.names)
    }
}

impl Asked {
    fn field(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(field, _)| field == name).map(|(_, value)| value.as_str())
    }

    fn number(&self, name: &str) -> Option<u64> {
        self.field(name)?.parse().ok()
    }

    /// What a memory's part is called as a file: `DB5`, `M`.
    fn area(&self) -> Option<String> {
        let area = self.field("area")?;
        // Only data blocks have numbers; the telegram has one all the same.
        let block = match area {
            "DB" | "DX" => self.field("block").unwrap_or_default(),
            _ => "",
        };
        Some(format!("{area}{block}"))
    }

    /// Bytes of one unit: words, or bytes for inputs, outputs and flags.
    fn unit(&self) -> u64 {
        match self.field("area") {
            Some("I" | "Q" | "M" | "E" | "A") => 1,
            _ => 2,
        }
    }

    fn text(&self) -> String {
        let is_short = |(_, value): &&(String, String)| value.len() <= 64;
        let fields: Vec<_> = self
            .fields
            .iter()
            .filter(is_short)
            .map(|(name, value)| format!("{name}={}", value.escape_debug()))
            .collect();
        format!("the machine asks: {} {}", self.kind, fields.join(" "))
    }
}

impl Control {
    /// A machine asks for something. Folders are searched elsewhere.
    pub(super) fn asked(&mut self, name: &str, request: RequestId, kind: u16, fields: &[u8]) {
        let Some(link) = self.links.get_mut(name) else { return };
        let Some(known) = link.plugin.plugin.manifest().requests.get(usize::from(kind)) else {
            return;
        };
        let asked = Asked { request, kind: known.name.clone(), fields: known.assignments(fields) };
        if link.requests.contains_key(&request) {
            return;
        }
        if asked.kind == "program" && !Self::is_replaceable(link) {
            self.refuse(name, &asked, Failure::Busy);
            return;
        }
        link.requests.insert(request, None);
        let mut search = link.config.search.clone();
        if search.is_empty() {
            search.push(String::new());
        }
        let where_from = WhereFrom {
            search,
            names: link.config.names.clone(),
            place: link.config.receive.clone(),
        };
        let (shared, name) = (std::sync::Arc::clone(&self.shared), name.to_owned());
        self.shared.parts.requests.give(move || {
            let answer = answer(&shared, &name, &asked, &where_from);
            let control = std::sync::Arc::clone(&shared);
            control.tell(move |control| control.answer(&name, &asked, answer));
        });
    }

    /// Whether another program may be sent now, or in the place of the one that
    /// runs: nothing of that has left.
    fn is_replaceable(link: &Link) -> bool {
        let figures = link.status.read();
        link.job.is_none() || figures.job_maybe_left == 0
    }

    fn answer(&mut self, name: &str, asked: &Asked, answer: Answer) {
        let Some(link) = self.links.get_mut(name) else { return };
        let is_awaited = link.requests.contains_key(&asked.request);
        match answer {
            Answer::Refused(failure) => self.refuse(name, asked, failure),
            Answer::Job(job) if !is_awaited => self.drop_job(&job),
            Answer::Job(_) if !Self::is_replaceable(link) => {
                if let Answer::Job(job) = answer {
                    self.drop_job(&job);
                }
                self.refuse(name, asked, Failure::Busy);
            }
            Answer::Job(job) => {
                link.requests.insert(asked.request, Some(job.id));
                let lane = link.lane_id();
                let (request, answer) = (asked.request, Ok(Vec::new()));
                self.drivers.tell(lane, Command::Answer { request, answer });
                if let Some(running) = &mut link.job {
                    running.ends_as =
                        EndsAs::Interrupted("another program was asked for at the panel");
                    self.drivers.tell(lane, Command::Abort(running.job.id));
                }
                let text =
                    format!("{}: {}", asked.text(), job.spec.program.as_deref().unwrap_or(""));
                self.shared.parts.journal_writer.link(Subject::Request, Weight::Normal, name, text);
                self.show_job(&job);
                self.begin_next(name);
            }
            Answer::Data(bytes) => {
                link.requests.remove(&asked.request);
                let lane = link.lane_id();
                let (request, answer) = (asked.request, Ok(bytes));
                self.drivers.tell(lane, Command::Answer { request, answer });
                let text = asked.text();
                self.shared.parts.journal_writer.link(Subject::Request, Weight::Normal, name, text);
            }
        }
    }

    fn refuse(&mut self, name: &str, asked: &Asked, failure: Failure) {
        let Some(link) = self.links.get_mut(name) else { return };
        link.requests.remove(&asked.request);
        let lane = link.lane_id();
        let (request, answer) = (asked.request, Err(failure));
        self.drivers.tell(lane, Command::Answer { request, answer });
        let text = format!("{}; refused: {}", asked.text(), failure.text());
        self.shared.parts.journal_writer.link(Subject::Request, Weight::Warning, name, text);
    }

    /// The machine no longer wants it.
    pub(super) fn withdrawn(&mut self, name: &str, request: RequestId) {
        let Some(link) = self.links.get_mut(name) else { return };
        let Some(Some(job)) = link.requests.remove(&request) else { return };
        if link.job.as_ref().is_none_or(|running| running.job.id != job)
            && let Ok(job) = self.shared.parts.jobs.reader().job(job)
        {
            self.drop_job(&job);
        }
    }

    /// A job that nobody waits for any more.
    fn drop_job(&mut self, job: &Job) {
        let aborted = self.shared.parts.jobs.abort(job.id);
        if let Some(job) = self.wrote(aborted) {
            self.show_job(&job);
        }
    }
}

/// Finds what is asked for; takes as long as a disk does.
fn answer(shared: &Shared, link: &str, asked: &Asked, from: &WhereFrom) -> Answer {
    let answered = match asked.kind.as_str() {
        "program" => program(shared, link, asked, from),
        "read" => read(shared, asked, &from.search),
        "write" => write(shared, link, asked, &from.place),
        _ => Err(Failure::NotSupported),
    };
    answered.unwrap_or_else(Answer::Refused)
}

fn find(shared: &Shared, search: &[String], name: &str) -> Result<ProgramName, Failure> {
    match shared.parts.programs.search(search, name) {
        Ok(found) => found.ok_or(Failure::NotFound),
        Err(error) => {
            tracing::warn!(%error, "programs cannot be searched");
            Err(Failure::NotFound)
        }
    }
}

/// The program that says in its text that it is called so; none if two do.
fn find_by_text(
    shared: &Shared,
    link: &str,
    name: &str,
    from: &WhereFrom,
) -> Result<ProgramName, Failure> {
    let found = shared.parts.programs.search_text(&from.search, name, &from.names);
    let mut found = found.map_err(|error| {
        tracing::warn!(%error, "programs cannot be searched");
        Failure::NotFound
    })?;
    if let [one, other, ..] = &found[..] {
        let text = format!(
            "{} is asked for, and more than one program is called so in its text: {one} and {other}; \
             none is sent: rename the file of the right one so, or take the others away",
            name.escape_debug()
        );
        shared.parts.journal_writer.link(Subject::Request, Weight::Warning, link, text);
        return Err(Failure::NotFound);
    }
    found.pop().ok_or(Failure::NotFound)
}

fn program(
    shared: &Shared,
    link: &str,
    asked: &Asked,
    from: &WhereFrom,
) -> Result<Answer, Failure> {
    let name = asked.field("name").or_else(|| asked.field("number")).ok_or(Failure::NotFound)?;
    let _hold = shared.parts.snapshots.hold();
    let program = match find(shared, &from.search, name) {
        Err(Failure::NotFound) => find_by_text(shared, link, name, from)?,
        found => found?,
    };
    let data = shared.parts.programs.snapshot(&program, &shared.parts.snapshots);
    let data = data.map_err(|error| {
        tracing::warn!(%error, link, "a program that was asked for cannot be read");
        Failure::NotFound
    })?;
    let channel = shared.ask({
        let link = link.to_owned();
        move |control| Ok(control.channel_of(&link))
    });
    let read = channel.and_then(|channel| match channel {
        Some(channel) => channel.read(shared, data),
        None => Ok((data, Vec::new())),
    });
    let (data, stops) = read.map_err(|error| {
        tracing::warn!(%error, link, "a program that was asked for cannot be sent in a cell");
        Failure::BadJob
    })?;
    let order = JobSpec {
        priority: PANEL,
        origin: Origin::Panel,
        named: from.name_of(shared, data),
        ..JobSpec::send(link, program.as_str(), data)
    };
    let submitted = shared.parts.jobs.submit_with(order, stops);
    submitted.map(|job| Answer::Job(Box::new(job))).map_err(|error| {
        tracing::error!(%error, link, "a program that was asked for cannot be sent");
        Failure::Busy
    })
}

/// Words or bytes of a memory that is a file: `DB5`, from where and as many as asked for.
fn read(shared: &Shared, asked: &Asked, search: &[String]) -> Result<Answer, Failure> {
    let area = asked.area().ok_or(Failure::BadJob)?;
    let program = find(shared, search, &area)?;
    let (mut file, known) =
        shared.parts.programs.download(&program).map_err(|_| Failure::NotFound)?;
    let offset = asked.number("offset").unwrap_or(0) * asked.unit();
    let count = asked.number("count").unwrap_or(1) * asked.unit();
    if count > ANSWER || offset + count > known.size {
        return Err(Failure::BadJob);
    }
    let mut bytes = Vec::with_capacity(count as usize);
    let read =
        file.seek(SeekFrom::Start(offset)).and_then(|_| file.take(count).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 == count => Ok(Answer::Data(bytes)),
        _ => Err(Failure::NotFound),
    }
}

/// Words that the machine writes: a reception called `DB16-1`. Granted when it is on
/// the disk.
fn write(shared: &Shared, link: &str, asked: &Asked, place: &str) -> Result<Answer, Failure> {
    let area = asked.area().ok_or(Failure::BadJob)?;
    let name = format!("{area}-{}", asked.number("offset").unwrap_or(0));
    let bytes = hex(asked.field("data").unwrap_or_default()).ok_or(Failure::BadJob)?;
    let failed = |error: &dyn std::fmt::Display| {
        tracing::error!(%error, link, "what a machine wrote cannot be kept");
        Failure::Busy
    };
    let (jobs, quotas) = (&shared.parts.jobs, &shared.parts.quotas);
    let today = jobs.today(link);
    quotas.begin(link, today).map_err(|over| failed(&over))?;
    let room = quotas.room(link, today, 0).map_err(|over| failed(&over))?;
    if room < bytes.len() as u64 {
        return Err(failed(&"it would be more than may come today"));
    }
    let job = jobs.receive(link).map_err(|error| failed(&error))?;
    let kept = shared.parts.receptions.begin(place, job.id).map_err(|error| error.to_string());
    let kept = kept.and_then(|mut arrival| {
        arrival.write(&bytes).map_err(|error| error.to_string())?;
        arrival.end(Some(&name), Mark::Complete).map_err(|error| error.to_string())
    });
    let arrived = match kept {
        Ok(arrived) => arrived,
        Err(error) => {
            let reason = jobs::Reason::new("disk", error.clone());
            if let Ok(job) = shared.parts.jobs.end(job.id, jobs::Ending::Failed(reason), None) {
                shared.tell(move |control| control.show_job(&job));
            }
            return Err(failed(&error));
        }
    };
    let reception =
        Reception { file: arrived.file(), bytes: arrived.bytes, is_complete: true, compared: None };
    let received = shared.parts.jobs.received(job.id, Some(name), reception, None, None);
    let job = received.map_err(|error| failed(&error))?;
    shared.tell(move |control| control.show_job(&job));
    shared.changed(crate::view::Change::Receptions { link: link.to_owned() });
    Ok(Answer::Data(Vec::new()))
}

/// Bytes as the manifest's fields have them: pairs of hex digits.
fn hex(text: &str) -> Option<Vec<u8>> {
    text.split(' ')
        .filter(|pair| !pair.is_empty())
        .map(|pair| u8::from_str_radix(pair, 16).ok())
        .collect()
}
