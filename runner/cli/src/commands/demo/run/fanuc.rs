//! The fourth part: drip feed, a punch, and a request from the panel.

use std::io::{self, Cursor};
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::json;
use softplug_abi::{Failure as Why, Micros};
use softplug_live::transfer::{
    self, Delivered, News, Program, Reply, Request, SendOutcome, ServeHandler, ServeOptions,
};
use softplug_machines::fanuc::{Feeding, Options, Press, Report, eight_none_two};

use super::context::{DemoContext, Shown, Worker, program, station, why};
use crate::commands::send::job_kind;
use crate::commands::simulate::Fanuc;
use crate::commands::simulate::{FanucSimulation, RunOptions};
use crate::failure::Failure;
use crate::live::machine::Machine;
use crate::live::transfer_failure;
use crate::numbers;
use crate::plugin::Chosen;
use crate::screen::{GOOD, HEADING};

const BAUD: u32 = 9_600;
const PROGRAM_BYTES: usize = 3_000;
/// Less than the line brings, so that the control must hold.
const BLOCK_TIME: Micros = Micros::from_millis(60);
/// A control that has raised an alarm because this computer is too busy says nothing more.
const PATIENCE: [(&str, &str); 2] = [("dc1_timeout", "20000"), ("held_timeout", "20000")];
/// The program that the operator asks for.
const NAME: &str = "O1234";

pub(super) fn show(context: &DemoContext<'_>, plugin: &Chosen) -> Result<Shown, Failure> {
    let screen = context.screen;
    screen.say(format_args!(
        "{HEADING}4. FANUC RS-232: drip feed, a punch, a request from the panel{HEADING:#}\n\
         A simulated control with a buffer of 512 characters executes the program while it comes,\n\
         and stops the plug-in with DC3: more than ten characters after that are alarm 087."
    ));
    let program = program(PROGRAM_BYTES);
    let feeding = Feeding::Drip { cycle_start: 128, feed_holds: Vec::new() };
    let options = Options {
        block_time: BLOCK_TIME,
        feeding,
        panel: vec![(Micros::from_millis(300), Press::Read)],
        ..control()
    };
    let machine = machine(options)?;
    let mut port = station(plugin, &machine, eight_none_two(BAUD), &PATIENCE)?;
    let worker = Worker::start(machine);
    let sent = context.send(plugin, &mut port, &program);
    let is_done = sent.as_ref().is_ok_and(|report| report.outcome == SendOutcome::Done);
    let seen = worker.end(!is_done)?.partner().control.report();
    context.pulse.saw(seen.late);
    let report = sent?;
    if report.outcome == SendOutcome::Aborted {
        return Ok(Shown::Aborted);
    }
    if !is_done || !is_good(&seen, &program) {
        return Ok(Shown::Failed(complaint(&why(plugin, report.outcome), &seen)));
    }
    let after = &seen.characters_after_dc3;
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#}: {} in {}, held {}, no alarm.\n\
         Characters that came after a DC3: p99 {}, most {}; execution waited {}.",
        numbers::things(seen.blocks, "block"),
        numbers::span(report.elapsed),
        numbers::things(seen.holds.into(), "time"),
        after.percentile(99),
        after.max(),
        numbers::things(seen.starved.into(), "time"),
    ));

    let (counter, dialogue) = dialogue(context, plugin, &program)?;
    if context.is_stopped() {
        return Ok(Shown::Aborted);
    }
    let Some((name, text)) = counter.punched.first() else {
        return Ok(Shown::Failed(complaint("nothing was punched", &dialogue)));
    };
    let is_whole = text.as_slice() == program && name.as_deref() == Some("O0001");
    if !is_whole || counter.sent != Some(SendOutcome::Done) || !is_good(&dialogue, &program) {
        return Ok(Shown::Failed(complaint("the dialogue went wrong", &dialogue)));
    }
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#}: the control punched {}, its operator asked for {NAME}, and it\n\
         read that: {}.\n",
        name.as_deref().unwrap_or_default().escape_debug(),
        numbers::things(dialogue.blocks, "block"),
    ));
    Ok(Shown::Good(json!({
        "blocks": seen.blocks,
        "seconds": numbers::seconds(report.elapsed),
        "holds": seen.holds,
        "most_after_dc3": after.max(),
        "alarms": 0,
        "requests": 1,
    })))
}

/// The control punches a program, then its operator asks for one.
fn dialogue(
    context: &DemoContext<'_>,
    plugin: &Chosen,
    program: &[u8],
) -> Result<(Counter, Report), Failure> {
    let inside = program.strip_prefix(b"%\n").and_then(|rest| rest.strip_suffix(b"%\n"));
    let inside = inside.ok_or_else(|| Failure::internal("the program has no marks"))?.to_vec();
    let line = eight_none_two(BAUD);
    // After the whole punch, and its quiet time.
    let punched_by = line.characters(program.len() as u64) + Micros::from_millis(1_500);
    let panel = vec![
        (Micros::from_millis(300), Press::Punch(inside)),
        (punched_by, Press::Request(NAME.to_owned())),
    ];
    let machine = machine(Options { panel, ..control() })?;
    let mut port = station(plugin, &machine, line, &PATIENCE)?;
    let worker = Worker::start(machine);
    let done = AtomicBool::new(false);
    let mut counter = Counter {
        program: program.to_vec(),
        job_kind: job_kind(plugin.manifest())?,
        check: plugin.manifest().needs.check_pass,
        ..Counter::default()
    };
    let options =
        ServeOptions { give_up_after: Some(std::time::Duration::from_secs(10)), deliveries: None };
    let mut watched = Watched { counter: &mut counter, done: &done };
    let served = transfer::serve(&mut port, &mut watched, &options, &done, &mut |_| {
        if context.is_stopped() {
            done.store(true, Ordering::Relaxed);
        }
    });
    let is_done = counter.sent == Some(SendOutcome::Done);
    let seen = worker.end(!is_done)?.partner().control.report();
    context.pulse.saw(seen.late);
    served.map_err(transfer_failure)?;
    Ok((counter, seen))
}

fn control() -> Options {
    // A pty brings characters in bursts, which no UART does.
    Options { line: eight_none_two(BAUD), receive_fifo: 65_536, ..Options::default() }
}

fn machine(options: Options) -> Result<Machine<Fanuc>, Failure> {
    let last_press = options.panel.last().map_or(Micros::ZERO, |(at, _)| *at);
    let simulation = FanucSimulation { options, last_press, run: RunOptions::default() };
    Ok(Machine::new(Fanuc::new(&simulation)?, Some(Micros::from_millis(1_000)))?)
}

/// What a control keeps of a program begins after its first block.
fn is_good(seen: &Report, program: &[u8]) -> bool {
    let kept = program.strip_prefix(b"%\n").and_then(|rest| rest.strip_suffix(b"\n"));
    seen.alarms.is_empty() && kept.is_some_and(|kept| seen.received.matches(kept))
}

fn complaint(what: &str, seen: &Report) -> String {
    match seen.alarms.first() {
        None => what.to_owned(),
        Some(alarm) => format!("{what}; the control shows alarm {:03}", alarm.kind.number()),
    }
}

/// Keeps what was punched, and hands out the one program that there is.
#[derive(Default)]
struct Counter {
    program: Vec<u8>,
    job_kind: u16,
    check: bool,
    under_way: Vec<u8>,
    /// Name and text.
    punched: Vec<(Option<String>, Vec<u8>)>,
    sent: Option<SendOutcome>,
}

/// Ends the dialogue when the program that was asked for has been sent.
struct Watched<'a> {
    counter: &'a mut Counter,
    done: &'a AtomicBool,
}

impl ServeHandler for Watched<'_> {
    fn begin(&mut self) -> io::Result<()> {
        self.counter.under_way.clear();
        Ok(())
    }

    fn deliver(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.counter.under_way.extend_from_slice(bytes);
        Ok(())
    }

    fn end(&mut self, delivered: &Delivered) -> io::Result<()> {
        if delivered.failure.is_none() {
            let text = std::mem::take(&mut self.counter.under_way);
            self.counter.punched.push((delivered.name.clone(), text));
        }
        Ok(())
    }

    fn asked(&mut self, request: &Request) -> Reply {
        let Counter { program, job_kind, check, .. } = &*self.counter;
        let asks_for_it = request.fields.windows(NAME.len()).any(|part| part == NAME.as_bytes());
        if !asks_for_it {
            return Reply::Refused(Why::NotFound);
        }
        let mut sent = Program::new(NAME, *job_kind, Box::new(Cursor::new(program.clone())));
        sent.size = Some(program.len() as u64);
        sent.check = *check;
        Reply::Program(sent)
    }

    fn tell(&mut self, news: &News<'_>) {
        if let News::JobEnds(report) = news {
            self.counter.sent = Some(report.outcome);
            self.done.store(true, Ordering::Relaxed);
        }
    }
}
