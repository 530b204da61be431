//! What a station has to say, in order, with pauses and breaks in between.

use std::collections::VecDeque;

use softplug_abi::{LineErrorKind, LineParameters, Micros};

use crate::Signal;
use crate::uart::{Sort, Uart, UartOptions};

/// What a character is for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Role {
    /// Our STX.
    Start,
    /// DLE for the other side's STX.
    Answer,
    /// DLE for a good block, by its place among those received.
    Acknowledgement(usize),
    /// NAK.
    Nak,
    /// A character of our block.
    Block,
    /// The last one of it.
    BlockEnd,
    /// Something that the procedure does not know.
    Stray,
}

/// Something to be sent.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Item {
    Character(u8, Role),
    /// Nothing for so long.
    Pause(Micros),
    /// A break of so long.
    Break(Micros),
}

/// A transmitter without FIFO, so that what was stopped leaves no more than one
/// character.
#[derive(Debug)]
pub(super) struct Transmitter {
    uart: Uart,
    waiting: VecDeque<Item>,
    /// The character in the UART.
    in_uart: Option<Role>,
    /// A pause or break until then.
    busy: Option<(Micros, bool)>,
    left: VecDeque<(Micros, Signal)>,
}

impl Transmitter {
    pub(super) fn new(line: LineParameters) -> Self {
        let (transmit_fifo, receive_fifo, latency) = (1, 1, Micros::ZERO);
        Self {
            uart: Uart::new(UartOptions { line, transmit_fifo, receive_fifo, latency }),
            waiting: VecDeque::new(),
            in_uart: None,
            busy: None,
            left: VecDeque::new(),
        }
    }

    pub(super) fn push(&mut self, item: Item) {
        self.waiting.push_back(item);
    }

    /// Says nothing more than what the UART already has.
    pub(super) fn stop(&mut self) {
        self.waiting.clear();
    }

    /// Whether one of this role has not left.
    pub(super) fn holds(&self, role: Role) -> bool {
        let is_waiting = |item: &Item| matches!(item, Item::Character(_, of) if *of == role);
        self.in_uart == Some(role) || self.waiting.iter().any(is_waiting)
    }

    /// Whether all has left.
    pub(super) fn is_silent(&self) -> bool {
        self.in_uart.is_none() && self.waiting.is_empty() && self.busy.is_none()
    }

    /// Begins what can begin now.
    pub(super) fn feed(&mut self, now: Micros) {
        while self.in_uart.is_none() && self.busy.is_none() {
            match self.waiting.pop_front() {
                None => return,
                Some(Item::Character(byte, role)) => {
                    let taken = self.uart.push(now, byte, Sort::Data);
                    debug_assert!(taken, "the UART is empty");
                    self.in_uart = Some(role);
                }
                Some(Item::Pause(span)) => self.busy = Some((now + span, false)),
                Some(Item::Break(span)) => self.busy = Some((now + span, true)),
            }
        }
    }

    /// When the next thing has left or passed.
    pub(super) fn next(&self) -> Option<Micros> {
        self.uart.next_left().or(self.busy.map(|(until, _)| until))
    }

    /// Does what [`next`](Self::next) announced for this time; the character
    /// that left.
    pub(super) fn advance(&mut self, at: Micros) -> Option<Role> {
        if let Some(left) = self.uart.poll(at) {
            self.left.push_back((left.at, Signal::Character(left.byte)));
            return self.in_uart.take();
        }
        if self.busy.take().is_some_and(|(_, is_break)| is_break) {
            let signal = Signal::LineError { kind: LineErrorKind::Break, byte: None };
            self.left.push_back((at, signal));
        }
        None
    }

    /// The character that has left by now.
    pub(super) fn leave(&mut self, now: Micros) -> Option<Role> {
        self.uart.next_left().filter(|at| *at <= now)?;
        self.advance(now)
    }

    /// When the next signal that has left can be taken.
    pub(super) fn next_signal(&self) -> Option<Micros> {
        self.left.front().map(|(at, _)| *at)
    }

    pub(super) fn poll(&mut self, now: Micros) -> Option<Signal> {
        self.left.pop_front_if(|(at, _)| *at <= now).map(|(_, signal)| signal)
    }
}
