//! A unit with its plug-in, the line, and the control at its other end.

use softplug_abi::{Action, Failure, Instance, JobId, LineParameters, Micros};
use softplug_link::{Job, LinkFault, LinkHost, LinkOptions, Supply, WireHost};
use softplug_machines::kept::Keep;
use softplug_machines::xon_xoff::{Control, ControlOptions, ControlReport};
use softplug_plan::{Dry, MachineOutcome, Outcome, Sample};
use softplug_trial::ClosedLoop;
use softplug_unit_bus::Unit as Level;

use crate::error::ShopFault;
use crate::{Options, program};

/// Data bits of all bits of a character 8N1.
const DATA: f64 = 0.8;
/// Characters that a unit's port holds ahead of the wire.
const DEPTH: usize = 2;
/// Characters that still come after XOFF has been sent, and a few.
const LEAST_FREE: usize = 4;
/// Looks at a machine whose levels are not kept.
const FEW_SAMPLES: f64 = 64.0;
const JOB: u32 = 1;

/// What a unit runs.
#[derive(Debug)]
pub struct Unit<I> {
    /// A plug-in for XON/XOFF. Its job kind 0 is to send a program.
    pub instance: I,
    /// Settings and rooms. The line's parameters are those of the shop.
    pub options: LinkOptions,
}

pub(crate) struct Machine<I: Instance> {
    name: String,
    both: ClosedLoop<I, Control>,
    data: Data,
    /// What its control takes at most, in bits per second, and its line carries.
    takes: f64,
    carries: f64,
    control_bytes: u64,
    samples: Samples,
    /// What the control had told by the last sample.
    told: (u32, Micros),
    dry: Vec<Dry>,
}

impl<I: Instance> Machine<I> {
    pub(crate) fn begin(
        name: String,
        planned: &softplug_plan::Machine,
        buffer: f64,
        unit: Unit<I>,
        options: &Options,
    ) -> Result<Self, ShopFault<I::Fault>> {
        let bits_per_second = (planned.line() / DATA).round();
        if bits_per_second > f64::from(u32::MAX) {
            return Err(ShopFault::Rate { machine: name, bits_per_second });
        }
        let line = LineParameters::new(bits_per_second as u32);
        let control = match control(planned, line) {
            Ok(control) => control,
            Err(error) => return Err(ShopFault::Control { machine: name, error }),
        };
        let settings = LinkOptions { line, ..unit.options };
        let room = (buffer / 8.0) as u64;
        let mut machine = Self {
            name,
            both: ClosedLoop::new(unit.instance, settings, DEPTH, control),
            data: Data { room, level: room, given: 0, end: None },
            takes: planned.consumes,
            carries: planned.line(),
            control_bytes: planned.buffer,
            samples: Samples::new(options),
            told: (0, Micros::ZERO),
            dry: Vec::new(),
        };
        machine.open().map_err(|error| machine.broken(error))?;
        Ok(machine)
    }

    fn open(&mut self) -> Result<(), LinkFault<I::Fault>> {
        let now = Micros::ZERO;
        let job = Job { id: JobId(JOB), kind: 0, size: None, fields: Vec::new(), check: false };
        self.both.line.link.open(now, &mut self.data)?;
        self.both.line.link.begin_job(now, job, &mut self.data)?;
        self.both.settle(&mut self.data)
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// As the scheduler is told of it.
    pub(crate) fn as_unit(&self) -> Level {
        let capacity = self.data.room as f64 * 8.0;
        let level = self.data.level as f64 * 8.0;
        Level { level, ..Level::working(capacity, self.takes.min(self.carries)) }
    }

    /// A frame has come.
    pub(crate) fn comes(&mut self, bytes: u64) {
        self.data.level += bytes;
    }

    pub(crate) fn go_to(&mut self, now: Micros) -> Result<(), ShopFault<I::Fault>> {
        // What has come may be asked for already.
        self.both
            .settle(&mut self.data)
            .and_then(|()| self.both.wait_until(now, &mut self.data))
            .map_err(|error| self.broken(error))?;
        if let Some(end) = self.data.end {
            let machine = self.name.clone();
            return Err(match end {
                End::Failed(failure) => ShopFault::Job { machine, failure },
                End::Done => ShopFault::Done { machine },
            });
        }
        if self.samples.is_due(now) {
            self.look(now);
        }
        Ok(())
    }

    fn broken(&self, error: LinkFault<I::Fault>) -> ShopFault<I::Fault> {
        ShopFault::Plugin { machine: self.name.clone(), error }
    }

    fn look(&mut self, now: Micros) -> ControlReport {
        let report = self.both.partner.report();
        let told = (report.starved, report.starved_for);
        if told.0 > self.told.0 && self.dry.len() < Outcome::MOST_DRY {
            let seconds = (told.1 - self.told.1).as_secs_f64();
            self.dry.push(Dry { from: now.as_secs_f64() - seconds, seconds });
        }
        self.told = told;
        let control = report.received.count().saturating_sub(report.consumed);
        self.samples.push(now, self.data.level, control);
        report
    }

    /// Whether another byte came than was sent.
    pub(crate) fn is_altered(&self) -> bool {
        let received = self.both.partner.report().received;
        let mut sent = vec![0; received.count() as usize];
        program::write(0, &mut sent);
        received.count() > self.data.given || !received.matches(&sent)
    }

    pub(crate) fn conclude(mut self) -> MachineOutcome {
        let report = self.look(self.both.now());
        MachineOutcome {
            name: self.name,
            times_dry: report.starved.into(),
            seconds_dry: report.starved_for.as_secs_f64(),
            dry: self.dry,
            overflow_bits: report.alarms.len() as f64 * 8.0,
            short_fills: 0,
            lowest_control_bits: self.samples.lowest as f64 * 8.0,
            unit_size_bits: self.data.room as f64 * 8.0,
            control_size_bits: self.control_bytes as f64 * 8.0,
            levels: self.samples.kept,
        }
    }
}

/// A control that is filled before it begins to execute.
fn control(
    planned: &softplug_plan::Machine,
    line: LineParameters,
) -> Result<Control, softplug_machines::xon_xoff::ControlOptionsError> {
    let buffer = usize::try_from(planned.buffer).unwrap_or(usize::MAX);
    let low = (buffer / 8).max(LEAST_FREE);
    Control::new(ControlOptions {
        line,
        buffer,
        low,
        high: (buffer / 4).max(low),
        rate: (planned.consumes / 8.0).round().clamp(1.0, f64::from(u32::MAX)) as u32,
        pauses: vec![(0, line.characters(planned.buffer))],
        keep: Keep::Digest,
        ..ControlOptions::default()
    })
}

/// How a job has ended.
#[derive(Clone, Copy, Debug)]
enum End {
    Done,
    Failed(Failure),
}

/// The unit's buffer, which the bus fills and the plug-in empties.
#[derive(Debug)]
struct Data {
    room: u64,
    level: u64,
    /// Bytes of the program that the plug-in has been given.
    given: u64,
    /// The job has ended, and why.
    end: Option<End>,
}

impl LinkHost for Data {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } => self.end = Some(End::Done),
            Action::JobFailed { failure, .. } => self.end = Some(End::Failed(*failure)),
            _ => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let count = self.level.min(buffer.len() as u64);
        if count == 0 {
            return Supply::Later;
        }
        program::write(self.given, &mut buffer[..count as usize]);
        self.level -= count;
        self.given += count;
        Supply::Bytes(count as usize)
    }
}

impl WireHost for Data {}

/// Levels at moments that are the same span apart.
struct Samples {
    every: Micros,
    next: Micros,
    keeps: bool,
    lowest: u64,
    kept: Vec<Sample>,
}

impl Samples {
    fn new(options: &Options) -> Self {
        let count = if options.keeps_levels { Outcome::MOST_SAMPLES as f64 } else { FEW_SAMPLES };
        Self {
            every: Micros((options.seconds * 1e6 / count) as i64 + 1),
            next: Micros::ZERO,
            keeps: options.keeps_levels,
            lowest: u64::MAX,
            kept: Vec::new(),
        }
    }

    fn is_due(&self, now: Micros) -> bool {
        now >= self.next
    }

    fn push(&mut self, now: Micros, unit: u64, control: u64) {
        self.next = now + self.every;
        // The control is filled before it begins.
        self.lowest = self.lowest.min(control);
        let at = now.as_secs_f64();
        let is_new = self.kept.last().is_none_or(|last| last.at < at);
        if self.keeps && is_new && self.kept.len() < Outcome::MOST_SAMPLES {
            self.kept.push(Sample { at, unit: unit as f64 * 8.0, control: control as f64 * 8.0 });
        }
    }
}
