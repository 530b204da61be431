//! Kermit: what its page says, as a state machine.
//!
//! - `packet`: packets and their checks
//! - `code`: bytes as printable characters
//! - `agree`: what both sides agree on
//! - `receive`: files come, and are asked for
//! - `send`: a job goes
//! - `host`: what the host asks for
//! - `rules`: the settings
//! - `out`: our port
//! - `judge`: what the plug-in does
//! - `propose`: what a partner and a host could do

mod agree;
mod code;
mod host;
mod judge;
mod packet;
mod propose;
mod receive;
mod rules;
mod send;

use crate::block_room::BlockRoom;
use crate::dice::Dice;
use crate::expected::Expected;
use crate::model::{Broken, Conditions, Effect, LineInput, Model, Profile, Proposal, line};
use crate::out::Out;
use agree::Agreed;
use packet::{CR, Heard, SOH, heard};
use receive::File;
use rules::Rules;
use send::{Job, Sending};
use softplug_abi::{Failure, Micros, ModemLines, Parity};

pub(crate) const PROFILE: Profile = Profile {
    name: "kermit",
    clauses: &[
        "kermit.ask.commands",
        "kermit.ask.exchange",
        "kermit.ask.granted",
        "kermit.ask.refused",
        "kermit.ask.request",
        "kermit.ask.withdrawn",
        "kermit.line.agree-check",
        "kermit.line.agree-eighth",
        "kermit.line.agree-length",
        "kermit.line.agree-prefix",
        "kermit.line.agree-repeat",
        "kermit.line.bad",
        "kermit.line.check-1",
        "kermit.line.check-2",
        "kermit.line.check-3",
        "kermit.line.close",
        "kermit.line.control",
        "kermit.line.crc-only",
        "kermit.line.down",
        "kermit.line.echo",
        "kermit.line.eighth",
        "kermit.line.long",
        "kermit.line.mark",
        "kermit.line.number",
        "kermit.line.offer",
        "kermit.line.packet",
        "kermit.line.padding",
        "kermit.line.repeat",
        "kermit.line.swap",
        "kermit.line.which-check",
        "kermit.rx.abort",
        "kermit.rx.again",
        "kermit.rx.attributes",
        "kermit.rx.bad",
        "kermit.rx.begin",
        "kermit.rx.complete",
        "kermit.rx.discard",
        "kermit.rx.end-again",
        "kermit.rx.error",
        "kermit.rx.file",
        "kermit.rx.idle",
        "kermit.rx.repeats",
        "kermit.rx.restart",
        "kermit.rx.silence",
        "kermit.rx.text",
        "kermit.rx.title",
        "kermit.rx.unexpected",
        "kermit.rx.wrong-number",
        "kermit.tx.abort",
        "kermit.tx.begin",
        "kermit.tx.begin-time",
        "kermit.tx.confirmed",
        "kermit.tx.error",
        "kermit.tx.fills",
        "kermit.tx.interrupted",
        "kermit.tx.name",
        "kermit.tx.narrow",
        "kermit.tx.next-nak",
        "kermit.tx.one-job",
        "kermit.tx.order",
        "kermit.tx.other-number",
        "kermit.tx.pause",
        "kermit.tx.repeat",
        "kermit.tx.text",
        "kermit.tx.too-early",
        "kermit.tx.yields",
    ],
    values: &[
        ("mode", &["binary", "text"]),
        ("check", &["3", "1", "2"]),
        ("crc_only", &["off", "off", "on"]),
        ("packet_length", &["1000", "94", "20", "95", "120", "400"]),
        ("eighth_bit", &["auto", "prefix"]),
        ("repeat_prefix", &["on", "off"]),
        ("answer_time", &["10000", "100", "2000", "600000"]),
        ("packet_time", &["15000", "100", "500", "600000"]),
        ("character_time", &["1000", "10", "200", "60000"]),
        ("begin_time", &["0", "3000", "100", "20000"]),
        ("job_time", &["5000", "100", "600000"]),
        ("repeats", &["10", "1", "0", "2", "100"]),
    ],
    presets: &[("crc-only", &[("crc_only", "on")]), ("text", &[("mode", "text")])],
    lines: &[
        line(9_600, 8, Parity::None, 2),
        line(9_600, 8, Parity::None, 2),
        line(115_200, 8, Parity::None, 2),
        line(38_400, 8, Parity::Even, 3),
        line(0, 8, Parity::None, 2),
        line(300, 8, Parity::None, 2),
        line(1_200, 7, Parity::Even, 4),
        line(19_200, 8, Parity::None, 2),
        line(57_600, 8, Parity::None, 2),
        line(9_600, 7, Parity::Even, 2),
    ],
    rooms: &[],
    modem_lines: &[None, Some((ModemLines(7), ModemLines(5)))],
    special: &[SOH, CR, b' ', b'#', b'&', b'~', b'Y', b'N', b'S', b'D', b'Z', b'B', b'E'],
    start: |conditions| Some(Box::new(Kermit::new(conditions))),
};

/// Where the transfer stands, in the page's words.
#[derive(Clone, Debug)]
enum State {
    Idle,
    /// A name, or the end of the transfer, is to come.
    AwaitFile,
    /// Data, or the end of the file, is to come.
    AwaitData,
    Sending(Sending),
}

/// The packet that comes.
#[derive(Clone, Debug)]
struct Hearing {
    /// What has come behind SOH.
    characters: Vec<u8>,
    /// It can be no packet any more.
    is_bad: bool,
}

/// Our side of Kermit.
#[derive(Clone, Debug)]
struct Kermit {
    rules: Rules,
    /// The time of the latest call.
    now: Micros,
    out: Out,
    room: BlockRoom,
    state: State,
    agreed: Agreed,
    hearing: Option<Hearing>,
    /// When silence has lasted too long.
    until: Option<Micros>,
    file: Option<File>,
    /// The number of the next packet, and the type of the one before it.
    expected_number: u8,
    latest: u8,
    refusals: u32,
    /// The end of the last transfer, and what was agreed on for it.
    ended: Option<(u8, Agreed)>,
    job: Option<Job>,
    /// The request that the host has not answered, and the one before.
    request: Option<u32>,
    requests: u32,
    /// What the latest request was for.
    asked_for: String,
    /// Until when a program that was granted must come.
    granted: Option<Micros>,
    expected: Expected,
    is_open: bool,
    is_down: bool,
    /// A packet has filled the room at this instant: what comes with it may be passed over.
    full_at: Option<Micros>,
    /// A byte of the job cannot be sent, at this instant. Whether that is known before or behind a
    /// packet that comes with the ACK is the host's matter, which gives the data.
    narrow_at: Option<Micros>,
    /// Deliveries since the link was opened.
    deliveries: u32,
    /// The id of the latest job.
    jobs: u32,
    /// Nothing is judged any more.
    is_blind: bool,
}

impl Model for Kermit {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        self.now = at;
        match input {
            LineInput::Bytes(bytes) => {
                for byte in bytes {
                    self.is_blind |= self.full_at == Some(at);
                    self.is_blind |= *byte == SOH && self.narrow_at == Some(at);
                    self.character(*byte);
                }
            }
            LineInput::Damaged { .. } => {
                if let Some(hearing) = &mut self.hearing {
                    hearing.is_bad = true;
                    self.waits_inside();
                }
            }
            LineInput::ModemLines(..) => {}
            LineInput::Down(_) => self.goes_down(),
            LineInput::Up => {
                self.is_down = false;
                self.out.set_gone(false);
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

    fn host(&mut self, at: Micros, request: &crate::model::HostRequest) {
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

impl Kermit {
    fn new(conditions: &Conditions) -> Self {
        Self {
            rules: Rules::new(conditions),
            now: Micros::ZERO,
            out: Out::new(conditions.depth, "kermit.rx.idle"),
            room: BlockRoom::new(conditions.delivery_room),
            state: State::Idle,
            agreed: Agreed::nothing(),
            hearing: None,
            until: None,
            file: None,
            expected_number: 0,
            latest: 0,
            refusals: 0,
            ended: None,
            job: None,
            request: None,
            requests: 0,
            asked_for: String::new(),
            granted: None,
            expected: Expected::default(),
            is_open: false,
            is_down: false,
            full_at: None,
            narrow_at: None,
            deliveries: 0,
            jobs: 0,
            is_blind: false,
        }
    }

    fn character(&mut self, byte: u8) {
        let Some(hearing) = self.hearing.as_mut().filter(|_| byte != SOH) else {
            if byte == SOH {
                self.hearing = Some(Hearing { characters: Vec::new(), is_bad: false });
                self.waits_inside();
            }
            return;
        };
        if byte == CR {
            self.hearing = None;
            return self.is_bad();
        }
        hearing.characters.push(byte);
        if !hearing.is_bad {
            let characters = hearing.characters.clone();
            match heard(&characters, |kind| self.check_of(kind)) {
                Heard::Part => {}
                Heard::Bad => self.hearing = Some(Hearing { characters, is_bad: true }),
                Heard::Good(packet) => {
                    self.hearing = None;
                    match &self.state {
                        State::Sending(_) => self.is_answered(&packet),
                        _ => self.hears(&packet),
                    }
                    return;
                }
            }
        }
        self.waits_inside();
    }

    /// The check that a packet of this type has.
    fn check_of(&self, kind: u8) -> usize {
        match (kind, &self.ended) {
            (b'S' | b'I' | b'R' | b'G' | b'C' | b'K', _) => 1,
            (b'B', Some((_, agreed))) => agreed.check,
            _ => self.agreed.check,
        }
    }

    /// What has ended is no good packet.
    fn is_bad(&mut self) {
        match &self.state {
            State::AwaitFile | State::AwaitData => self.refuses(Failure::Checksum, "kermit.rx.bad"),
            State::Sending(sending) if sending.is_answerable(&self.out) => {
                self.goes_again(Failure::AttemptsUsedUp);
            }
            State::Sending(_) | State::Idle => {}
        }
    }

    /// Silence has lasted too long.
    fn silence(&mut self) {
        self.until = None;
        if self.hearing.take().is_some() {
            return self.is_bad();
        }
        match &self.state {
            State::AwaitFile | State::AwaitData => {
                self.refuses(Failure::NoAnswer, "kermit.rx.silence");
            }
            State::Sending(_) => self.goes_again(Failure::NoAnswer),
            State::Idle => {}
        }
    }

    /// Silence counts from here.
    fn waits(&mut self) {
        self.until = match &self.state {
            State::AwaitFile | State::AwaitData => Some(self.now + self.rules.packet_time),
            State::Sending(sending) if sending.is_answerable(&self.out) => {
                Some(self.now + self.rules.answer_time)
            }
            State::Sending(_) | State::Idle => None,
        };
    }

    /// And from here inside a packet.
    fn waits_inside(&mut self) {
        let is_timed = match &self.state {
            State::AwaitFile | State::AwaitData => true,
            State::Sending(sending) => sending.is_answerable(&self.out),
            State::Idle => false,
        };
        if is_timed {
            self.until = Some(self.now + self.rules.character_time);
        }
    }

    /// A packet of ours.
    fn says(&mut self, kind: u8, number: u8, data: &[u8], clause: &'static str) {
        let agreed = self.agreed.clone();
        self.says_as(&agreed, kind, number, data, clause);
    }

    fn says_as(
        &mut self,
        agreed: &Agreed,
        kind: u8,
        number: u8,
        data: &[u8],
        clause: &'static str,
    ) {
        let room = agreed.short.min(self.rules.packet_length) - 2 - agreed.check;
        let text = if kind == b'E' { &data[..data.len().min(room)] } else { data };
        let packet = packet::packet(kind, number, text, agreed.check, 94);
        self.out.send(&[&agreed.padding[..], &packet, &[agreed.end]].concat(), clause);
    }

    /// E where check 1 holds in any case.
    fn says_plainly(&mut self, number: u8, text: &str, clause: &'static str) {
        let agreed = Agreed { check: 1, ..self.agreed.clone() };
        self.says_as(&agreed, b'E', number, text.as_bytes(), clause);
    }

    /// The port is gone.
    fn goes_down(&mut self) {
        const CLAUSE: &str = "kermit.line.down";
        self.hearing = None;
        self.withdraws(CLAUSE);
        if matches!(self.state, State::Sending(_)) {
            self.fails(Failure::LinkDown, CLAUSE);
        }
        self.drops_job(Failure::LinkDown, CLAUSE);
        self.ends_transfer(Some(Failure::LinkDown), CLAUSE);
        self.granted = None;
        self.out.discard();
        self.is_down = true;
        self.out.set_gone(true);
    }

    /// When the next time runs out.
    fn deadline(&self) -> Option<Micros> {
        let begin = self.job.as_ref().and_then(|job| job.until);
        [self.until, begin, self.granted].into_iter().flatten().min()
    }

    fn runs_out(&mut self, deadline: Micros) {
        if self.until == Some(deadline) {
            self.silence();
        } else if self.granted == Some(deadline) {
            self.granted = None;
            self.says_plainly(0, "The file did not come", "kermit.ask.granted");
        } else {
            self.fails(Failure::NoAnswer, "kermit.tx.begin-time");
        }
    }
}
