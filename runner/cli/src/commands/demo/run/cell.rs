//! The fifth part: three channels of a cell, in a gateway.

use softplug_abi::JobId;
use std::fs;
use std::io;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::json;
use softplug_live::plain_text;
use softplug_service::config::Config;
use softplug_service::gateway::{Gateway, Running, start};
use softplug_service::library::Library;
use softplug_service::view::{CellChannelState, CellView, JobOrder, JobState, StopHow};

use super::context::{DemoContext, Shown};
use crate::failure::Failure;
use crate::numbers;
use crate::screen::{GOOD, HEADING};

const GATEWAY: &str = include_str!("../../../../examples/three-channels/gateway.toml");
const PROGRAMS: [(&str, &str); 3] = [
    ("LOADER", include_str!("../../../../examples/three-channels/programs/LOADER")),
    ("LATHE-1", include_str!("../../../../examples/three-channels/programs/LATHE-1")),
    ("parts/SHAFT-2", include_str!("../../../../examples/three-channels/programs/parts/SHAFT-2")),
];
const CELL: &str = "shafts";
/// What somebody begins; the loader starts the third.
const BEGUN: [&str; 2] = ["LOADER", "LATHE-1"];
const LOOK: Duration = Duration::from_millis(50);
/// Longer than the cell takes.
const PATIENCE: Duration = Duration::from_mins(1);
/// Columns of the chart.
const COLUMNS: u64 = 60;

pub(super) fn show(context: &DemoContext<'_>) -> Result<Shown, Failure> {
    let screen = context.screen;
    screen.say(format_args!(
        "{HEADING}5. A cell: two lathes and a loader that wait for each other{HEADING:#}\n\
         A gateway feeds three simulated machines. Their programs meet at marks, the loader starts\n\
         the second lathe's program, and the gantry belongs to one channel at a time."
    ));
    let folder = tempfile::tempdir().map_err(|error| failed(&error))?;
    let module = context.arguments.library.read("xon-xoff")?;
    let running = begin(folder.path(), &module)?;
    let gateway = running.gateway().clone();
    let shown = watch(context, &gateway);
    gateway.stop(StopHow::Park);
    drop(gateway);
    running.wait();
    shown
}

fn begin(folder: &Path, module: &[u8]) -> Result<Running, Failure> {
    let file = folder.join("gateway.toml");
    // Nobody else asks this gateway for anything.
    let parts: Vec<&str> = GATEWAY.split("\n[").filter(|part| !part.starts_with("http]")).collect();
    fs::write(&file, parts.join("\n[")).map_err(|error| failed(&error))?;
    for (name, text) in PROGRAMS {
        let path = folder.join("programs").join(name);
        let above = path.parent().unwrap_or(folder);
        fs::create_dir_all(above).map_err(|error| failed(&error))?;
        fs::write(&path, text).map_err(|error| failed(&error))?;
    }
    let library = Library::open(&folder.join("state/plugins")).map_err(Failure::internal)?;
    library.add(module).map_err(Failure::internal)?;
    let config = Config::read(&file).map_err(Failure::internal)?;
    start(config).map_err(Failure::internal)
}

fn watch(context: &DemoContext<'_>, gateway: &Gateway) -> Result<Shown, Failure> {
    let begin = Instant::now();
    let mut jobs = Vec::new();
    for link in BEGUN {
        let order = JobOrder { program: Some(link.to_owned()), ..JobOrder::default() };
        jobs.push(gateway.submit(link, &order).map_err(Failure::internal)?.id);
    }
    let mut has_run = false;
    let cell = loop {
        if context.is_stopped() {
            return Ok(Shown::Aborted);
        }
        let cell = gateway.cell(CELL).map_err(Failure::internal)?;
        let runs = cell.channels.iter().any(|channel| channel.program.is_some());
        has_run |= cell.channels.iter().all(|channel| channel.program.is_some());
        if has_run && !runs {
            break cell;
        }
        if let Some(stuck) = cell.stuck.iter().find(|stuck| stuck.is_deadlock) {
            return Ok(Shown::Failed(stuck.text.clone()));
        }
        if begin.elapsed() > PATIENCE {
            return Ok(Shown::Failed("the programs do not come to their end".to_owned()));
        }
        sleep(LOOK);
    };
    for id in jobs {
        let job = gateway.job(JobId(id)).map_err(Failure::internal)?;
        if job.state != JobState::Done {
            return Ok(Shown::Failed(plain_text(&job.progress.text)));
        }
    }
    let waits = cell.channels.iter().flat_map(|channel| &channel.spans);
    let waits = waits.filter(|span| span.state == CellChannelState::Waits).count();
    context.screen.say(chart(&cell));
    context.screen.say(format_args!(
        "{GOOD}Done{GOOD:#}: three programs in {}; they waited for each other {}.\n",
        numbers::span(begin.elapsed()),
        numbers::things(waits as u64, "time"),
    ));
    Ok(Shown::Good(json!({ "channels": cell.channels.len(), "waits": waits })))
}

/// Who ran (#) and who waited (.), over time.
fn chart(cell: &CellView) -> String {
    let work = |state| state != CellChannelState::Idle;
    let spans = || cell.channels.iter().flat_map(|channel| &channel.spans);
    let busy = || spans().filter(|span| work(span.state));
    let from = busy().map(|span| span.from_ms).min().unwrap_or(0);
    let to = busy().filter_map(|span| span.to_ms).max().unwrap_or(from).max(from + 1);
    let mut text = String::from("  # runs, . waits\n");
    for channel in &cell.channels {
        let sign = |column: u64| {
            let at = from + (to - from) * column / COLUMNS;
            let now = channel
                .spans
                .iter()
                .find(|span| span.from_ms <= at && span.to_ms.is_none_or(|to| at < to));
            match now.map(|span| span.state) {
                Some(CellChannelState::Runs) => '#',
                Some(CellChannelState::Waits | CellChannelState::Stands) => '.',
                Some(CellChannelState::Idle) | None => ' ',
            }
        };
        let row: String = (0..COLUMNS).map(sign).collect();
        text.push_str(&format_row(&channel.link, &row));
    }
    text
}

fn format_row(name: &str, row: &str) -> String {
    format!("  {name:<8} {}\n", row.trim_end())
}

fn failed(error: &io::Error) -> Failure {
    Failure::usage(format_args!("the folder of the demonstration cannot be made: {error}"))
}
