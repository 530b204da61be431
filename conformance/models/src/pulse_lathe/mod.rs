//! The pulse lathe: what its page says, a program at a time.
//!
//! - `octal`, `iso`: the two languages, as blocks
//! - `program`: blocks as what they ask for, one thing after the other
//! - `pulses`: what pulses in which period
//! - `run`: a job on the line
//! - `blame`: which clause is broken
//! - `propose`: what a machine and a host could do
//! - `rules`: the settings

mod blame;
mod iso;
mod octal;
mod program;
mod propose;
mod pulses;
mod rules;
mod run;

use crate::demands::Demands;
use crate::dice::Dice;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Profile, Proposal};
use crate::port::Port;
use program::Item;
use rules::Rules;
use run::Job;
use softplug_abi::{Failure, LineParameters, Micros, Parity};

pub(crate) const PROFILE: Profile = Profile {
    name: "pulse-lathe",
    clauses: &[
        "pulse-lathe.cut.arc",
        "pulse-lathe.cut.arc-pulses",
        "pulse-lathe.cut.direction",
        "pulse-lathe.cut.feed",
        "pulse-lathe.cut.index",
        "pulse-lathe.cut.quadrant",
        "pulse-lathe.cut.taper",
        "pulse-lathe.cut.thread",
        "pulse-lathe.cut.thread-fast",
        "pulse-lathe.iso.arc",
        "pulse-lathe.iso.feed",
        "pulse-lathe.iso.line",
        "pulse-lathe.iso.other",
        "pulse-lathe.iso.position",
        "pulse-lathe.iso.refused",
        "pulse-lathe.line.byte",
        "pulse-lathe.line.command",
        "pulse-lathe.line.echo",
        "pulse-lathe.line.echo-time",
        "pulse-lathe.line.end",
        "pulse-lathe.line.follows",
        "pulse-lathe.link.close",
        "pulse-lathe.link.down",
        "pulse-lathe.link.swap",
        "pulse-lathe.run.hold",
        "pulse-lathe.run.limit",
        "pulse-lathe.run.one-job",
        "pulse-lathe.run.position",
        "pulse-lathe.run.single-block",
        "pulse-lathe.run.start-block",
        "pulse-lathe.run.stop",
        "pulse-lathe.words.as-before",
        "pulse-lathe.words.decode",
        "pulse-lathe.words.dwell",
        "pulse-lathe.words.loop",
        "pulse-lathe.words.memory",
        "pulse-lathe.words.offset",
        "pulse-lathe.words.refused",
        "pulse-lathe.words.zero",
    ],
    values: &[
        ("input", &["octal", "iso", "octal", "iso"]),
        ("start_block", &["1", "1", "1", "2", "3", "5"]),
        ("single_block", &["off", "off", "on"]),
        ("diameter", &["on", "on", "off"]),
        ("dwell", &["2", "0", "1", "7"]),
        ("spindle_increments", &["100", "1024", "1", "63", "4096", "65535"]),
        ("echo_time", &["1000", "10", "50", "10000"]),
        ("ahead", &["100", "4", "20", "250"]),
        ("underrun", &["note", "stop"]),
        ("x_offset_1", &["0", "3", "-2"]),
        ("z_offset_1", &["0", "-5", "1"]),
        ("x_offset_2", &["2", "0", "-7"]),
        ("z_offset_2", &["0", "4"]),
        ("x_offset_3", &["0", "1"]),
        ("z_offset_3", &["0", "1"]),
        ("x_offset_4", &["0", "-1"]),
        ("z_offset_4", &["0", "3"]),
        ("x_offset_5", &["0", "2"]),
        ("z_offset_5", &["0", "2"]),
        ("x_offset_6", &["0", "5"]),
        ("z_offset_6", &["0", "-3"]),
        ("x_offset_7", &["0", "-4"]),
        ("z_offset_7", &["0", "6"]),
    ],
    presets: &[],
    lines: &[LineParameters {
        baud: 40_000,
        data_bits: 8,
        parity: Parity::None,
        stop_half_bits: 2,
    }],
    rooms: &[],
    modem_lines: &[None],
    special: &[0xF0, 0xF1, 0xF2, 0xF6, 0x40, 0x3F, 0x80, 0xC0, 0x05],
    start: |conditions| Some(Box::new(Lathe::new(conditions))),
};

/// The host's side of a pulse lathe.
#[derive(Clone, Debug)]
struct Lathe {
    rules: Rules,
    port: Port,
    demands: Demands,
    now: Micros,
    is_open: bool,
    is_down: bool,
    /// Pulses of x and z that have left, or are in the port, since the link opened.
    place: (i64, i64),
    job: Option<Job>,
    /// The id of the latest job.
    jobs: u32,
    /// Characters of an earlier job that are still in the port.
    stale: usize,
    /// Characters are being heard: what has left is told behind all of them.
    is_hearing: bool,
    /// Nothing is judged any more.
    is_blind: bool,
}

impl Model for Lathe {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        self.now = at;
        self.is_hearing = true;
        match input {
            LineInput::Bytes(bytes) => bytes.iter().for_each(|byte| self.hears(*byte)),
            LineInput::Damaged { .. } | LineInput::ModemLines(..) => {}
            LineInput::Down(_) => {
                self.is_down = true;
                self.stops(Failure::LinkDown, 0, "pulse-lathe.link.down");
                self.port.set_gone(true);
            }
            LineInput::Up => {
                self.is_down = false;
                self.port.set_gone(false);
            }
        }
    }

    fn left(&mut self, at: Micros, byte: u8) {
        self.now = at;
        self.port.left();
        // A hold and a stop are none of a job's.
        let is_foreign = byte == 0xE0 || byte == 0xE1 || self.stale > 0;
        if let Some(job) = self.job.as_mut().filter(|_| is_foreign) {
            job.foreign = job.foreign.saturating_sub(1);
        }
        if byte == 0xE0 || byte == 0xE1 {
            return;
        }
        if self.stale > 0 {
            self.stale -= 1;
        } else {
            self.has_left();
        }
    }

    fn due(&mut self, at: Micros) {
        self.now = at;
        self.is_hearing = false;
        if let Some(job) = &mut self.job {
            job.is_news = false;
        }
        if self.job.as_ref().and_then(Job::deadline).is_some_and(|deadline| deadline <= at) {
            self.stops(Failure::NoAnswer, 0, "pulse-lathe.line.echo-time");
        }
    }

    fn host(&mut self, at: Micros, request: &HostRequest) {
        self.now = at;
        match request {
            HostRequest::Open => {
                (self.is_open, self.is_down) = (true, false);
                self.port.set_gone(false);
                self.place = (0, 0);
            }
            HostRequest::Close => self.closes(),
            HostRequest::Job { id, data, .. } => self.begins(*id, data),
            HostRequest::Pause(id) => self.pauses(*id, true),
            HostRequest::Resume(id) => self.pauses(*id, false),
            HostRequest::Abort(id) => {
                if self.job.as_ref().is_some_and(|job| job.id == *id) {
                    self.stops(Failure::Aborted, 0, "pulse-lathe.run.stop");
                }
            }
            HostRequest::ForceResume => self.starts_again(),
            HostRequest::Keep
            | HostRequest::PutAway(_)
            | HostRequest::PutAllAway
            | HostRequest::Answer(..) => {}
        }
    }

    fn seen(&mut self, _at: Micros, effect: &Effect) -> Result<(), Broken> {
        if self.is_blind {
            return Ok(());
        }
        let Effect::Byte(byte) = effect else { return self.demands.meet(effect, &blame::BLAME) };
        let clause = self.clause_of(*byte);
        self.port.begins(*byte, clause)?;
        if let Some(job) = self.job.as_mut().filter(|_| *byte != 0xE0 && *byte != 0xE1) {
            job.begun += 1;
        }
        Ok(())
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        if self.is_blind {
            return Ok(());
        }
        self.demands.settled()?;
        let clause = self.clause_of_silence();
        self.port.settled(clause)
    }

    fn next(&self) -> Option<Micros> {
        self.job.as_ref().and_then(Job::deadline)
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        propose::next(self, now, dice)
    }
}

impl Lathe {
    fn new(conditions: &Conditions) -> Self {
        Self {
            rules: Rules::new(conditions),
            port: Port::new(conditions.depth),
            demands: Demands::default(),
            now: Micros::ZERO,
            is_open: false,
            is_down: false,
            place: (0, 0),
            job: None,
            jobs: 0,
            stale: 0,
            is_hearing: false,
            is_blind: false,
        }
    }

    fn begins(&mut self, id: u32, data: &[u8]) {
        self.jobs = id;
        if self.job.is_some() {
            let busy = Effect::Failed { job: id, failure: Failure::Busy, status: 0, sent: 0 };
            return self.demands.add(busy, "pulse-lathe.run.one-job");
        }
        let read = if self.rules.is_iso { iso::read } else { octal::read };
        let clause =
            if self.rules.is_iso { "pulse-lathe.iso.refused" } else { "pulse-lathe.words.refused" };
        match read(data, &self.rules, self.place) {
            Ok(items) => {
                self.is_blind |= items.contains(&Item::Unknown);
                let good =
                    Effect::Checked { job: id, failure: None, status: 0, line: 0, column: 0 };
                self.demands.add(good, clause);
                // What a job before has left in the port is none of this one's.
                self.stale = self.port.inside() - self.port.inside_of(&[0xE0, 0xE1]);
                self.job = Some(Job::new(id, items));
                self.goes_on();
            }
            Err((status, line, column)) => {
                let failure = Some(Failure::BadJob);
                self.demands
                    .add(Effect::Checked { job: id, failure, status, line, column }, clause);
            }
        }
    }

    fn closes(&mut self) {
        self.is_open = false;
        if let Some(job) = self.job.take() {
            let ended =
                Effect::Failed { job: job.id, failure: Failure::Interrupted, status: 0, sent: 0 };
            self.demands.add_uncounted(&ended, "pulse-lathe.link.close");
        }
        self.port.clear();
        self.stale = self.port.inside() - self.port.inside_of(&[0xE0, 0xE1]);
    }
}
