//! A simulated FANUC control: reader/punch interface and remote buffer.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::fanuc::{Control, Options, Press};
//!
//! let mut control = Control::new(Options::default())?;
//! control.press(Micros::ZERO, Press::Read);
//! // 4,800 7E2: DC1 has left after 11 bits.
//! let left = control.next_event().expect("DC1 is on the wire");
//! assert_eq!((left, control.poll_transmit(left)), (Micros(2_292), Some(0x11)));
//! for (n, byte) in b"%\nO1\nM30\n%".iter().enumerate() {
//!     control.receive(Micros(10_000 + 2_292 * n as i64), *byte);
//! }
//! let report = control.report();
//! assert!(report.received.matches(b"O1\nM30\n%"));
//! assert_eq!((report.programs, report.alarms.len()), (1, 0));
//! # Ok::<(), softplug_machines::fanuc::OptionsError>(())
//! ```

mod drip;
mod hold;
mod line;
mod options;
mod panel;
mod punch;
mod punching;
mod reader;
mod reading;
mod remote;
mod report;
mod tape;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use softplug_abi::{LineErrorKind, Micros, ModemLines};

use self::drip::Execution;
use self::hold::Hold;
use self::punch::{Punch, Stop};
use self::reader::Reader;
use self::remote::Remote;
use crate::kept::{Counts, Store};
use crate::uart::{Sort, Uart, UartOptions};
use crate::{Partner, Signal};

pub use self::options::{
    CharacterSet, Code, Dc4, Eob, FeedHold, Feeding, Interface, Options, OptionsError, Parity,
    Press, PunchOptions, RemoteOptions, TvCheck, eight_none_two, seven_even_two,
};
pub use self::report::{Alarm, AlarmKind, RemoteReport, Report, Starvation};

const DC1: u8 = 0x11;
const DC2: u8 = 0x12;
const DC3: u8 = 0x13;
const DC4: u8 = 0x14;
const NAK: u8 = 0x15;
const SYN: u8 = 0x16;

/// A control with its reader, its punch and its remote buffer.
///
/// Time never runs backwards: an earlier `now` counts as the last one. After
/// every call, ask [`next_event`](Self::next_event) again.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{Control, Options, Press, seven_even_two};
///
/// // The operator punches a program.
/// let mut control = Control::new(Options { line: seven_even_two(0), ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Punch(b"O1\nM30\n".to_vec()));
/// let punched: Vec<u8> = std::iter::from_fn(|| control.poll_transmit(Micros::ZERO)).collect();
/// assert_eq!(punched, b"\x12%\nO1\nM30\n%\n\x14");
/// assert_eq!(control.report().punches, 1);
/// assert!(control.is_idle());
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Debug)]
pub struct Control {
    options: Options,
    uart: Uart,
    /// What the character in the transmitter is for.
    on_wire: Role,
    mode: Mode,
    now: Micros,
    late: Micros,
    panel: VecDeque<(Micros, Press)>,
    /// Codes that are to go out, in this order and not before their time.
    codes: VecDeque<(Micros, Role)>,
    /// Characters of a message of protocol A.
    message: VecDeque<u8>,
    reader: Reader,
    execution: Execution,
    remote: Remote,
    text: Store,
    hold: Hold,
    /// Start of the silence after which DC1 is repeated.
    silent_since: Micros,
    /// Characters of this reading or punch.
    position: u64,
    /// Our stops by DC3 and by CS, and the characters that may still leave.
    stopped: Stop,
    not_clear: Stop,
    allowance: u32,
    counters: Counters,
    alarms: Vec<Alarm>,
    signals: VecDeque<(Micros, Signal)>,
}

/// What goes on at the serial interface.
#[derive(Debug)]
enum Mode {
    Idle,
    Reading(Reading),
    Punching(Punch),
}

/// How far a reading has come.
#[derive(Copy, Clone, Debug)]
struct Reading {
    /// DC1 has left.
    is_open: bool,
    /// The last decision was to hold the host.
    is_holding: bool,
}

/// What a character that leaves is for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Role {
    Start,
    AskPunch,
    Hold,
    /// A DC3 that is no pause.
    Close,
    Reset,
    Alarm,
    Tape,
    Message,
}

#[derive(Copy, Clone, Debug, Default)]
struct Counters {
    arrived: u64,
    before_dc1: u64,
    ignored: u64,
    programs: u32,
    dc1s: u32,
    dc3s: u32,
    punches: u32,
    punched: u64,
}

impl Control {
    /// An idle control at time 0.
    ///
    /// # Errors
    /// Its settings contradict each other.
    pub fn new(options: Options) -> Result<Self, OptionsError> {
        options.check()?;
        let mut control = Self {
            uart: Uart::new(UartOptions {
                line: options.line,
                transmit_fifo: 1,
                receive_fifo: options.receive_fifo,
                latency: options.latency,
            }),
            on_wire: Role::Message,
            mode: Mode::Idle,
            now: Micros::ZERO,
            late: Micros::ZERO,
            panel: options.panel.clone().into(),
            codes: VecDeque::new(),
            message: VecDeque::new(),
            reader: Reader::new(&options),
            execution: Execution::new(&options),
            remote: Remote::new(options.remote.clone()),
            text: Store::new(options.keep),
            hold: Hold::default(),
            silent_since: Micros::ZERO,
            position: 0,
            stopped: Stop::default(),
            not_clear: Stop::default(),
            allowance: 0,
            counters: Counters::default(),
            alarms: Vec::new(),
            signals: VecDeque::new(),
            options,
        };
        control.show_ready(true);
        Ok(control)
    }

    /// A character has reached the control: its stop bit ended at `now`.
    pub fn receive(&mut self, now: Micros, byte: u8) {
        self.advance(now);
        let now = self.now;
        self.meet(now);
        if self.uart.arrive(now, byte & self.mask()).is_err() {
            self.raise(AlarmKind::LineError);
        }
        self.settle(now);
    }

    /// A character with a wrong parity or without stop bit has reached it.
    pub fn receive_damaged(&mut self, now: Micros) {
        self.advance(now);
        self.meet(self.now);
        self.raise(AlarmKind::LineError);
        self.settle(self.now);
    }

    /// The operator does something.
    pub fn press(&mut self, now: Micros, press: Press) {
        self.advance(now);
        self.do_press(press);
        self.settle(self.now);
    }

    /// When something can next be seen of the control; call
    /// [`advance`](Self::advance) then.
    pub fn next_event(&self) -> Option<Micros> {
        let left = self.signals.front().map(|(at, _)| *at);
        earliest(earliest(left, self.execution.next()), self.next_of_line())
    }

    /// Does all that is due by now, each thing at its own time.
    pub fn advance(&mut self, now: Micros) {
        let now = now.max(self.now);
        if let Some(due) = self.next_event() {
            self.late = self.late.max(now - due);
        }
        self.settle(now);
    }

    /// The next character that has left by now, damaged or not.
    pub fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.advance(now);
        loop {
            match self.signals.pop_front()?.1 {
                Signal::Character(byte) | Signal::LineError { byte: Some(byte), .. } => {
                    return Some(byte);
                }
                Signal::LineError { byte: None, .. } | Signal::ModemLines { .. } => {}
            }
        }
    }

    /// What has happened so far.
    pub fn report(&self) -> Report {
        let held = self.hold.total(self.now);
        let awaits = matches!(self.mode, Mode::Reading(_));
        let (starved, starved_for, starvations) = self.execution.starvation(self.now, held, awaits);
        let Counters { arrived, before_dc1, ignored, programs, .. } = self.counters;
        Report {
            received: self.text.received(),
            arrived,
            before_dc1,
            ignored,
            programs,
            blocks: self.execution.executed(),
            alarms: self.alarms.clone(),
            holds: self.hold.count(),
            held,
            characters_after_dc3: self.hold.characters(),
            starved,
            starved_for,
            starvations,
            largest_level: self.execution.largest_level(),
            dc1s: self.counters.dc1s,
            dc3s: self.counters.dc3s,
            punches: self.counters.punches,
            punched: self.counters.punched,
            punched_after_dc3: Counts(self.stopped.counts()),
            punched_after_cs: Counts(self.not_clear.counts()),
            remote: self.remote.report().clone(),
            late: self.late,
        }
    }

    /// Whether the control neither reads nor punches, and all that it had to
    /// say has left.
    pub fn is_idle(&self) -> bool {
        matches!(self.mode, Mode::Idle)
            && self.codes.is_empty()
            && self.message.is_empty()
            && self.uart.has_room()
    }

    fn settle(&mut self, now: Micros) {
        loop {
            self.feed_transmitter();
            let (execution, line) = (self.execution.next(), self.next_of_line());
            let Some(at) = earliest(execution, line).filter(|at| *at <= now) else { break };
            self.now = self.now.max(at);
            // Characters on the wire first, then what they cause.
            if self.uart.next_left() == Some(at) {
                self.leave(at);
            } else if self.uart.next_service() == Some(at) {
                self.look_at_arrivals(at);
            } else if execution == Some(at) {
                self.execution.advance(at, self.hold.total(at));
                self.decide_on_draining();
            } else if let Some(place) = self.next_press().filter(|place| self.panel[*place].0 <= at)
                && let Some((_, press)) = self.panel.remove(place)
            {
                self.do_press(press);
            } else {
                self.say_again();
            }
        }
        self.now = now;
    }

    /// When the line, the panel or the protocol is to be looked at.
    fn next_of_line(&self) -> Option<Micros> {
        let mut next = earliest(self.uart.next_left(), self.uart.next_service());
        if self.uart.has_room() {
            next = earliest(next, self.codes.front().map(|(at, _)| (*at).max(self.now)));
        }
        let press = self.next_press().map(|place| self.panel[place].0.max(self.now));
        next = earliest(next, press);
        match &self.mode {
            Mode::Idle => {}
            Mode::Reading(reading) => next = earliest(next, self.next_dc1(*reading)),
            Mode::Punching(punch) => next = earliest(next, punch.asks_at),
        }
        if self.options.interface == Interface::RemoteA && self.message.is_empty() {
            next = earliest(next, self.remote.next(self.now, self.has_space()));
        }
        next
    }

    /// What is said because nothing came.
    fn say_again(&mut self) {
        let now = self.now;
        if self.message.is_empty()
            && let Some(message) = self.remote.advance(now, self.has_space())
        {
            self.message.extend(message);
            return;
        }
        match &mut self.mode {
            Mode::Idle => {}
            Mode::Reading(_) => {
                self.silent_since = now;
                self.codes.push_back((now, Role::Start));
            }
            Mode::Punching(punch) => {
                punch.asks_at =
                    punch.asks_at.and(self.options.punch.wait_dc1).map(|wait| now + wait);
                self.codes.push_back((now, Role::AskPunch));
            }
        }
    }

    fn raise(&mut self, kind: AlarmKind) {
        if matches!(self.mode, Mode::Idle) {
            return;
        }
        self.alarms.push(Alarm { at: self.now, position: self.position, kind, late: self.late });
        self.break_off(&Press::Alarm);
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

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.advance(now);
        self.signals.pop_front().map(|(_, signal)| signal)
    }

    fn receive_damaged(&mut self, now: Micros, _kind: LineErrorKind, _byte: Option<u8>) {
        self.receive_damaged(now);
    }

    fn modem_lines(&mut self, now: Micros, lines: ModemLines, on: ModemLines) {
        self.advance(now);
        self.see_modem_lines(lines, on);
        self.settle(self.now);
    }
}

fn earliest(one: Option<Micros>, other: Option<Micros>) -> Option<Micros> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    }
}
