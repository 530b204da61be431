//! A simulated computer that speaks RK512: areas of memory behind a [`Station`],
//! commands of its own, and reactions that are wrong on demand.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::r3964::rk512::{Area, Computer, Options};
//!
//! let mut computer = Computer::new(Options::default())?;
//! computer.memory.set(Area::Db(5), vec![0; 64]);
//! computer.fetch(Micros::ZERO, Area::Db(5), 10, 7);
//! assert_eq!(computer.waiting(), 1);
//! # Ok::<(), softplug_machines::r3964::OptionsError>(())
//! ```

mod memory;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use softplug_abi::{LineErrorKind, Micros};

use super::{Error, OptionsError, Station};
use crate::{Partner, Signal};

pub use self::memory::{Area, Memory};

/// Bytes of data in one telegram.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::{Partner, r3964};
/// use softplug_machines::r3964::rk512::{Area, Computer, Options, TELEGRAM_BYTES};
///
/// // Of 130 bytes, the first telegram holds 128; a follow-up telegram has the rest.
/// let line = LineParameters::new(0);
/// let procedure = r3964::Options { line, nak_at_start: false, ..r3964::Options::default() };
/// let mut computer = Computer::new(Options { procedure, ..Options::default() })?;
/// computer.write(Micros::ZERO, Area::Db(5), 0, vec![0; 130]);
/// assert_eq!(computer.poll_transmit(Micros(1)), Some(0x02));
/// computer.receive(Micros(2), 0x10);
/// let telegram: Vec<u8> = std::iter::from_fn(|| computer.poll_transmit(Micros(2))).collect();
/// // A header before them; DLE, ETX and the check character behind.
/// assert_eq!(telegram.len(), 10 + TELEGRAM_BYTES + 3);
/// # Ok::<(), r3964::OptionsError>(())
/// ```
pub const TELEGRAM_BYTES: usize = 128;
const HEADER_BYTES: usize = 10;
const SEND_DB: u8 = 0x41;
const SEND_DX: u8 = 0x4F;
const FETCH: u8 = 0x45;
const FOLLOW_UP: u8 = 0xFF;

/// Settings of a [`Computer`].
///
/// The example of [`Outcome`] shows them.
#[derive(Clone, Debug)]
pub struct Options {
    /// The procedure underneath.
    pub procedure: super::Options,
    /// How long a reaction to a command of its own may take.
    pub reaction_timeout: Micros,
    /// What it does wrong with the nth command, from 1, follow-ups counted.
    pub faults: Vec<(u32, Fault)>,
}

impl Default for Options {
    /// 3964R with Siemens' values and 20 s for a reaction.
    fn default() -> Self {
        Self {
            procedure: super::Options::default(),
            reaction_timeout: Micros::from_secs(20),
            faults: Vec::new(),
        }
    }
}

/// What a computer does wrong with a command.
///
/// The example of [`Served`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Fault {
    /// It reacts with this error and does nothing.
    Error(u8),
    /// It does what it should and does not react.
    NoReaction,
    /// It reacts with one byte less than it should.
    Short,
    /// It reacts with one byte more than it should.
    Long,
    /// Its reaction has a wrong header.
    Malformed,
}

/// A command of the computer's own.
///
/// The example of [`Outcome`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Command {
    /// Where in the other side's memory.
    pub area: Area,
    /// From which word or byte.
    pub offset: u8,
    /// What is written; `None`: it is read.
    pub data: Option<Vec<u8>>,
    /// Words or bytes, whichever the area counts.
    pub count: u16,
    /// Coordination flag: byte and bit.
    pub flag: Option<(u8, u8)>,
}

/// How a command of its own ended.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::{Partner, r3964};
/// use softplug_machines::r3964::rk512::{Area, Command, Computer, Options, Trouble};
///
/// let line = LineParameters::new(0);
/// let procedure = r3964::Options { line, nak_at_start: false, ..r3964::Options::default() };
/// let reaction_timeout = Micros::from_secs(5);
/// let mut computer =
///     Computer::new(Options { procedure, reaction_timeout, ..Options::default() })?;
/// // Word 10 of data block 5 is asked for. The telegram is taken, and nobody reacts.
/// let command = Command { area: Area::Db(5), offset: 10, data: None, count: 1, flag: None };
/// computer.command(Micros::ZERO, command);
/// for now in [Micros(1), Micros(2)] {
///     while computer.poll_transmit(now).is_some() {}
///     computer.receive(now, 0x10);
/// }
/// computer.advance(Micros::from_secs(6));
/// assert_eq!(computer.outcomes[0].result, Err(Trouble::NoReaction));
/// # Ok::<(), r3964::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outcome {
    /// When.
    pub at: Micros,
    /// The command.
    pub command: Command,
    /// What was read, nothing for what was written; or why not.
    pub result: Result<Vec<u8>, Trouble>,
}

/// Why a command of its own failed.
///
/// The example of [`Outcome`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Trouble {
    /// The reaction had this error number.
    Reaction(u8),
    /// There was no reaction in time.
    NoReaction,
    /// The reaction has the wrong form or length.
    Malformed,
    /// The telegram could not be sent.
    Procedure(Error),
}

/// A command that came, as far as its header could be read.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::{Partner, r3964};
/// use softplug_machines::r3964::rk512::{Computer, Fault, Options};
///
/// // The first command is refused with error 32.
/// let line = LineParameters::new(0);
/// let procedure = r3964::Options { line, nak_at_start: false, ..r3964::Options::default() };
/// let faults = vec![(1, Fault::Error(0x32))];
/// let mut computer = Computer::new(Options { procedure, faults, ..Options::default() })?;
/// let fetch = [0x00, 0x00, 0x45, 0x44, 0x05, 0x00, 0x00, 0x02, 0xFF, 0xFF];
/// computer.receive(Micros(1), 0x02);
/// for byte in [&fetch[..], &[0x10, 0x03, 0x15]].concat() {
///     computer.receive(Micros(2), byte);
/// }
/// assert_eq!((computer.served[0].error, &computer.served[0].telegram[..]), (0x32, &fetch[..]));
/// # Ok::<(), r3964::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Served {
    /// When its telegram had come.
    pub at: Micros,
    /// The error number of the reaction, 0 for good.
    pub error: u8,
    /// The telegram.
    pub telegram: Vec<u8>,
}

/// A machine that speaks RK512.
///
/// The examples of [`Outcome`] and [`Served`] show its two sides.
#[derive(Debug)]
pub struct Computer {
    /// What the other side reads and writes.
    pub memory: Memory,
    /// How its own commands ended, in order.
    pub outcomes: Vec<Outcome>,
    /// The commands that it carried out or refused, in order.
    pub served: Vec<Served>,
    /// Reactions that nobody asked for, or that came too late.
    pub stray_reactions: u32,
    station: Station,
    options: Options,
    /// Blocks of the station's report that were looked at.
    received: usize,
    sent: usize,
    /// What the blocks that were given to the station are.
    telegrams: VecDeque<Telegram>,
    commands: VecDeque<Command>,
    current: Option<Current>,
    /// What a follow-up telegram would go on with.
    continued: Option<Continued>,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Telegram {
    Command,
    Reaction,
}

#[derive(Debug)]
struct Current {
    command: Command,
    /// Bytes that have been written or read.
    moved: usize,
    result: Vec<u8>,
    deadline: Option<Micros>,
}

#[derive(Copy, Clone, Debug)]
struct Continued {
    command: u8,
    area: Area,
    at: usize,
    left: usize,
}

impl Computer {
    /// A computer with empty memory at time 0.
    ///
    /// # Errors
    /// The procedure's settings contradict each other.
    pub fn new(options: Options) -> Result<Self, OptionsError> {
        Ok(Self {
            station: Station::new(options.procedure.clone())?,
            memory: Memory::default(),
            outcomes: Vec::new(),
            served: Vec::new(),
            stray_reactions: 0,
            options,
            received: 0,
            sent: 0,
            telegrams: VecDeque::new(),
            commands: VecDeque::new(),
            current: None,
            continued: None,
        })
    }

    /// Writes to the other side's memory: SEND. Whole words where the area counts
    /// words.
    pub fn write(&mut self, now: Micros, area: Area, offset: u8, data: Vec<u8>) {
        let count = (data.len() / area.unit()) as u16;
        self.command(now, Command { area, offset, data: Some(data), count, flag: None });
    }

    /// Reads so many words or bytes of the other side's memory: FETCH.
    pub fn fetch(&mut self, now: Micros, area: Area, offset: u8, count: u16) {
        self.command(now, Command { area, offset, data: None, count, flag: None });
    }

    /// Carries out a command once those before it are done.
    pub fn command(&mut self, now: Micros, command: Command) {
        self.commands.push_back(command);
        self.settle(now);
    }

    /// The procedure underneath.
    pub fn station(&self) -> &Station {
        &self.station
    }

    /// Commands of its own that are not done yet.
    pub fn waiting(&self) -> usize {
        self.commands.len() + usize::from(self.current.is_some())
    }

    fn settle(&mut self, now: Micros) {
        self.look_at_sent();
        self.look_at_received(now);
        let is_due = |current: &Current| current.deadline.is_some_and(|deadline| deadline <= now);
        if self.current.as_ref().is_some_and(is_due) {
            self.end(now, Err(Trouble::NoReaction));
        }
        if self.current.is_none()
            && let Some(command) = self.commands.pop_front()
        {
            let (moved, result, deadline) = (0, Vec::new(), None);
            self.current = Some(Current { command, moved, result, deadline });
            self.send_command(now);
        }
    }

    fn look_at_sent(&mut self) {
        while let Some(sent) = self.station.report().sent.get(self.sent) {
            self.sent += 1;
            let (at, result) = (sent.ended, sent.result);
            if self.telegrams.pop_front() == Some(Telegram::Command)
                && let Some(current) = &mut self.current
            {
                match result {
                    Ok(()) => current.deadline = Some(at + self.options.reaction_timeout),
                    Err(error) => self.end(at, Err(Trouble::Procedure(error))),
                }
            }
        }
    }

    fn look_at_received(&mut self, now: Micros) {
        while let Some(block) = self.station.report().received.get(self.received) {
            self.received += 1;
            let telegram = block.data.clone();
            if telegram.get(2) == Some(&0) {
                self.take_reaction(now, &telegram);
            } else {
                self.serve(now, telegram);
            }
        }
    }

    // Commands of its own.

    fn send_command(&mut self, now: Micros) {
        let Some(current) = &mut self.current else { return };
        let Command { area, offset, data, count, flag } = &current.command;
        let opcode = match (data, area) {
            (Some(_), Area::Dx(_)) => SEND_DX,
            (Some(_), _) => SEND_DB,
            (None, _) => FETCH,
        };
        let mut telegram = if current.moved == 0 {
            let [high, low] = count.to_be_bytes();
            let (byte, bit) = flag.unwrap_or((0xFF, 0x0F));
            let place = [area.block(), *offset];
            vec![0, 0, opcode, area.letter(), place[0], place[1], high, low, byte, 0xF0 | bit]
        } else {
            vec![FOLLOW_UP, 0, opcode, area.letter()]
        };
        if let Some(data) = data {
            let rest = &data[current.moved..];
            let piece = &rest[..rest.len().min(TELEGRAM_BYTES)];
            telegram.extend(piece);
            current.moved += piece.len();
        }
        current.deadline = None;
        self.say(now, telegram, Telegram::Command);
    }

    fn take_reaction(&mut self, now: Micros, telegram: &[u8]) {
        let Some(current) = &mut self.current else {
            self.stray_reactions += 1;
            return;
        };
        let Command { area, data, count, .. } = &current.command;
        let &[first, 0, 0, error, ref read @ ..] = telegram else {
            return self.end(now, Err(Trouble::Malformed));
        };
        let total = usize::from(*count) * area.unit();
        let is_follow_up = if data.is_some() {
            current.moved > TELEGRAM_BYTES
        } else {
            !current.result.is_empty()
        };
        if (first == FOLLOW_UP) != is_follow_up {
            return self.end(now, Err(Trouble::Malformed));
        }
        if error != 0 {
            return self.end(now, Err(Trouble::Reaction(error)));
        }
        let expected = match data {
            Some(_) => 0,
            None => (total - current.result.len()).min(TELEGRAM_BYTES),
        };
        if read.len() != expected {
            return self.end(now, Err(Trouble::Malformed));
        }
        current.result.extend(read);
        if data.is_none() {
            current.moved = current.result.len();
        }
        if current.moved < total {
            self.send_command(now);
        } else {
            let result = std::mem::take(&mut current.result);
            self.end(now, Ok(result));
        }
    }

    fn end(&mut self, at: Micros, result: Result<Vec<u8>, Trouble>) {
        if let Some(Current { command, .. }) = self.current.take() {
            self.outcomes.push(Outcome { at, command, result });
        }
    }

    // Commands of the other side.

    fn serve(&mut self, now: Micros, telegram: Vec<u8>) {
        let nth = self.served.len() as u32 + 1;
        let fault = self.options.faults.iter().find(|(at, _)| *at == nth).map(|(_, fault)| *fault);
        let first = if telegram.first() == Some(&FOLLOW_UP) { FOLLOW_UP } else { 0 };
        let carried_out = match fault {
            Some(Fault::Error(error)) => {
                self.continued = None;
                Err(error)
            }
            _ => self.carry_out(&telegram),
        };
        let error = carried_out.as_ref().err().copied().unwrap_or(0);
        let mut reaction = vec![first, 0, 0, error];
        reaction.extend(carried_out.unwrap_or_default());
        match fault {
            Some(Fault::Short) => drop(reaction.pop()),
            Some(Fault::Long) => reaction.push(0),
            Some(Fault::Malformed) => reaction[1] = 0x55,
            Some(Fault::NoReaction | Fault::Error(_)) | None => {}
        }
        self.served.push(Served { at: now, error, telegram });
        if fault != Some(Fault::NoReaction) {
            self.say(now, reaction, Telegram::Reaction);
        }
    }

    /// The data to react with, or the error number.
    fn carry_out(&mut self, telegram: &[u8]) -> Result<Vec<u8>, u8> {
        let continued = self.continued.take();
        let (next, data) = match *telegram {
            [FOLLOW_UP, 0, command, letter, ref data @ ..] => {
                let next = continued.ok_or(0x36)?;
                if next.command != command || next.area.letter() != letter {
                    return Err(0x36);
                }
                (next, data)
            }
            [0, 0, command, letter, block, offset, high, low, _, _, ref data @ ..] => {
                if ![SEND_DB, SEND_DX, FETCH].contains(&command) {
                    return Err(0x16);
                }
                let area = Area::from_telegram(letter, block).ok_or(0x0C)?;
                let is_sent_to = matches!(
                    (command, area),
                    (FETCH, _) | (SEND_DB, Area::Db(_)) | (SEND_DX, Area::Dx(_))
                );
                if !is_sent_to {
                    return Err(0x0C);
                }
                let left = usize::from(u16::from_be_bytes([high, low])) * area.unit();
                if left == 0 {
                    return Err(0x34);
                }
                let at = usize::from(offset) * area.unit();
                self.memory.range(area, at, left).ok_or(0x14)?;
                (Continued { command, area, at, left }, data)
            }
            _ => return Err(if telegram.len() < HEADER_BYTES { 0x34 } else { 0x10 }),
        };
        let bytes = next.left.min(TELEGRAM_BYTES);
        let piece = self.memory.range(next.area, next.at, bytes).ok_or(0x14)?;
        let reaction = if next.command == FETCH {
            if !data.is_empty() {
                return Err(0x34);
            }
            piece.to_vec()
        } else {
            if data.len() != bytes {
                return Err(0x34);
            }
            piece.copy_from_slice(data);
            Vec::new()
        };
        let rest = Continued { at: next.at + bytes, left: next.left - bytes, ..next };
        self.continued = Some(rest).filter(|rest| rest.left > 0);
        Ok(reaction)
    }

    fn say(&mut self, now: Micros, telegram: Vec<u8>, kind: Telegram) {
        self.telegrams.push_back(kind);
        self.station.send(now, telegram);
    }
}

impl Partner for Computer {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.station.receive(now, byte);
        self.settle(now);
    }

    fn next_event(&self) -> Option<Micros> {
        let deadline = self.current.as_ref().and_then(|current| current.deadline);
        [self.station.next_event(), deadline].into_iter().flatten().min()
    }

    fn advance(&mut self, now: Micros) {
        self.station.advance(now);
        self.settle(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        let byte = self.station.poll_transmit(now);
        self.settle(now);
        byte
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, _byte: Option<u8>) {
        self.station.receive_damaged(now, kind);
        self.settle(now);
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        let signal = self.station.poll_signal(now);
        self.settle(now);
        signal
    }
}
