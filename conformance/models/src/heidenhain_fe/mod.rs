//! Heidenhain blockwise transfer: what its page says, as a state machine.
//!
//! - `line`, `frame`: what comes from the line; headers and blocks
//! - `receive`: the control sends
//! - `send`, `program`: the control asks; a program's lines
//! - `host`: what the host asks for
//! - `times`: times that run out
//! - `rules`: the settings
//! - `out`, `room`: our port, and the host's room for what is delivered
//! - `judge`: what the plug-in does
//! - `propose`, `text`: what a control and a host could do

mod frame;
mod host;
mod judge;
mod line;
mod program;
mod propose;
mod receive;
mod room;
mod rules;
mod send;
mod text;
mod times;

use crate::dice::Dice;
use crate::expected::Expected;
use crate::model::{
    Broken, Conditions, Effect, HostRequest, LineInput, Model, Profile, Proposal, line,
};
use crate::out::Out;
use frame::{ACK, DC1, DC3, EOT, ETB, ETX, Frame, NAK, SOH, STX};
use receive::Reception;
use room::Room;
use rules::{Rules, even};
use send::{Job, Sending};
use softplug_abi::{Micros, ModemLines, Parity};
use std::cell::Cell;

/// The most bytes that the name of a delivery has.
const LONGEST_NAME: usize = softplug_abi::limits::DELIVERY_NAME_BYTES;

pub(crate) const PROFILE: Profile = Profile {
    name: "heidenhain-fe",
    clauses: &[
        "heidenhain-fe.line.begin-anew",
        "heidenhain-fe.line.bcc-space",
        "heidenhain-fe.line.check",
        "heidenhain-fe.line.close",
        "heidenhain-fe.line.cut-off",
        "heidenhain-fe.line.damaged",
        "heidenhain-fe.line.dc1",
        "heidenhain-fe.line.down",
        "heidenhain-fe.line.hold",
        "heidenhain-fe.line.noise",
        "heidenhain-fe.line.parity",
        "heidenhain-fe.line.swap",
        "heidenhain-fe.rx.abort",
        "heidenhain-fe.rx.bad-block",
        "heidenhain-fe.rx.bad-header",
        "heidenhain-fe.rx.block",
        "heidenhain-fe.rx.end",
        "heidenhain-fe.rx.header",
        "heidenhain-fe.rx.new-header",
        "heidenhain-fe.rx.no-end",
        "heidenhain-fe.rx.no-room",
        "heidenhain-fe.rx.room",
        "heidenhain-fe.rx.several",
        "heidenhain-fe.rx.silence",
        "heidenhain-fe.rx.stray-block",
        "heidenhain-fe.tx.abort",
        "heidenhain-fe.tx.answer-time",
        "heidenhain-fe.tx.ask-host",
        "heidenhain-fe.tx.block",
        "heidenhain-fe.tx.check",
        "heidenhain-fe.tx.end",
        "heidenhain-fe.tx.granted",
        "heidenhain-fe.tx.header-between",
        "heidenhain-fe.tx.name",
        "heidenhain-fe.tx.next",
        "heidenhain-fe.tx.on-request",
        "heidenhain-fe.tx.one-job",
        "heidenhain-fe.tx.partner-ends",
        "heidenhain-fe.tx.pause",
        "heidenhain-fe.tx.refused",
        "heidenhain-fe.tx.repeat",
        "heidenhain-fe.tx.request-time",
        "heidenhain-fe.tx.too-early",
        "heidenhain-fe.tx.withdrawn",
    ],
    values: &[
        ("parity", &["port", "even", "port"]),
        ("repeats", &["3", "1", "0", "2", "15"]),
        ("answer_time", &["10000", "100", "2000", "600000"]),
        ("character_time", &["1000", "10", "200", "60000"]),
        ("block_time", &["30000", "2000", "0", "300", "600000"]),
        ("request_time", &["0", "3000", "100", "20000", "86400000"]),
        ("job_time", &["5000", "100", "1000", "600000"]),
        ("dc1", &["on", "off"]),
        ("bcc_space", &["off", "on"]),
        ("line_end", &["lf", "crlf"]),
    ],
    presets: &[],
    lines: &[
        line(9_600, 8, Parity::None, 4),
        line(9_600, 7, Parity::Even, 4),
        line(9_600, 7, Parity::Even, 4),
        line(4_800, 7, Parity::Even, 4),
        line(115_200, 8, Parity::None, 2),
        line(38_400, 8, Parity::Even, 3),
        line(0, 8, Parity::None, 2),
        line(300, 7, Parity::Even, 4),
        line(600, 7, Parity::Even, 4),
        line(1_200, 7, Parity::Even, 4),
        line(2_400, 7, Parity::Even, 4),
        line(19_200, 7, Parity::Even, 4),
        line(57_600, 7, Parity::Even, 4),
    ],
    rooms: &[],
    modem_lines: &[None, Some((ModemLines(7), ModemLines(5)))],
    special: &[SOH, STX, ETX, EOT, ACK, NAK, DC1, DC3, ETB],
    start: |conditions| Some(Box::new(Fe::new(conditions)?)),
};

/// Where the transfer stands, in the page's words.
#[derive(Clone, Debug)]
enum State {
    Idle,
    /// Receiving, or waiting for room.
    Receiving(Reception),
    /// The host was asked by this request.
    Asking {
        request: u32,
        name: Vec<u8>,
    },
    /// The host granted it; its job has to come.
    Granted {
        name: Vec<u8>,
        until: Micros,
    },
    /// Sending, or ending.
    Sending(Sending),
}

/// The host's side of the blockwise transfer.
#[derive(Clone, Debug)]
struct Fe {
    rules: Rules,
    /// The time of the latest call.
    now: Micros,
    out: Out,
    room: Room,
    frame: Option<Frame>,
    state: State,
    /// It waits, or is being sent.
    job: Option<Job>,
    expected: Expected,
    is_open: bool,
    is_down: bool,
    is_held: bool,
    /// The link was opened without any room, and there was none since.
    has_no_place: bool,
    /// Deliveries since the link was opened.
    deliveries: u32,
    /// Requests since the link was opened.
    requests: u32,
    /// The id of the latest job.
    jobs: u32,
    /// Nothing is judged any more.
    is_blind: bool,
    /// What the control and the host have in mind.
    plan: Cell<propose::Plan>,
}

impl Model for Fe {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        self.now = at;
        match input {
            LineInput::Bytes(bytes) => {
                for byte in bytes {
                    self.character(self.read(*byte));
                }
            }
            LineInput::Damaged { .. } => self.character(None),
            LineInput::ModemLines(..) => {}
            LineInput::Down(_) => self.goes_down(),
            LineInput::Up => {
                self.is_down = false;
                self.out.set_gone(false);
            }
        }
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
        while let Some(deadline) = self.deadline().filter(|deadline| *deadline <= at) {
            self.runs_out(deadline);
        }
        self.room.tell();
        self.has_more_room();
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
        if let Effect::Byte(byte) = effect {
            return self.sees_byte(*byte);
        }
        self.sees(effect)
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        self.room.tell();
        let is_seen_late = self.is_held || !self.out.is_empty();
        self.is_blind |= is_seen_late && self.may_have_taken_room();
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

    fn is_filled(&self) -> bool {
        !matches!(self.plan.get(), propose::Plan::Usual | propose::Plan::Holds)
    }
}

impl Fe {
    fn new(conditions: &Conditions) -> Option<Self> {
        let rules = Rules::new(conditions)?;
        Some(Self {
            out: Out::new(conditions.depth, "heidenhain-fe.line.noise")
                .made_by(if rules.makes_parity { even } else { |byte| byte }),
            rules,
            now: Micros::ZERO,
            room: Room::new(conditions.delivery_room),
            frame: None,
            state: State::Idle,
            job: None,
            expected: Expected::default(),
            is_open: false,
            is_down: false,
            is_held: false,
            has_no_place: false,
            deliveries: 0,
            requests: 0,
            jobs: 0,
            is_blind: false,
            plan: Cell::new(propose::Plan::new(conditions)),
        })
    }
}
