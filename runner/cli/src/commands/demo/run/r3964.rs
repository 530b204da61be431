//! The second and third part: blocks both ways over a faulty line.

use std::io;
use std::time::Duration;

use serde_json::json;
use softplug_abi::{LineParameters, Micros};
use softplug_live::transfer::{
    self, Delivered, News, Reply, Request, SendOutcome, SendReport, ServeHandler, ServeOptions,
};
use softplug_machines::r3964::{Fault, Faults, Noise, Options, Report, Station as Partner, When};

use super::context::{DemoContext, Shown, Worker, station, why};
use crate::commands::simulate::R3964;
use crate::commands::simulate::{R3964Simulation, RunOptions};
use crate::failure::Failure;
use crate::live::machine::Machine;
use crate::live::transfer_failure;
use crate::numbers;
use crate::plugin::Chosen;
use crate::screen::{GOOD, HEADING};

const BAUD: u32 = 38_400;
const BLOCKS: usize = 6;

/// What differs between 3964R and simplified 3964R.
pub(super) struct Variant {
    heading: &'static str,
    text: &'static str,
    block_bytes: usize,
    settings: &'static [(&'static str, &'static str)],
    options: fn() -> Options,
    /// What the machine does wrong with what we send, and with what it sends.
    to_machine: fn() -> Vec<(When, Fault)>,
    from_machine: fn() -> Vec<(When, Fault)>,
}

pub(super) const FULL: Variant = Variant {
    heading: "2. 3964R: blocks over a faulty line",
    text: "The machine refuses our second block, leaves the fourth unanswered, and sends its third\n\
           with a wrong check character.",
    block_bytes: 256,
    settings: &[("split", "on"), ("block_size", "256")],
    options: Options::default,
    to_machine: || vec![(When::Nth(2), Fault::NakAcknowledgement), (When::Nth(4), Fault::NoAnswer)],
    from_machine: || vec![(When::Nth(3), Fault::WrongCheck)],
};

pub(super) const SIMPLIFIED: Variant = Variant {
    heading: "3. Simplified 3964R: three tries to begin, one to send",
    text: "The machine refuses to begin with our first block, and with our fourth.",
    block_bytes: 128,
    settings: &[("split", "on")],
    options: Options::simplified,
    to_machine: || vec![(When::Nth(1), Fault::NakAnswer), (When::Nth(4), Fault::NakAnswer)],
    from_machine: Vec::new,
};

pub(super) fn show(
    context: &DemoContext<'_>,
    plugin: &Chosen,
    variant: &Variant,
) -> Result<Shown, Failure> {
    let screen = context.screen;
    screen.say(format_args!("{HEADING}{}{HEADING:#}\n{}", variant.heading, variant.text));
    let data: Vec<u8> = (0..BLOCKS * variant.block_bytes).map(|at| at as u8).collect();
    let (report, seen) = sent(context, plugin, variant, &data)?;
    if report.outcome == SendOutcome::Aborted {
        return Ok(Shown::Aborted);
    }
    let arrived: Vec<u8> = seen.received.iter().flat_map(|block| block.data.clone()).collect();
    if report.outcome != SendOutcome::Done || arrived != data {
        return Ok(Shown::Failed(why(plugin, report.outcome)));
    }
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#}: {} in {}, {} for them, {} NAKs of the machine.",
        numbers::things(seen.received.len() as u64, "block"),
        numbers::span(report.elapsed),
        numbers::bytes(report.sent),
        numbers::count(seen.naks.into()),
    ));
    let (deliveries, seen) = received(context, plugin, variant, &data)?;
    if context.is_stopped() {
        return Ok(Shown::Aborted);
    }
    let sent: Vec<&[u8]> = data.chunks(variant.block_bytes).collect();
    if deliveries != sent {
        let count = deliveries.len();
        return Ok(Shown::Failed(format!("{count} of {BLOCKS} blocks came as they were sent")));
    }
    let repetitions: u32 = seen.sent.iter().map(|block| block.blocks.saturating_sub(1)).sum();
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#} from the machine: {}, {}.\n",
        numbers::things(deliveries.len() as u64, "block"),
        numbers::things(repetitions.into(), "repetition"),
    ));
    Ok(Shown::Good(json!({
        "blocks": BLOCKS,
        "seconds": numbers::seconds(report.elapsed),
        "sent": report.sent,
        "repetitions_received": repetitions,
    })))
}

fn sent(
    context: &DemoContext<'_>,
    plugin: &Chosen,
    variant: &Variant,
    data: &[u8],
) -> Result<(SendReport, Report), Failure> {
    let machine = machine(variant, (variant.to_machine)(), Vec::new(), None)?;
    let line = LineParameters::new(BAUD);
    let mut station = station(plugin, &machine, line, variant.settings)?;
    let worker = Worker::start(machine);
    let sent = context.send(plugin, &mut station, data);
    let seen = worker.end(true)?.partner().report().clone();
    context.pulse.saw(seen.late);
    Ok((sent?, seen))
}

/// The deliveries, and what the machine says of its blocks.
fn received(
    context: &DemoContext<'_>,
    plugin: &Chosen,
    variant: &Variant,
    data: &[u8],
) -> Result<(Vec<Vec<u8>>, Report), Failure> {
    let blocks = data.chunks(variant.block_bytes).map(<[u8]>::to_vec).collect();
    let quiet = Some(Micros::from_millis(500));
    let machine = machine(variant, (variant.from_machine)(), blocks, quiet)?;
    let line = LineParameters::new(BAUD);
    let mut station = station(plugin, &machine, line, variant.settings)?;
    let worker = Worker::start(machine);
    let mut handler = Blocks::default();
    let options = ServeOptions {
        give_up_after: Some(Duration::from_secs(10)),
        deliveries: Some(BLOCKS as u64),
    };
    let served = transfer::serve(&mut station, &mut handler, &options, context.stop, &mut |_| {});
    let is_complete = handler.complete.len() == BLOCKS;
    let seen = worker.end(!is_complete)?.partner().report().clone();
    context.pulse.saw(seen.late);
    served.map_err(transfer_failure)?;
    Ok((handler.complete, seen))
}

fn machine(
    variant: &Variant,
    faults: Vec<(When, Fault)>,
    blocks: Vec<Vec<u8>>,
    quiet_time: Option<Micros>,
) -> Result<Machine<R3964<Partner>>, Failure> {
    let simulation = R3964Simulation {
        options: Options {
            line: LineParameters::new(BAUD),
            block_size: variant.block_bytes,
            faults: Faults { seed: 1, plan: faults },
            ..(variant.options)()
        },
        noise: Noise::default(),
        blocks,
        send_after: Micros::from_millis(200),
        every: Micros::ZERO,
        memory: None,
        run: RunOptions::default(),
    };
    let partner = Partner::new(simulation.options.clone()).map_err(Failure::usage)?;
    Ok(Machine::new(R3964::new(&simulation, partner), quiet_time)?)
}

/// Keeps complete deliveries.
#[derive(Default)]
struct Blocks {
    under_way: Vec<u8>,
    complete: Vec<Vec<u8>>,
}

impl ServeHandler for Blocks {
    fn begin(&mut self) -> io::Result<()> {
        self.under_way.clear();
        Ok(())
    }

    fn deliver(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.under_way.extend_from_slice(bytes);
        Ok(())
    }

    fn end(&mut self, delivered: &Delivered) -> io::Result<()> {
        if delivered.failure.is_none() {
            self.complete.push(std::mem::take(&mut self.under_way));
        }
        Ok(())
    }

    fn asked(&mut self, _request: &Request) -> Reply {
        Reply::Refused(softplug_abi::Failure::NotSupported)
    }

    fn tell(&mut self, _news: &News<'_>) {}
}
