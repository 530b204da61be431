//! XMODEM: what its page says, as a state machine.
//!
//! - `block`: blocks and their checks
//! - `receive`: a file comes
//! - `send`: a job goes
//! - `host`: what the host asks for
//! - `rules`: the settings
//! - `out`: our port
//! - `judge`: what the plug-in does
//! - `propose`: what a partner and a host could do

mod block;
mod host;
mod judge;
mod propose;
mod receive;
mod rules;
mod send;

use crate::block_room::BlockRoom;
use crate::dice::Dice;
use crate::expected::Expected;
use crate::model::{
    Broken, Conditions, Effect, HostRequest, LineInput, Model, Profile, Proposal, line,
};
use crate::out::Out;
use block::{ACK, C, CAN, EOT, NAK, SOH, STX};
use receive::File;
use rules::Rules;
use send::{Job, Sending, Stage};
use softplug_abi::{Failure, Micros, ModemLines, Parity};

pub(crate) const PROFILE: Profile = Profile {
    name: "xmodem",
    clauses: &[
        "xmodem.line.block",
        "xmodem.line.checksum",
        "xmodem.line.close",
        "xmodem.line.crc",
        "xmodem.line.down",
        "xmodem.line.eight-bits",
        "xmodem.line.number",
        "xmodem.line.swap",
        "xmodem.rx.abort",
        "xmodem.rx.again",
        "xmodem.rx.bad-block",
        "xmodem.rx.begin",
        "xmodem.rx.block",
        "xmodem.rx.call",
        "xmodem.rx.cancelled",
        "xmodem.rx.cut-off",
        "xmodem.rx.end",
        "xmodem.rx.end-again",
        "xmodem.rx.end-twice",
        "xmodem.rx.missing",
        "xmodem.rx.mode",
        "xmodem.rx.no-call",
        "xmodem.rx.noise",
        "xmodem.rx.padding",
        "xmodem.rx.purge",
        "xmodem.rx.repeats",
        "xmodem.rx.rest",
        "xmodem.rx.silence",
        "xmodem.rx.wrong-number",
        "xmodem.tx.abort",
        "xmodem.tx.answer-time",
        "xmodem.tx.block-is-no-call",
        "xmodem.tx.call-again",
        "xmodem.tx.cancelled",
        "xmodem.tx.end",
        "xmodem.tx.end-again",
        "xmodem.tx.falls-back",
        "xmodem.tx.long",
        "xmodem.tx.mode",
        "xmodem.tx.next",
        "xmodem.tx.on-call",
        "xmodem.tx.one-job",
        "xmodem.tx.padding",
        "xmodem.tx.pause",
        "xmodem.tx.repeat",
        "xmodem.tx.request-time",
        "xmodem.tx.settle",
        "xmodem.tx.too-early",
    ],
    values: &[
        ("mode", &["auto", "crc", "1k", "checksum"]),
        ("call", &["on", "off"]),
        ("call_time", &["3000", "100", "60000"]),
        ("block_time", &["10000", "500", "100", "600000"]),
        ("character_time", &["1000", "10", "200", "60000"]),
        ("purge_time", &["1000", "10", "200", "60000"]),
        ("answer_time", &["60000", "100", "2000", "600000"]),
        ("request_time", &["0", "3000", "100", "20000", "86400000"]),
        ("repeats", &["10", "1", "0", "2", "100"]),
        ("pad", &["26", "0", "255", "1"]),
        ("padding", &["strip", "keep"]),
        ("end_twice", &["on", "off"]),
    ],
    presets: &[("crc-only", &[("mode", "crc")])],
    lines: &[
        line(9_600, 8, Parity::None, 2),
        line(9_600, 8, Parity::None, 2),
        line(115_200, 8, Parity::None, 2),
        line(38_400, 8, Parity::Even, 3),
        line(0, 8, Parity::None, 2),
        line(300, 8, Parity::None, 2),
        line(1_200, 8, Parity::None, 4),
        line(19_200, 8, Parity::None, 2),
        line(57_600, 8, Parity::None, 2),
        line(9_600, 7, Parity::Even, 2),
    ],
    rooms: &[],
    modem_lines: &[None, Some((ModemLines(7), ModemLines(5)))],
    special: &[SOH, STX, EOT, ACK, NAK, CAN, C],
    start: |conditions| Some(Box::new(Xmodem::new(conditions))),
};

/// Where the transfer stands, in the page's words.
#[derive(Clone, Debug)]
enum State {
    /// No call before then; with `None` none at all. EOT is acknowledged again if it lingers.
    Idle {
        until: Option<Micros>,
        lingers: bool,
    },
    Calling {
        until: Micros,
    },
    Between {
        until: Micros,
    },
    Block {
        characters: Vec<u8>,
        until: Micros,
    },
    /// Until the line is clear; then CAN goes, or what was bad is asked for again.
    Purging {
        until: Micros,
        cancels: bool,
    },
    CanHeard {
        until: Micros,
    },
    EndHeard {
        until: Micros,
    },
    Sending(Sending),
}

/// Our side of XMODEM.
#[derive(Clone, Debug)]
struct Xmodem {
    rules: Rules,
    /// The time of the latest call.
    now: Micros,
    out: Out,
    room: BlockRoom,
    state: State,
    file: File,
    job: Option<Job>,
    expected: Expected,
    is_open: bool,
    is_down: bool,
    /// The host has room for deliveries, or had some since the link was opened.
    has_place: bool,
    /// A block has filled the room at this instant: what comes with it may be passed over.
    full_at: Option<Micros>,
    /// Deliveries since the link was opened.
    deliveries: u32,
    /// The id of the latest job.
    jobs: u32,
    /// Nothing is judged any more.
    is_blind: bool,
}

impl Model for Xmodem {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        self.now = at;
        match input {
            LineInput::Bytes(bytes) => {
                for byte in bytes {
                    self.character(Some(*byte));
                }
            }
            LineInput::Damaged { .. } => self.character(None),
            LineInput::ModemLines(..) => {}
            LineInput::Down(_) => self.goes_down(),
            LineInput::Up => {
                self.is_down = false;
                self.out.set_gone(false);
                self.begins_calling();
            }
        }
        // Answers beyond these are never sent (a choice of the page).
        let is_sending = matches!(self.state, State::Sending(_));
        self.is_blind |= !is_sending && self.out.waiting() > self.rules.answers;
    }

    fn left(&mut self, at: Micros, _byte: u8) {
        self.now = at;
        if !self.rules.leaves_at_once() {
            self.out.leaves();
            self.progress();
        }
    }

    fn due(&mut self, at: Micros) {
        self.now = at;
        self.room.settle();
        while let Some(deadline) = self.deadline().filter(|deadline| *deadline <= at) {
            self.runs_out(deadline);
        }
    }

    fn host(&mut self, at: Micros, request: &HostRequest) {
        self.now = at;
        self.asked_by_host(request);
    }

    fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken> {
        self.now = at;
        if self.is_blind {
            return Ok(());
        }
        match effect {
            Effect::Byte(byte) => self.sees_byte(*byte),
            _ => self.sees(effect),
        }
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        self.room.settle();
        if self.is_blind {
            return Ok(());
        }
        self.expected.missed()?;
        self.out.settled()
    }

    fn next(&self) -> Option<Micros> {
        self.deadline()
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        propose::propose(self, now, dice)
    }
}

impl Xmodem {
    fn new(conditions: &Conditions) -> Self {
        Self {
            rules: Rules::new(conditions),
            now: Micros::ZERO,
            out: Out::new(conditions.depth, "xmodem.rx.no-call"),
            room: BlockRoom::new(conditions.delivery_room),
            state: State::Idle { until: None, lingers: false },
            file: File::default(),
            job: None,
            expected: Expected::default(),
            is_open: false,
            is_down: false,
            has_place: false,
            full_at: None,
            deliveries: 0,
            jobs: 0,
            is_blind: false,
        }
    }

    /// A character; `None`: a damaged one.
    fn character(&mut self, character: Option<u8>) {
        self.is_blind |= self.full_at == Some(self.now);
        let is_waiting = matches!(self.state, State::Idle { .. }) && self.job.is_some();
        match character {
            _ if matches!(self.state, State::Sending(_)) => self.is_answered(character),
            Some(byte @ (C | NAK)) if is_waiting => self.is_called(byte),
            _ => self.hears(character),
        }
    }

    /// The port is gone.
    fn goes_down(&mut self) {
        const CLAUSE: &str = "xmodem.line.down";
        if matches!(self.state, State::Sending(_)) {
            self.fails(Failure::LinkDown, CLAUSE);
        }
        self.drops_job(Failure::LinkDown, CLAUSE);
        self.ends_file(Some(Failure::LinkDown), CLAUSE);
        self.state = State::Idle { until: None, lingers: false };
        self.out.discard();
        self.is_down = true;
        self.out.set_gone(true);
    }

    /// Whether the latest block finds room. With all that is put away at once it does.
    fn takes_room(&mut self) -> bool {
        // Padding of the block before is among it, at the most.
        let bytes: usize = self.file.blocks.iter().rev().take(2).map(Vec::len).sum();
        let is_sure = self.room.take(bytes);
        if self.room.is_over() {
            self.full_at = Some(self.now);
        }
        is_sure
    }

    /// When the next time runs out.
    fn deadline(&self) -> Option<Micros> {
        [self.state_until(), self.job.as_ref().and_then(|job| job.until)]
            .into_iter()
            .flatten()
            .min()
    }

    fn state_until(&self) -> Option<Micros> {
        match &self.state {
            State::Idle { until, .. } => *until,
            State::Calling { until }
            | State::Between { until }
            | State::Block { until, .. }
            | State::Purging { until, .. }
            | State::CanHeard { until }
            | State::EndHeard { until } => Some(*until),
            State::Sending(sending) => match sending.stage {
                Stage::Answer(until) | Stage::Settling(until) => Some(until),
                Stage::Paused | Stage::Leaving(_) => None,
            },
        }
    }

    fn runs_out(&mut self, deadline: Micros) {
        if self.state_until() == Some(deadline) {
            match &self.state {
                State::Sending(_) => self.waits_no_more(),
                _ => self.silence(),
            }
        } else {
            self.drops_job(Failure::NoAnswer, "xmodem.tx.request-time");
        }
    }
}
