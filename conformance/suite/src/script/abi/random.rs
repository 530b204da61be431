//! Legal input for any plug-in, from a seed and its manifest.

use super::super::failure::{Outcome, not_applicable};
use crate::given::timeline::{Asked, Given, Input, Timeline};
use crate::run::replay::Conditions;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::manifest::{Kind, Manifest, ValueType};
use softplug_abi::{
    Failure, JobId, LineErrorKind, LineParameters, LinkDownReason, Micros, ModemLines,
};
use softplug_link::{Job, LinkOptions};

/// What is drawn.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Shape {
    /// Bytes, whole and damaged, and breaks.
    Line,
    /// Jobs of every kind, paused, resumed and aborted.
    Jobs,
    /// Rooms of a few bytes, and a host that takes nothing for a while.
    Rooms,
    /// The port goes and comes back, modem lines change.
    Ports,
    /// Days between the inputs.
    Days,
    /// All of it, on a link that stays open.
    Everything,
    /// All of it but what a link keeps over its closing.
    Session,
}

impl Shape {
    pub(super) const ALL: [Self; 6] =
        [Self::Line, Self::Jobs, Self::Rooms, Self::Ports, Self::Days, Self::Everything];

    pub(super) fn slug(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Jobs => "jobs",
            Self::Rooms => "rooms",
            Self::Ports => "ports",
            Self::Days => "days",
            Self::Everything => "everything",
            Self::Session => "session",
        }
    }

    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Line => "Any bytes, damaged ones and breaks",
            Self::Jobs => "Jobs of every kind, paused and aborted",
            Self::Rooms => "Rooms of a few bytes and a host that takes nothing",
            Self::Ports => "A port that goes and comes back",
            Self::Days => "Days between the inputs",
            Self::Everything | Self::Session => "All kinds of input",
        }
    }

    pub(super) fn clauses(self) -> &'static [&'static str] {
        match self {
            Self::Line => &["abi.events.any-order", "abi.timers.step-limit", "abi.output.rounds"],
            Self::Jobs => &["abi.events.any-order", "abi.ids.one-each", "abi.check.sequence"],
            Self::Rooms => &["abi.credit.exceeded", "abi.credit.outstanding"],
            Self::Ports => &["abi.events.any-order"],
            Self::Days => &["abi.clock.far", "abi.timers.step-limit"],
            Self::Everything | Self::Session => &["abi.events.any-order", "abi.budget.fuel"],
        }
    }

    fn draws(self, topic: Topic) -> bool {
        match self {
            Self::Line => topic == Topic::Line,
            Self::Jobs => topic == Topic::Line || topic == Topic::Host,
            Self::Rooms => topic != Topic::Port,
            Self::Ports | Self::Days | Self::Everything => true,
            // Modem lines and rooms would not be at the second time what they were.
            Self::Session => topic != Topic::Port && topic != Topic::Room,
        }
    }
}

/// What an input belongs to.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Topic {
    Line,
    Port,
    Host,
    Room,
}

/// Inputs of one run.
const INPUTS: u32 = 60;

/// Bytes that mean something in one protocol or another.
const TELLING: &[u8] =
    b"\x02\x03\x04\x05\x06\x10\x11\x12\x13\x14\x15\x16\x18\x1A%\n\r\0\x7F\x91\x93\xFFO:N0";

/// What one run needs: settings, rooms, a line, and what comes over it.
pub(super) fn conditions(manifest: &Manifest, shape: Shape, seed: u64) -> Outcome<Conditions> {
    let mut draw = Draw::new(seed ^ ((shape as u64) << 32));
    // The defaults first, then one preset after the other.
    let preset = manifest.presets.get((seed as usize).wrapping_sub(2));
    let asked = preset.map(|preset| ("preset", preset.name.as_str()));
    let settings = manifest.resolve_settings(asked).map_err(|error| not_applicable(&error))?;
    let is_tight = shape == Shape::Rooms;
    let mut room = || if is_tight { 1 + draw.below(200) } else { 4_096 };
    let (transmit_room, delivery_room) = (room(), room());
    let known = ModemLines::CTS.union(ModemLines::DSR).union(ModemLines::DCD);
    let modem_lines = matches!(shape, Shape::Ports | Shape::Everything)
        .then(|| (known.union(ModemLines::OUTPUTS), known));
    let line = LineParameters::new([9_600, 0, 300, 115_200][draw.below(4) as usize]);
    let options = LinkOptions { line, transmit_room, delivery_room, modem_lines, settings };
    let timeline = draw.timeline(manifest, shape);
    let depth = 1 + draw.below(16) as usize;
    Ok(Conditions { timeline, options, depth })
}

/// The chance of one run.
struct Draw {
    random: ChaCha8Rng,
    jobs: u32,
    is_down: bool,
}

impl Draw {
    fn new(seed: u64) -> Self {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        Self { random: ChaCha8Rng::from_seed(bytes), jobs: 0, is_down: false }
    }

    fn below(&mut self, limit: u32) -> u32 {
        self.random.next_u32() % limit
    }

    fn timeline(&mut self, manifest: &Manifest, shape: Shape) -> Timeline {
        let mut given = Vec::new();
        let mut at = Micros::ZERO;
        for _ in 0..INPUTS {
            at = at + self.gap(shape);
            let topic = [Topic::Line, Topic::Line, Topic::Host, Topic::Room, Topic::Port];
            let topic = topic[self.below(5) as usize];
            let topic = if shape.draws(topic) { topic } else { Topic::Line };
            let what = match topic {
                Topic::Line => self.line(),
                Topic::Host => self.host(manifest),
                Topic::Room => Some(self.room()),
                Topic::Port => Some(self.port()),
            };
            given.extend(what.map(|what| Given { at, what }));
        }
        // At the end the port is there and the host takes everything.
        let end = at + Micros::from_secs(100);
        if self.is_down {
            given.push(Given { at: end, what: Input::Up });
        }
        let drain = Input::Host(Asked::Drain(softplug_trace::Drain::Auto));
        given.push(Given { at: end, what: drain });
        Timeline { given, end: end + Micros::from_secs(100) }
    }

    fn gap(&mut self, shape: Shape) -> Micros {
        let micros = match self.below(8) {
            0..=2 => 0,
            3..=4 => self.below(2_000).into(),
            5 => self.below(300_000).into(),
            6 => self.below(5_000_000).into(),
            _ if shape == Shape::Days => i64::from(self.below(30)) * 86_400_000_000,
            _ => self.below(30_000_000).into(),
        };
        Micros(micros)
    }

    fn line(&mut self) -> Option<Input> {
        if self.is_down {
            return None;
        }
        Some(match self.below(8) {
            0 => {
                let byte = Some(self.byte());
                let kind =
                    [LineErrorKind::Parity, LineErrorKind::Framing, LineErrorKind::ParityOrFraming];
                Input::Damaged { kind: kind[self.below(3) as usize], byte, span: self.below(3) }
            }
            1 => {
                let kind = [LineErrorKind::Break, LineErrorKind::Overrun][self.below(2) as usize];
                Input::Damaged { kind, byte: None, span: 0 }
            }
            _ => {
                let longest = [1, 4, 40, 300][self.below(4) as usize];
                let count = 1 + self.below(longest);
                Input::Bytes((0..count).map(|_| self.byte()).collect())
            }
        })
    }

    fn byte(&mut self) -> u8 {
        match self.below(3) {
            0 => TELLING[self.below(TELLING.len() as u32) as usize],
            1 => 0x20 + self.below(95) as u8,
            _ => self.below(256) as u8,
        }
    }

    fn host(&mut self, manifest: &Manifest) -> Option<Input> {
        let job = 1 + self.below(self.jobs.max(1));
        Some(Input::Host(match self.below(10) {
            0..=3 => self.job(manifest)?,
            4 => Asked::Pause(job),
            5 => Asked::Resume(job),
            6 => Asked::Abort(if self.below(3) == 0 { 0 } else { job }),
            7 => Asked::ForceResume,
            _ => {
                let length = self.below(300);
                let answer = match self.below(3) {
                    0 => Err(Failure::NotFound),
                    _ => Ok((0..length).map(|_| self.byte()).collect()),
                };
                Asked::Answer(1 + self.below(4), answer)
            }
        }))
    }

    fn job(&mut self, manifest: &Manifest) -> Option<Asked> {
        let kinds = manifest.jobs.len() as u32;
        let kind = if kinds == 0 { return None } else { self.below(kinds) as usize };
        let fields = self.fields(&manifest.jobs[kind]);
        self.jobs += 1;
        let length = [0, 1, 30, 400][self.below(4) as usize];
        let data: Vec<u8> = (0..length).map(|_| self.byte()).collect();
        let size = (self.below(2) == 0).then_some(data.len() as u64);
        let check = manifest.needs.check_pass;
        let job = Job { id: JobId(self.jobs), kind: kind as u16, size, fields, check };
        Some(Asked::Job(job, data))
    }

    /// The required fields, and some of the others; what does not fit is left out.
    fn fields(&mut self, kind: &Kind) -> Vec<u8> {
        let mut given = Vec::new();
        for field in &kind.fields {
            if !field.required && self.below(3) > 0 {
                continue;
            }
            let number = self.below(300).to_string();
            given.push((
                field.name.as_str(),
                match field.kind {
                    ValueType::Bool => "on".to_owned(),
                    ValueType::Int | ValueType::Choice => number,
                    ValueType::Text => ["DB", "M", "O1234", ""][self.below(4) as usize].to_owned(),
                    ValueType::Bytes => "00FF10".to_owned(),
                },
            ));
        }
        let given = given.iter().map(|(name, text)| (*name, text.as_str()));
        kind.records(given).unwrap_or_default()
    }

    fn room(&mut self) -> Input {
        let drain = match self.below(4) {
            0 => Asked::Drain(softplug_trace::Drain::Off),
            1 => Asked::Drain(softplug_trace::Drain::Auto),
            _ => Asked::Room(1 + self.below(100)),
        };
        Input::Host(drain)
    }

    fn port(&mut self) -> Input {
        if self.is_down {
            self.is_down = false;
            return Input::Up;
        }
        if self.below(4) > 0 {
            let line = [ModemLines::CTS, ModemLines::DSR, ModemLines::DCD][self.below(3) as usize];
            let on = if self.below(2) == 0 { line } else { ModemLines::default() };
            return Input::Modem(line, on);
        }
        self.is_down = true;
        Input::Down(LinkDownReason::Unplugged)
    }
}
