//! A simulated control that receives a program with XON/XOFF, and sends one.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::xon_xoff::{Control, ControlOptions};
//!
//! // Executes nothing for a second, so that its 8 bytes fill up.
//! let options = ControlOptions {
//!     buffer: 8,
//!     low: 4,
//!     high: 6,
//!     pauses: vec![(0, Micros::from_secs(1))],
//!     ..ControlOptions::default()
//! };
//! let mut control = Control::new(options)?;
//! for n in 1..=5 {
//!     control.receive(Micros(n * 1_042), b'G');
//! }
//! // 3 bytes are free: XOFF starts at once and has left a character later.
//! assert_eq!(control.next_event(), Some(Micros(5 * 1_042 + 1_042)));
//! assert_eq!(control.poll_transmit(Micros(6 * 1_042)), Some(0x13));
//! # Ok::<(), softplug_machines::xon_xoff::ControlOptionsError>(())
//! ```

mod execution;
mod options;
mod report;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use softplug_abi::Micros;

use self::execution::Execution;
use crate::Partner;
use crate::kept::{Counts, Store};
use crate::uart::{Left, Sort, Uart, UartOptions};

pub use self::options::{ControlOptions, ControlOptionsError};
pub use self::report::{Alarm, AlarmKind, ControlReport};

/// A control with a receive buffer, two marks and a program that it executes.
///
/// Time never runs backwards: an earlier `now` counts as the last one. After
/// every call, ask [`next_event`](Self::next_event) again.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::xon_xoff::{Control, ControlOptions};
///
/// // XOFF stops the control's own program, XON lets it go on.
/// let line = LineParameters::new(0);
/// let mut control = Control::new(ControlOptions { line, ..ControlOptions::default() })?;
/// control.receive(Micros(0), 0x13);
/// control.punch(Micros(10), b"%\nO1\n".to_vec());
/// assert_eq!(control.next_event(), None);
/// control.receive(Micros(500), 0x11);
/// let punched: Vec<u8> = std::iter::from_fn(|| control.poll_transmit(Micros(500))).collect();
/// assert_eq!(punched, b"%\nO1\n");
/// # Ok::<(), softplug_machines::xon_xoff::ControlOptionsError>(())
/// ```
#[derive(Debug)]
pub struct Control {
    options: ControlOptions,
    uart: Uart,
    execution: Execution,
    now: Micros,
    store: Store,
    /// Bytes of data that the software has looked at or lost.
    looked_at: u64,
    arrived: u64,
    alarms: Vec<Alarm>,
    largest_level: usize,
    late: Micros,
    /// Whether the last decision was to hold the line.
    holding: bool,
    since_xoff: u32,
    /// A control byte that is to go out, and when: the next one replaces it.
    pending: Option<(Micros, u8)>,
    /// Start of the silence after which XON is repeated.
    silent_since: Micros,
    hold: Hold,
    /// Time of hold up to the last byte of data.
    held_at_last: Micros,
    first_start: Option<Micros>,
    last_end: Micros,
    xons: u32,
    xoffs: u32,
    outgoing: VecDeque<u8>,
    outgoing_from: Micros,
    stopped: bool,
    /// Since when the control's own sending is told to stop.
    stop: Hold,
    punched: u64,
    left: VecDeque<Left>,
}

impl Control {
    /// An idle control at time 0.
    ///
    /// # Errors
    /// Its settings contradict each other.
    pub fn new(options: ControlOptions) -> Result<Self, ControlOptionsError> {
        options.check()?;
        Ok(Self {
            uart: Uart::new(UartOptions {
                line: options.line,
                transmit_fifo: options.transmit_fifo,
                receive_fifo: options.receive_fifo,
                latency: options.latency,
            }),
            execution: Execution::new(options.rate, options.pauses.clone()),
            now: Micros::ZERO,
            store: Store::new(options.keep),
            looked_at: 0,
            arrived: 0,
            alarms: Vec::new(),
            largest_level: 0,
            late: Micros::ZERO,
            holding: false,
            since_xoff: 0,
            pending: options.xon_at_start.map(|at| (at, options.xon)),
            silent_since: options.xon_at_start.unwrap_or(Micros::ZERO),
            hold: Hold::default(),
            held_at_last: Micros::ZERO,
            first_start: None,
            last_end: Micros::ZERO,
            xons: 0,
            xoffs: 0,
            outgoing: VecDeque::new(),
            outgoing_from: Micros::ZERO,
            stopped: false,
            stop: Hold::default(),
            punched: 0,
            left: VecDeque::new(),
            options,
        })
    }

    /// A character's stop bit ended now.
    pub fn receive(&mut self, now: Micros, byte: u8) {
        self.advance(now);
        let now = self.now;
        self.silent_since = now;
        let position = self.arrived;
        if self.is_xoff(byte) {
            self.stop.begin(now);
        } else if self.is_xon(byte) {
            self.stop.end(now);
        } else {
            self.hold.character(now);
            self.first_start.get_or_insert(now - self.options.line.characters(1));
            self.last_end = now;
            self.held_at_last = self.hold.total(now);
            self.arrived += 1;
        }
        if self.uart.arrive(now, byte).is_err() {
            self.raise(AlarmKind::Overrun, position);
        }
        self.settle(now);
    }

    /// Sends `program` to the other side, through the transmitter and as long
    /// as the other side lets it.
    pub fn punch(&mut self, now: Micros, program: Vec<u8>) {
        self.advance(now);
        self.outgoing.extend(program);
        self.outgoing_from = self.now + self.options.latency;
        self.settle(self.now);
    }

    /// When something can next be seen of the control from outside; call
    /// [`advance`](Self::advance) then.
    pub fn next_event(&self) -> Option<Micros> {
        let needed = (self.holding).then(|| {
            let free = self.options.buffer - self.execution.level();
            (self.options.high + 1).saturating_sub(free)
        });
        [
            self.left.front().map(|left| left.at),
            self.next_but_execution(),
            needed.and_then(|bytes| self.execution.next_after(bytes)),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Does all that is due by now, each thing at its own time.
    pub fn advance(&mut self, now: Micros) {
        let now = now.max(self.now);
        if let Some(due) = self.next_event() {
            self.late = self.late.max(now - due);
        }
        self.settle(now);
    }

    /// The next character whose last bit has left by now.
    pub fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.advance(now);
        self.left.pop_front().map(|left| left.byte)
    }

    /// What has happened so far.
    pub fn report(&self) -> ControlReport {
        ControlReport {
            received: self.store.received(),
            arrived: self.arrived,
            consumed: self.execution.consumed(),
            alarms: self.alarms.clone(),
            holds: self.hold.count(),
            held: self.hold.total(self.now),
            characters_after_xoff: self.hold.characters(),
            allowed: self
                .first_start
                .map_or(Micros::ZERO, |first| self.last_end - first - self.held_at_last),
            starved: self.execution.starved(),
            starved_for: self.execution.starved_for(),
            largest_level: self.largest_level,
            late: self.late,
            xons: self.xons,
            xoffs: self.xoffs,
            punched: self.punched,
            punch_waiting: (self.outgoing.len() + self.uart.waiting(Sort::Data)) as u64,
            punched_after_xoff: self.stop.characters(),
        }
    }

    /// Whether the other side has been told to stop, and XON has not left.
    pub fn holds_line(&self) -> bool {
        self.hold.since.is_some()
    }

    fn settle(&mut self, now: Micros) {
        loop {
            self.feed_transmitter();
            let (execution, other) = (self.execution.next(), self.next_but_execution());
            let Some(at) = execution.into_iter().chain(other).min().filter(|&at| at <= now) else {
                break;
            };
            self.now = self.now.max(at);
            // Characters on the wire first, then what they cause.
            if self.uart.next_left() == Some(at) {
                self.leave(at);
            } else if self.uart.next_service() == Some(at) {
                self.look_at_arrivals(at);
            } else if execution == Some(at) {
                self.execution.advance(at, self.hold.total(at));
                self.decide_on_draining(at);
            } else if self.next_repeat() == Some(at) {
                self.silent_since = at;
                self.pending = Some((at, self.options.xon));
            }
        }
        self.now = now;
        self.feed_transmitter();
    }

    fn next_but_execution(&self) -> Option<Micros> {
        let has_room = self.uart.has_room();
        let outgoing = !self.outgoing.is_empty() && !self.stopped && self.outgoing_from > self.now;
        [
            self.uart.next_left(),
            self.uart.next_service(),
            self.pending.map(|(at, _)| at).filter(|_| has_room),
            outgoing.then_some(self.outgoing_from).filter(|_| has_room),
            self.next_repeat(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    fn next_repeat(&self) -> Option<Micros> {
        let open = !self.holding && self.pending.is_none();
        self.options.repeat_xon.filter(|_| open).map(|span| self.silent_since + span)
    }

    /// Control bytes go in front of the data, but not of what the FIFO holds.
    fn feed_transmitter(&mut self) {
        if let Some((at, byte)) = self.pending
            && at <= self.now
            && self.uart.push(self.now, byte, Sort::Control)
        {
            self.pending = None;
        }
        while !self.stopped && self.outgoing_from <= self.now && self.uart.has_room() {
            let Some(byte) = self.outgoing.pop_front() else { return };
            let taken = self.uart.push(self.now, byte, Sort::Data);
            debug_assert!(taken, "there was room");
        }
    }

    fn leave(&mut self, at: Micros) {
        let Some(left) = self.uart.poll(at) else { return };
        match left.sort {
            Sort::Control if left.byte == self.options.xoff => {
                self.xoffs += 1;
                self.hold.begin(at);
            }
            Sort::Control => {
                self.xons += 1;
                self.silent_since = at;
                self.hold.end(at);
            }
            Sort::Data => {
                self.punched += 1;
                self.stop.character(at);
            }
        }
        self.left.push_back(left);
    }

    fn look_at_arrivals(&mut self, at: Micros) {
        while let Some(byte) = self.uart.serve(at) {
            if self.is_xoff(byte) {
                self.stopped = true;
                continue;
            }
            if self.is_xon(byte) {
                self.stopped = false;
                continue;
            }
            let position = self.looked_at;
            self.looked_at += 1;
            if self.execution.level() == self.options.buffer {
                self.raise(AlarmKind::BufferOverflow, position);
            } else {
                self.store.push(byte);
                self.execution.arrive(at, self.hold.total(at));
                self.largest_level = self.largest_level.max(self.execution.level());
                if self.options.echo {
                    self.outgoing.push_back(byte);
                }
            }
            self.decide_on_arrival(at);
        }
        // What overran the FIFO came after all that was in it.
        self.looked_at = self.arrived;
    }

    fn decide_on_arrival(&mut self, at: Micros) {
        let free = self.options.buffer - self.execution.level();
        if !self.holding {
            if free < self.options.low {
                self.hold_line(at);
            }
            return;
        }
        self.since_xoff += 1;
        if self.options.repeat_xoff.is_some_and(|after| self.since_xoff >= after) {
            self.hold_line(at);
        }
    }

    fn hold_line(&mut self, at: Micros) {
        self.holding = true;
        self.since_xoff = 0;
        self.pending = Some((at, self.options.xoff));
    }

    fn decide_on_draining(&mut self, at: Micros) {
        let free = self.options.buffer - self.execution.level();
        if self.holding && free > self.options.high {
            self.holding = false;
            self.silent_since = at + self.options.latency;
            self.pending = Some((at + self.options.latency, self.options.xon));
        }
    }

    fn raise(&mut self, kind: AlarmKind, position: u64) {
        self.alarms.push(Alarm { at: self.now, position, kind, late: self.late });
    }

    fn is_xon(&self, byte: u8) -> bool {
        self.options.obey && byte == self.options.xon
    }

    fn is_xoff(&self, byte: u8) -> bool {
        self.options.obey && byte == self.options.xoff
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

/// One side's being told to stop: how often, how long, and what it sent then.
#[derive(Debug, Default)]
struct Hold {
    since: Option<Micros>,
    /// Time of the holds that have ended.
    ended: Micros,
    characters: Vec<u32>,
    current: u32,
}

impl Hold {
    /// A repeated XOFF changes nothing.
    fn begin(&mut self, at: Micros) {
        if self.since.is_none() {
            self.since = Some(at);
            self.current = 0;
        }
    }

    fn end(&mut self, at: Micros) {
        if let Some(since) = self.since.take() {
            self.ended = self.ended + (at - since);
            self.characters.push(self.current);
        }
    }

    /// A character ended: one that ended together with XOFF was not late.
    fn character(&mut self, at: Micros) {
        if self.since.is_some_and(|since| at > since) {
            self.current += 1;
        }
    }

    fn total(&self, now: Micros) -> Micros {
        self.ended + self.since.map_or(Micros::ZERO, |since| now - since)
    }

    fn count(&self) -> u32 {
        self.characters.len() as u32 + u32::from(self.since.is_some())
    }

    fn characters(&self) -> Counts {
        let mut counts = self.characters.clone();
        counts.extend(self.since.map(|_| self.current));
        Counts(counts)
    }
}
