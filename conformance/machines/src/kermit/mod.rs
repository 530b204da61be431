//! A simulated machine that speaks Kermit: it takes the files that are sent to it, or sends one,
//! or asks for one.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::kermit::{Machine, Options};
//!
//! let file = Some(("O1.NC".to_owned(), b"M30".to_vec()));
//! let mut machine = Machine::new(Options { file, ..Options::default() });
//! // It begins at once; SOH has left a character later.
//! machine.advance(Micros::ZERO);
//! assert_eq!(machine.poll_transmit(Micros(1_042)), Some(0x01));
//! ```

use std::collections::VecDeque;

use softplug_abi::{LineParameters, Micros};

use crate::Partner;

mod frame;

use frame::{Frame, Parameters, decoded, encoded, framed};

const SOH: u8 = 0x01;
const CR: u8 = 0x0D;

/// How long it waits for a packet, or for the answer to one.
const PATIENCE: Micros = Micros::from_secs(7);
/// The longest packet that there is.
const PACKET: usize = 9_100;
/// How often it tries.
const TRIES: u32 = 10;

/// What the machine is set to.
///
/// ```
/// use softplug_machines::kermit::Options;
///
/// let options = Options { check: 1, ..Options::default() };
/// assert!(options.file.is_none());
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// Its line.
    pub line: LineParameters,
    /// Its best check: 1, 2 or 3.
    pub check: usize,
    /// The prefix for bytes above 127 that it asks for.
    pub eighth: Option<u8>,
    /// The prefix for runs that it offers.
    pub repeat: Option<u8>,
    /// The longest packet that it takes, if it takes long ones.
    pub long: Option<usize>,
    /// The file that it sends, with its name; without one it takes files.
    pub file: Option<(String, Vec<u8>)>,
    /// The file that it asks for, before it takes it.
    pub wanted: Option<String>,
    /// When it begins with what it sends or asks.
    pub begins: Micros,
    /// Packets, counted from 1 as they come or go, that have a bit wrong.
    pub damaged: Vec<u32>,
    /// Answers of its own, counted from 1, that never leave.
    pub lost: Vec<u32>,
    /// It wants no more of a file behind so many packets of data.
    pub interrupts: Option<u32>,
    /// Behind a transfer it begins anew after so long; without, it does not.
    pub rest: Option<Micros>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            line: LineParameters::new(9_600),
            check: 3,
            eighth: None,
            repeat: Some(b'~'),
            long: None,
            file: None,
            wanted: None,
            begins: Micros::ZERO,
            damaged: Vec::new(),
            lost: Vec::new(),
            interrupts: None,
            rest: None,
        }
    }
}

impl Options {
    fn begins_by_itself(&self) -> bool {
        self.file.is_some() || self.wanted.is_some()
    }
}

/// What it has seen.
///
/// ```
/// use softplug_machines::kermit::{Machine, Options};
///
/// assert!(!Machine::new(Options::default()).report().is_over);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// The name of the file that came, and the file.
    pub name: String,
    /// The file that came.
    pub came: Vec<u8>,
    /// The sender has ended the file, and not wanted it to be discarded.
    pub is_kept: bool,
    /// The transfer has ended well.
    pub is_done: bool,
    /// It has ended, well or not.
    pub is_over: bool,
    /// The text of an error of the other side.
    pub error: String,
    /// Packets that came or went, repeated ones included.
    pub packets: u32,
    /// Transfers that have ended well.
    pub done: u32,
    /// Transfers that have not.
    pub failed: u32,
}

/// The machine.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::kermit::{Machine, Options};
///
/// let mut machine = Machine::new(Options::default());
/// assert_eq!(machine.next_event(), None, "it waits for a sender");
/// for byte in b"\x01+ S~% @-#N1Q\r" {
///     machine.receive(Micros(500), *byte);
/// }
/// assert_eq!(machine.poll_transmit(Micros(1_542)), Some(0x01));
/// ```
#[derive(Clone, Debug)]
pub struct Machine {
    options: Options,
    /// What the other side and it have agreed on.
    agreed: Parameters,
    heard: Option<Vec<u8>>,
    until: Option<Micros>,
    /// The number of the packet that goes, or is to come.
    number: u8,
    /// What it has sent, to be sent again.
    latest: Vec<u8>,
    kind: u8,
    tries: u32,
    answers: u32,
    data: u32,
    /// Bytes of the file that have been acknowledged, and of the packet that has gone.
    done: usize,
    length: usize,
    leaving: VecDeque<(Micros, u8)>,
    /// When the next transfer may begin.
    anew: Option<Micros>,
    report: Report,
}

impl Machine {
    /// A machine with these settings.
    pub fn new(options: Options) -> Self {
        Self {
            until: options.begins_by_itself().then_some(options.begins),
            agreed: Parameters::default(),
            heard: None,
            number: 0,
            latest: Vec::new(),
            kind: 0,
            tries: 0,
            answers: 0,
            data: 0,
            done: 0,
            length: 0,
            leaving: VecDeque::new(),
            anew: None,
            report: Report::default(),
            options,
        }
    }

    /// What it has seen so far.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Whether a transfer has begun and not ended.
    ///
    /// ```
    /// use softplug_machines::kermit::{Machine, Options};
    ///
    /// assert!(!Machine::new(Options::default()).is_under_way());
    /// ```
    pub fn is_under_way(&self) -> bool {
        // One that begins by itself has not, before it was answered.
        let is_heard = self.number > 0 || !self.options.begins_by_itself();
        self.kind != 0 && is_heard && !self.report.is_over
    }

    /// A character has come: its last bit ended at `now`.
    pub fn receive(&mut self, now: Micros, byte: u8) {
        match (&mut self.heard, byte) {
            (_, SOH) => self.heard = Some(Vec::new()),
            (Some(heard), CR) => {
                let heard = std::mem::take(heard);
                self.heard = None;
                self.hears(now, &heard);
            }
            (Some(heard), _) if heard.len() < PACKET => heard.push(byte),
            (Some(_), _) => self.heard = None,
            (None, _) => {}
        }
    }

    /// When it wants to be called next.
    pub fn next_event(&self) -> Option<Micros> {
        let leaves = self.leaving.front().map(|(at, _)| *at);
        [leaves, self.until, self.anew].into_iter().flatten().min()
    }

    /// Does what is due.
    pub fn advance(&mut self, now: Micros) {
        if self.anew.is_some_and(|anew| anew <= now) {
            self.begins_anew();
            self.until = self.options.begins_by_itself().then_some(now);
        }
        if self.until.is_none_or(|until| until > now) {
            return;
        }
        self.until = None;
        if self.latest.is_empty() && self.kind == 0 {
            return self.begins(now);
        }
        self.tries += 1;
        if self.tries > TRIES {
            self.goes_alone(now, b'E', b"Nobody answers");
            self.ends(now, false);
        } else if self.is_sender() {
            self.goes_again(now);
        } else {
            self.answers(now, b'N', self.number, b"");
        }
    }

    /// A character that has left by `now`.
    pub fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.leaving.pop_front_if(|(at, _)| *at <= now).map(|(_, byte)| byte)
    }

    fn is_sender(&self) -> bool {
        self.options.file.is_some() || self.kind == b'R'
    }

    fn begins(&mut self, now: Micros) {
        if let Some(name) = self.options.wanted.clone() {
            self.goes(now, b'R', name.as_bytes());
        } else {
            let own = Parameters::of(&self.options).fields();
            self.goes(now, b'S', &own);
        }
    }

    /// CR has ended something that began with SOH.
    fn hears(&mut self, now: Micros, heard: &[u8]) {
        self.report.packets += 1;
        let mut heard = heard.to_vec();
        if self.options.damaged.contains(&self.report.packets)
            && let Some(last) = heard.last_mut()
        {
            *last ^= 1;
        }
        let frame = Frame::read(&heard, self.agreed.check);
        if self.anew.is_some() && frame.as_ref().is_some_and(|frame| frame.kind == b'S') {
            self.begins_anew();
        }
        if self.report.is_over {
            // Only the end of a transfer is acknowledged again.
            if let Some(frame) = frame.filter(|frame| frame.kind == b'B' && self.report.is_done) {
                self.answers(now, b'Y', frame.number, b"");
                self.until = None;
            }
            return;
        }
        match frame {
            None if self.is_sender() => self.goes_again(now),
            None if self.kind == 0 => {}
            None => self.answers(now, b'N', self.number, b""),
            Some(frame) if frame.kind == b'E' => {
                self.report.error = String::from_utf8_lossy(&frame.data).into_owned();
                self.ends(now, false);
            }
            Some(frame) if self.options.file.is_some() => self.is_answered(now, &frame),
            Some(frame) => self.takes(now, &frame),
        }
    }

    /// A packet of a sender.
    fn takes(&mut self, now: Micros, frame: &Frame) {
        let own = Parameters::of(&self.options);
        match frame.kind {
            b'S' => {
                let (agreed, answer) = own.answer(&frame.data);
                self.agreed.check = 1;
                self.kind = b'S';
                self.answers(now, b'Y', 0, &answer);
                self.agreed = agreed;
                self.number = 1;
            }
            b'Y' | b'N' => {}
            _ if frame.number != self.number && self.kind != 0 => {
                self.answers(now, b'Y', frame.number, b"");
            }
            b'F' | b'D' | b'Z' | b'B' | b'A' if self.kind != 0 => self.takes_next(now, frame),
            _ => self.goes_alone(now, b'E', b"What is this?"),
        }
    }

    fn takes_next(&mut self, now: Micros, frame: &Frame) {
        let mut answer: &[u8] = b"";
        match frame.kind {
            b'F' => {
                self.report.name =
                    String::from_utf8_lossy(&decoded(&frame.data, &self.agreed)).into();
                self.report.came.clear();
            }
            b'D' => {
                self.data += 1;
                self.report.came.extend(decoded(&frame.data, &self.agreed));
                if self.options.interrupts.is_some_and(|most| self.data >= most) {
                    answer = b"X";
                }
            }
            b'Z' => self.report.is_kept = frame.data != b"D",
            _ => {}
        }
        self.tries = 0;
        self.answers(now, b'Y', frame.number, answer);
        self.number = (self.number + 1) % 64;
        if frame.kind == b'B' {
            self.ends(now, true);
        }
    }

    /// A packet of a receiver.
    fn is_answered(&mut self, now: Micros, frame: &Frame) {
        match frame.kind {
            b'Y' if frame.number == self.number => self.goes_on(now, &frame.data),
            b'N' if frame.number == self.number => self.goes_again(now),
            b'N' if frame.number == (self.number + 1) % 64 && self.kind != b'S' => {
                self.goes_on(now, b"");
            }
            _ => {}
        }
    }

    /// The packet that has gone is acknowledged.
    fn goes_on(&mut self, now: Micros, data: &[u8]) {
        let (name, file) = self.options.file.clone().unwrap_or_default();
        if self.kind == b'S' {
            self.agreed = Parameters::of(&self.options).agreed(data);
        }
        self.tries = 0;
        self.done += std::mem::take(&mut self.length);
        self.number = (self.number + 1) % 64;
        match self.kind {
            b'S' => {
                let (name, _) = encoded(name.as_bytes(), &self.agreed, 80);
                self.goes(now, b'F', &name);
            }
            b'F' | b'D' if self.done < file.len() => {
                let most = self.agreed.long.unwrap_or(94) - 12;
                let (data, length) = encoded(&file[self.done..], &self.agreed, most);
                self.length = length;
                self.goes(now, b'D', &data);
            }
            b'F' | b'D' => self.goes(now, b'Z', b""),
            b'Z' => self.goes(now, b'B', b""),
            _ => self.ends(now, true),
        }
    }

    fn goes(&mut self, now: Micros, kind: u8, data: &[u8]) {
        self.kind = kind;
        self.latest = framed(kind, self.number, data, self.agreed.check);
        self.goes_again(now);
    }

    fn goes_again(&mut self, now: Micros) {
        self.report.packets += 1;
        let mut packet = self.latest.clone();
        if self.options.damaged.contains(&self.report.packets) {
            let middle = packet.len() / 2;
            packet[middle] ^= 4;
        }
        self.says(now, &packet);
        let left = self.leaving.back().map_or(now, |(at, _)| *at);
        self.until = Some(left + PATIENCE);
    }

    fn goes_alone(&mut self, now: Micros, kind: u8, data: &[u8]) {
        let packet = framed(kind, self.number, data, self.agreed.check);
        self.says(now, &packet);
    }

    fn ends(&mut self, now: Micros, is_done: bool) {
        self.until = None;
        self.anew = self.options.rest.map(|rest| now + rest);
        (self.report.is_over, self.report.is_done) = (true, is_done);
        let count = if is_done { &mut self.report.done } else { &mut self.report.failed };
        *count += 1;
    }

    /// The next transfer: what came in the one before is kept until another file comes.
    fn begins_anew(&mut self) {
        self.report.is_over = false;
        self.report.is_done = false;
        let begun = Self::new(self.options.clone());
        let before = std::mem::replace(self, begun);
        self.until = None;
        (self.report, self.leaving, self.answers) = (before.report, before.leaving, before.answers);
    }

    /// An answer, unless it gets lost.
    fn answers(&mut self, now: Micros, kind: u8, number: u8, data: &[u8]) {
        self.answers += 1;
        if !self.options.lost.contains(&self.answers) {
            let packet = framed(kind, number, data, self.agreed.check);
            self.says(now, &packet);
        }
        self.until = Some(now + PATIENCE + PATIENCE);
    }

    /// Characters leave behind those before them.
    fn says(&mut self, now: Micros, bytes: &[u8]) {
        let mut at = self.leaving.back().map_or(now, |(at, _)| (*at).max(now));
        for byte in bytes {
            at = at + self.options.line.characters(1);
            self.leaving.push_back((at, *byte));
        }
    }
}

impl Partner for Machine {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.poll_transmit(now)
    }
}

#[cfg(test)]
mod tests;
