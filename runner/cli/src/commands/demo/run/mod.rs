//! `softplug demo`: each plug-in against a simulated machine, in this process.

mod cell;
mod context;
mod fanuc;
mod pulse;
mod r3964;
mod xon_xoff;

use std::time::Duration;

use serde::Serialize;
use serde_json::{Map, Value};

use self::context::{DemoContext, Shown};
use self::pulse::Pulse;
use crate::commands::demo::Arguments;
use crate::commands::replay;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::plugin::Chosen;
use crate::screen::{GOOD, HEADING, Screen};
use crate::stop;

/// A computer, or a simulated machine, that is so much too late may have made a part fail.
const LATE: Duration = Duration::from_millis(1);
/// Attempts at each part on such a computer.
const ATTEMPTS: u32 = 3;

/// The plug-ins in the order of their parts.
const PLUGINS: [&str; 4] = ["xon-xoff", "r3964", "r3964-simplified", "fanuc-rs232"];

#[derive(Serialize)]
struct Document {
    result: &'static str,
    #[serde(flatten)]
    parts: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    replay: Option<Replayed>,
}

#[derive(Default, Serialize)]
struct Replayed {
    total: usize,
    passed: usize,
    failed: usize,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let stop = stop::on_signals()?;
    let context = DemoContext { arguments, screen, stop: &stop, pulse: Pulse::start() };
    // A plug-in that is not there is told before anything is shown.
    let plugins = PLUGINS.map(|name| context.plugin(name));
    let [xon_xoff, r3964, simplified, fanuc] = plugins;
    let plugins = [xon_xoff?, r3964?, simplified?, fanuc?];
    let mut document = Document { result: "failed", parts: Map::new(), replay: None };
    let parts = PLUGINS.iter().copied().zip(plugins.iter().map(Some)).chain([("cell", None)]);
    for (name, plugin) in parts {
        let shown = match plugin {
            Some(plugin) => show(&context, name, plugin)?,
            None => cell::show(&context)?,
        };
        match shown {
            Shown::Good(value) => {
                document.parts.insert(name.to_owned(), value);
            }
            Shown::Aborted => {
                screen.document(&Document { result: "aborted", ..document });
                screen.error("aborted");
                return Ok(Exit::Incomplete);
            }
            Shown::Failed(why) => {
                screen.document(&document);
                screen.error(format_args!("{name}: {why}"));
                return Ok(Exit::Failed);
            }
        }
    }

    screen.say(format_args!("{HEADING}6. The traces{HEADING:#}"));
    if arguments.traces.exists() {
        let mut replayed = Replayed::default();
        let mut first = None;
        for plugin in &plugins {
            if let Some(summary) = replay::quick(plugin, &arguments.traces)? {
                replayed.total += summary.total;
                replayed.passed += summary.passed;
                replayed.failed += summary.failed;
                let failed = summary.cases.iter().find(|verdict| verdict.failure.is_some());
                first = first.or(failed.map(|verdict| verdict.case.clone()));
            }
        }
        let Replayed { total, failed, .. } = replayed;
        document.replay = Some(replayed);
        if failed > 0 {
            screen.document(&document);
            let first = first.unwrap_or_default();
            screen.error(format_args!("{failed} of {total} cases failed, the first is {first}"));
            return Ok(Exit::Failed);
        }
        screen.say(format_args!(
            "{GOOD}All passed{GOOD:#}: {} in virtual time, each trace as it is written, with its\n\
             bytes one by one and all at once, twice in one instance, and with the plug-in replaced\n\
             by a fresh instance after every event. `softplug replay` has more such permutations.",
            numbers::things(total as u64, "case"),
        ));
    } else {
        screen.say(format_args!(
            "Left out: there is no folder {}. From a clone of the project, run this in its root.",
            arguments.traces.display()
        ));
    }
    screen.document(&Document { result: "done", ..document });
    Ok(Exit::Done)
}

/// Shows a plug-in's part. One that fails while this computer is late proves nothing,
/// and is shown again.
fn show(context: &DemoContext<'_>, name: &str, plugin: &Chosen) -> Result<Shown, Failure> {
    let mut attempt = 1;
    loop {
        context.pulse.latest();
        let shown = match name {
            "xon-xoff" => xon_xoff::show(context, plugin)?,
            "r3964" => r3964::show(context, plugin, &r3964::FULL)?,
            "r3964-simplified" => r3964::show(context, plugin, &r3964::SIMPLIFIED)?,
            _ => fanuc::show(context, plugin)?,
        };
        let late = context.pulse.latest();
        let Shown::Failed(why) = &shown else { return Ok(shown) };
        if late <= LATE || context.is_stopped() {
            return Ok(shown);
        }
        let busy = format!(
            "{why}; this computer was {} ms late, too busy to simulate a machine in time",
            late.as_millis()
        );
        if attempt == ATTEMPTS {
            return Ok(Shown::Failed(format!("{busy}: try again")));
        }
        context.screen.note(format_args!("{busy}; once more\n"));
        attempt += 1;
    }
}
