//! What every part of the demonstration needs: a plug-in, a machine on its own
//! thread, a station between them.

use std::fmt::Write as _;
use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use serde_json::Value;
use softplug_abi::LineParameters;
use softplug_live::station::{Station, StationOptions};
use softplug_live::transfer::{self, SendOptions, SendOutcome, SendReport};
use softplug_live::{Port, PortError, PortOptions};
use softplug_trial::reason;

use super::pulse::Pulse;
use crate::assignment::Assignment;
use crate::commands::demo::Arguments;
use crate::commands::send::{check_message, job_kind};
use crate::failure::Failure;
use crate::live::machine::{Machine, Simulated};
use crate::live::progress::Bar;
use crate::live::transfer_failure;
use crate::plugin::{AnyInstance, Chosen};
use crate::screen::Screen;

/// What the parts of the demonstration share.
pub(super) struct DemoContext<'a> {
    pub(super) arguments: &'a Arguments,
    pub(super) screen: &'a Screen,
    pub(super) stop: &'a AtomicBool,
    pub(super) pulse: Pulse,
}

/// How a part of the demonstration ended.
pub(super) enum Shown {
    /// What machines get of it.
    Good(Value),
    Aborted,
    /// Why, in a sentence.
    Failed(String),
}

impl DemoContext<'_> {
    /// The plug-in in its sandbox.
    pub(super) fn plugin(&self, name: &str) -> Result<Chosen, Failure> {
        self.arguments.library.load(name)
    }

    /// Whether somebody wants it to end.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sends a program as one job.
    pub(super) fn send(
        &self,
        plugin: &Chosen,
        station: &mut Station<AnyInstance>,
        program: &[u8],
    ) -> Result<SendReport, Failure> {
        let options = SendOptions {
            check: plugin.manifest().needs.check_pass,
            size: Some(program.len() as u64),
            job_kind: job_kind(plugin.manifest())?,
            ..SendOptions::default()
        };
        let bar = Bar::new(options.size, self.screen);
        let mut source = Cursor::new(program);
        let sent = transfer::send(station, &mut source, &options, self.stop, &mut |progress| {
            bar.show(progress);
        });
        bar.end();
        sent.map_err(transfer_failure)
    }
}

/// A station on the machine's pty.
pub(super) fn station<P: Simulated>(
    plugin: &Chosen,
    machine: &Machine<P>,
    line: LineParameters,
    settings: &[(&str, &str)],
) -> Result<Station<AnyInstance>, Failure> {
    let asked = settings
        .iter()
        .map(|(name, value)| Assignment { name: (*name).to_owned(), value: (*value).to_owned() });
    let settings = plugin.settings(&asked.collect::<Vec<_>>())?;
    let port = Port::open(&machine.port(), &PortOptions::new(line))?;
    let options = StationOptions { settings, ..StationOptions::default() };
    Ok(Station::new(port, plugin.instantiate()?, options)?)
}

/// Why a sending did not go well.
pub(super) fn why(plugin: &Chosen, outcome: SendOutcome) -> String {
    let manifest = plugin.manifest();
    match outcome {
        SendOutcome::Done => "the machine did not get what was sent".to_owned(),
        SendOutcome::Aborted => "aborted".to_owned(),
        SendOutcome::Failed { failure, status } => {
            format!("the transfer failed: {}", reason(manifest, failure, status))
        }
        SendOutcome::CheckFailed { failure, status, line, column } => {
            check_message(manifest, "the program", failure, status, line, column)
        }
    }
}

/// A machine on its own thread.
pub(super) struct Worker<P> {
    stop: Arc<AtomicBool>,
    may_end: Arc<AtomicBool>,
    thread: thread::JoinHandle<Result<Machine<P>, PortError>>,
}

impl<P: Simulated + Send + 'static> Worker<P> {
    pub(super) fn start(mut machine: Machine<P>) -> Self {
        let (stop, may_end) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let (is_stopped, ends) = (Arc::clone(&stop), Arc::clone(&may_end));
        let thread = thread::spawn(move || {
            // A partner that pauses for long is no reason to go away.
            loop {
                machine.run(&is_stopped)?;
                if is_stopped.load(Ordering::Relaxed) || ends.load(Ordering::Relaxed) {
                    return Ok(machine);
                }
            }
        });
        Self { stop, may_end, thread }
    }

    /// Waits for the machine's own end, or ends it now.
    pub(super) fn end(self, now: bool) -> Result<Machine<P>, Failure> {
        self.may_end.store(true, Ordering::Relaxed);
        self.stop.store(now, Ordering::Relaxed);
        match self.thread.join() {
            Ok(machine) => Ok(machine?),
            Err(_) => Err(Failure::internal("the simulated machine has met a wrong state")),
        }
    }
}

/// A surface milled line by line, of `length` bytes or a block more, from `%`
/// to `%`.
pub(super) fn program(length: usize) -> Vec<u8> {
    let mut text = String::with_capacity(length + 64);
    text.push_str("%\nO0001 (SURFACE)\nG90 G54 G17\nS12000 M3\n");
    let (mut number, mut x, mut y) = (10_u32, 0_i64, 0_i64);
    while text.len() < length {
        // A shallow bowl, in thousandths.
        let z = (x - 50_000).pow(2) / 500_000 + (y - 50_000).pow(2) / 500_000 - 10_000;
        let _ = writeln!(
            text,
            "N{number} G1 X{}.{:03} Y{}.{:03} Z{}{}.{:03}",
            x / 1_000,
            x % 1_000,
            y / 1_000,
            y % 1_000,
            if z < 0 { "-" } else { "" },
            z.abs() / 1_000,
            z.abs() % 1_000
        );
        number = if number >= 99_990 { 10 } else { number + 10 };
        x += 137;
        if x > 100_000 {
            (x, y) = (0, (y + 250) % 100_000);
        }
    }
    text.push_str("M5\nM30\n%\n");
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_is_one_and_long_enough() {
        let program = program(100_000);
        assert!((100_000..100_100).contains(&program.len()), "{}", program.len());
        let text = String::from_utf8(program).unwrap();
        assert!(text.starts_with("%\nO0001") && text.ends_with("M30\n%\n"));
        assert!(text.lines().all(|line| line.len() < 80 && line.is_ascii()));
    }
}
