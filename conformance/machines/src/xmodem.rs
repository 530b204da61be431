//! A simulated control that speaks XMODEM: it calls for files and keeps them, or sends one to
//! whoever calls.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::xmodem::{Control, Options};
//!
//! let mut control = Control::new(Options::default());
//! // It calls at once; C has left a character later.
//! assert_eq!(control.next_event(), Some(Micros::ZERO));
//! control.advance(Micros::ZERO);
//! assert_eq!(control.poll_transmit(Micros(1_042)), Some(b'C'));
//! ```

use std::collections::VecDeque;

use softplug_abi::{LineParameters, Micros};

use crate::Partner;

const SOH: u8 = 0x01;
const STX: u8 = 0x02;
const EOT: u8 = 0x04;
const ACK: u8 = 0x06;
const NAK: u8 = 0x15;
const CAN: u8 = 0x18;

/// How long it waits for a block, or for the answer to one.
const PATIENCE: Micros = Micros::from_secs(10);
/// Silence that ends a block, and that makes the line clear.
const SILENCE: Micros = Micros::from_secs(1);
/// How often it tries.
const TRIES: u32 = 10;

/// What the control is set to.
///
/// ```
/// use softplug_machines::xmodem::Options;
///
/// let options = Options { is_crc: false, ..Options::default() };
/// assert!(options.file.is_none());
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// Its line.
    pub line: LineParameters,
    /// It calls with C, not with NAK.
    pub is_crc: bool,
    /// The file that it sends; without one it calls.
    pub file: Option<Vec<u8>>,
    /// It sends blocks of 1,024 bytes.
    pub is_long: bool,
    /// When it calls for the first time.
    pub begins: Micros,
    /// Blocks, counted from 1 as they come or go, that have a bit wrong.
    pub damaged: Vec<u32>,
    /// Answers of its own, counted from 1, that never leave.
    pub lost: Vec<u32>,
    /// So long behind a transfer it begins anew; never without.
    pub rest: Option<Micros>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            line: LineParameters::new(9_600),
            is_crc: true,
            file: None,
            is_long: false,
            begins: Micros::ZERO,
            damaged: Vec::new(),
            lost: Vec::new(),
            rest: None,
        }
    }
}

/// What it has seen.
///
/// ```
/// use softplug_machines::xmodem::{Control, Options};
///
/// assert!(!Control::new(Options::default()).report().is_over);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// The file that came last, with its padding.
    pub came: Vec<u8>,
    /// The last transfer has ended well.
    pub is_done: bool,
    /// It has ended, well or not, and no other one has begun.
    pub is_over: bool,
    /// Transfers that ended well.
    pub done: u32,
    /// Transfers that failed; calls to which nobody said anything are none.
    pub failed: u32,
    /// Blocks that came or went, repeated ones included.
    pub blocks: u32,
}

/// What it is at.
#[derive(Clone, PartialEq, Eq, Debug)]
enum Doing {
    /// It calls, or waits for the next block.
    Waits,
    /// A block comes.
    Block(Vec<u8>),
    /// Until the line is clear; then NAK.
    Clears,
    /// It waits for a call.
    Listens,
    /// A block, or EOT, has gone; its answer is awaited.
    Asks,
    Nothing,
}

/// The control.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::xmodem::{Control, Options};
///
/// let file = Some(b"M30".to_vec());
/// let mut control = Control::new(Options { file, ..Options::default() });
/// assert_eq!(control.next_event(), None, "it waits for a call");
/// control.receive(Micros(500), 0x15);
/// assert_eq!(control.poll_transmit(Micros(1_542)), Some(0x01));
/// ```
#[derive(Clone, Debug)]
pub struct Control {
    options: Options,
    doing: Doing,
    until: Option<Micros>,
    is_crc: bool,
    /// No good block has come yet.
    is_first: bool,
    /// The number of the block that comes, or goes.
    number: u8,
    tries: u32,
    answers: u32,
    /// Bytes of the file that have been acknowledged, and of the block that has gone.
    done: usize,
    length: usize,
    can_heard: bool,
    /// Somebody has said something since it began.
    is_heard: bool,
    leaving: VecDeque<(Micros, u8)>,
    report: Report,
}

impl Control {
    /// A control with these settings.
    pub fn new(options: Options) -> Self {
        let sends = options.file.is_some();
        Self {
            doing: if sends { Doing::Listens } else { Doing::Waits },
            until: if sends { None } else { Some(options.begins) },
            is_crc: options.is_crc,
            is_first: true,
            number: 1,
            tries: 0,
            answers: 0,
            done: 0,
            length: 0,
            can_heard: false,
            is_heard: false,
            leaving: VecDeque::new(),
            report: Report::default(),
            options,
        }
    }

    /// What it has seen so far.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Somebody has said something, and the transfer has not ended.
    pub fn is_under_way(&self) -> bool {
        self.is_heard && !self.report.is_over
    }

    /// A character has come: its last bit ended at `now`.
    pub fn receive(&mut self, now: Micros, byte: u8) {
        self.is_heard |= self.doing != Doing::Nothing;
        let is_second_can = std::mem::replace(&mut self.can_heard, byte == CAN) && byte == CAN;
        match &mut self.doing {
            Doing::Nothing => {}
            Doing::Block(block) => {
                block.push(byte);
                let block = block.clone();
                self.hears(now, block);
            }
            Doing::Clears => self.until = Some(now + SILENCE),
            _ if is_second_can => self.ends(now, false),
            Doing::Waits if byte == SOH || byte == STX => self.hears(now, vec![byte]),
            Doing::Waits if byte == EOT => {
                if self.number == 1 && self.is_first {
                    self.report.came.clear();
                }
                self.says(now, ACK);
                self.ends(now, true);
            }
            Doing::Waits if byte == CAN => {}
            Doing::Waits => self.clears(now),
            Doing::Listens if byte == NAK || byte == b'C' => {
                self.is_crc = byte == b'C';
                self.goes(now);
            }
            // What comes before the block has left is no answer.
            Doing::Asks if self.leaving.is_empty() => self.is_answered(now, byte),
            Doing::Listens | Doing::Asks => {}
        }
    }

    /// When it wants to be called next.
    pub fn next_event(&self) -> Option<Micros> {
        let leaves = self.leaving.front().map(|(at, _)| *at);
        [leaves, self.until].into_iter().flatten().min()
    }

    /// Does what is due.
    pub fn advance(&mut self, now: Micros) {
        if self.until.is_none_or(|until| until > now) {
            return;
        }
        self.until = None;
        if self.doing == Doing::Nothing {
            return self.begins(now);
        }
        self.tries += 1;
        match self.doing {
            _ if self.tries > TRIES => {
                for _ in 0..2 {
                    self.says(now, CAN);
                }
                self.ends(now, false);
            }
            Doing::Asks => self.goes(now),
            Doing::Waits | Doing::Block(_) | Doing::Clears => {
                let call = if self.is_crc { b'C' } else { NAK };
                self.answers(now, if self.is_first { call } else { NAK });
                self.waits(now);
            }
            Doing::Listens | Doing::Nothing => {}
        }
    }

    /// A character that has left by `now`.
    pub fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.leaving.pop_front_if(|(at, _)| *at <= now).map(|(_, byte)| byte)
    }

    fn hears(&mut self, now: Micros, mut block: Vec<u8>) {
        let data = if block[0] == STX { 1_024 } else { 128 };
        let whole = 3 + data + if self.is_crc { 2 } else { 1 };
        if block.len() < whole {
            self.until = Some(now + SILENCE);
            self.doing = Doing::Block(block);
            return;
        }
        self.report.blocks += 1;
        if self.options.damaged.contains(&self.report.blocks) {
            block[5] ^= 4;
        }
        let is_good = block[1] == !block[2] && checked(&block[3..], self.is_crc);
        if !is_good {
            return self.clears(now);
        }
        if block[1] == self.number {
            if std::mem::take(&mut self.is_first) {
                self.report.came.clear();
            }
            self.report.came.extend(&block[3..3 + data]);
            self.number = self.number.wrapping_add(1);
        }
        self.tries = 0;
        self.answers(now, ACK);
        self.waits(now);
    }

    fn waits(&mut self, now: Micros) {
        self.doing = Doing::Waits;
        self.until = Some(now + PATIENCE);
    }

    fn clears(&mut self, now: Micros) {
        self.doing = Doing::Clears;
        self.until = Some(now + SILENCE);
    }

    fn is_answered(&mut self, now: Micros, byte: u8) {
        match byte {
            ACK if self.length == 0 => self.ends(now, true),
            ACK => {
                self.done += self.length;
                self.number = self.number.wrapping_add(1);
                self.tries = 0;
                self.goes(now);
            }
            NAK => self.goes(now),
            b'C' if self.done == 0 => self.goes(now),
            _ => {}
        }
    }

    /// The next block, or EOT, or the same once more.
    fn goes(&mut self, now: Micros) {
        let file = self.options.file.as_deref().unwrap_or_default();
        let rest = &file[self.done.min(file.len())..];
        let most =
            if self.options.is_long && self.is_crc && rest.len() > 896 { 1_024 } else { 128 };
        self.length = if rest.is_empty() { 0 } else { most };
        let mut bytes = vec![EOT];
        if self.length > 0 {
            let mut data = rest[..rest.len().min(most)].to_vec();
            data.resize(most, 0x1A);
            bytes = vec![if most == 128 { SOH } else { STX }, self.number, !self.number];
            bytes.extend(&data);
            bytes.extend(check(&data, self.is_crc));
            self.report.blocks += 1;
            if self.options.damaged.contains(&self.report.blocks) {
                bytes[9] ^= 0x10;
            }
        }
        for byte in bytes {
            self.says(now, byte);
        }
        self.doing = Doing::Asks;
        let left = self.leaving.back().map_or(now, |(at, _)| *at);
        self.until = Some(left + PATIENCE + PATIENCE);
    }

    fn ends(&mut self, now: Micros, is_done: bool) {
        self.doing = Doing::Nothing;
        self.until = self.options.rest.map(|rest| now + rest);
        (self.report.is_over, self.report.is_done) = (true, is_done);
        self.report.done += u32::from(is_done);
        self.report.failed += u32::from(!is_done && self.is_heard);
    }

    /// The next transfer.
    fn begins(&mut self, now: Micros) {
        (self.number, self.tries, self.done, self.length) = (1, 0, 0, 0);
        (self.is_first, self.is_heard, self.report.is_over) = (true, false, false);
        self.is_crc = self.options.is_crc;
        if self.options.file.is_some() {
            self.doing = Doing::Listens;
        } else {
            self.doing = Doing::Waits;
            self.until = Some(now);
        }
    }

    /// An answer, unless it gets lost.
    fn answers(&mut self, now: Micros, byte: u8) {
        self.answers += 1;
        if !self.options.lost.contains(&self.answers) {
            self.says(now, byte);
        }
    }

    /// A character leaves behind those before it.
    fn says(&mut self, now: Micros, byte: u8) {
        let before = self.leaving.back().map_or(now, |(at, _)| (*at).max(now));
        self.leaving.push_back((before + self.options.line.characters(1), byte));
    }
}

impl Partner for Control {
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

/// Whether the check that stands behind the data is its own: the CRC of both is nothing.
fn checked(data: &[u8], is_crc: bool) -> bool {
    if is_crc {
        return crc(data) == 0;
    }
    data.split_last().is_some_and(|(last, data)| check(data, false) == [*last])
}

fn check(data: &[u8], is_crc: bool) -> Vec<u8> {
    if is_crc {
        return crc(data).to_be_bytes().to_vec();
    }
    vec![data.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))]
}

/// CRC-16 with the polynomial 1021 hex, begun with 0: without a table, four bits at a time.
fn crc(data: &[u8]) -> u16 {
    let nibble = |crc: u16, bits: u8| {
        let top = (crc >> 12) as u8 ^ bits;
        let folded = u16::from(top);
        crc << 4 ^ folded << 12 ^ folded << 5 ^ folded
    };
    data.iter().fold(0, |crc, byte| nibble(nibble(crc, byte >> 4), byte & 15))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a sender and a receiver make of a file, once both are silent.
    fn meet(sender: Options, receiver: Options) -> [Report; 2] {
        let mut ends = [Control::new(sender), Control::new(receiver)];
        while let Some(now) = ends.iter().filter_map(Control::next_event).min() {
            assert!(now < Micros::from_secs(10_000), "it never ends");
            for end in &mut ends {
                end.advance(now);
            }
            for (from, to) in [(0, 1), (1, 0)] {
                while let Some(byte) = ends[from].poll_transmit(now) {
                    ends[to].receive(now, byte);
                }
            }
        }
        ends.map(|end| end.report)
    }

    fn sending(file: &[u8]) -> Options {
        Options { file: Some(file.to_vec()), ..Options::default() }
    }

    #[test]
    fn the_crc_is_that_of_the_catalogue() {
        assert_eq!(crc(b"123456789"), 0x31C3);
        assert!(checked(&[b"123456789".to_vec(), vec![0x31, 0xC3]].concat(), true));
    }

    #[test]
    fn a_file_passes_in_all_forms() {
        let file: Vec<u8> = (0..70_000_u32).map(|n| (n % 251) as u8).collect();
        for (is_crc, is_long) in [(false, false), (true, false), (true, true), (false, true)] {
            let sender = Options { is_long, ..sending(&file) };
            let receiver = Options { is_crc, ..Options::default() };
            let [sent, received] = meet(sender, receiver);
            assert!(sent.is_done && received.is_done, "{is_crc} {is_long}");
            assert_eq!(received.came[..file.len()], file);
            assert!(received.came[file.len()..].iter().all(|byte| *byte == 0x1A));
        }
    }

    #[test]
    fn what_is_damaged_or_lost_is_sent_again() {
        let file = [b'x'; 1_000];
        let sender = Options { damaged: vec![1, 4, 5], ..sending(&file) };
        let receiver = Options { damaged: vec![7], lost: vec![3], ..Options::default() };
        let [sent, received] = meet(sender, receiver);
        assert!(sent.is_done && received.is_done);
        assert_eq!(received.came[..1_000], file);
        assert!(sent.blocks > 8, "{sent:?}");
    }

    #[test]
    fn behind_a_transfer_another_one_begins() {
        let rest = Some(Micros::from_secs(3));
        let mut receiver = Control::new(Options { rest, ..Options::default() });
        let mut now = Micros::ZERO;
        for file in [b"one".as_slice(), b"two"] {
            let mut sender = Control::new(sending(file));
            while !sender.report().is_over {
                now =
                    [&sender, &receiver].into_iter().filter_map(Control::next_event).min().unwrap();
                sender.advance(now);
                receiver.advance(now);
                while let Some(byte) = sender.poll_transmit(now) {
                    receiver.receive(now, byte);
                }
                while let Some(byte) = receiver.poll_transmit(now) {
                    sender.receive(now, byte);
                }
            }
            assert_eq!(receiver.report().came[..3], *file);
        }
        assert_eq!((receiver.report().done, receiver.report().failed), (2, 0));
        assert!(now > Micros::from_secs(3));
    }

    #[test]
    fn nobody_there_is_given_up() {
        let mut control = Control::new(Options::default());
        while let Some(now) = control.next_event() {
            control.advance(now);
            while control.poll_transmit(now).is_some() {}
        }
        assert!(control.report().is_over && !control.report().is_done);
        assert_eq!(control.report().failed, 0, "nothing was begun");
    }
}
