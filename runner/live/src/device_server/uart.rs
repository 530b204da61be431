//! The serial port of a simulated device server: characters take their time,
//! and its own flow control holds them.

use std::collections::VecDeque;

use rfc2217::{FlowControl, PortSettings};
use softplug_abi::{LineErrorKind, LineParameters, Micros, ModemLines};
use softplug_machines::{Partner, Signal};

use crate::port::rfc2217_values::line_of;

/// What a device server holds for its serial port.
pub(super) const TRANSMIT: usize = 1_024;
/// What it holds of what came; more is an overrun.
const RECEIVE: usize = 4_096;
const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// What the serial port has for the client.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    Byte(u8),
    Error(LineErrorKind),
    /// The inputs of the machine's, and those that are on.
    Lines(ModemLines, ModemLines),
}

#[derive(Debug)]
pub(super) struct Uart<P> {
    pub(super) partner: P,
    settings: PortSettings,
    line: LineParameters,
    queue: VecDeque<u8>,
    /// When the character in the shift register has left, and which it is.
    shifting: Option<(Micros, u8)>,
    /// From when on the next one could leave: the line was free, there was one,
    /// and nobody held it.
    free_since: Micros,
    /// The machine holds us, and the port obeys.
    is_held: bool,
    /// Inputs that the machine has taken away.
    off: ModemLines,
    heard: VecDeque<Heard>,
}

impl<P: Partner> Uart<P> {
    pub(super) fn new(partner: P, settings: PortSettings) -> Self {
        Self {
            partner,
            settings,
            line: line_of(settings),
            queue: VecDeque::new(),
            shifting: None,
            free_since: Micros(0),
            is_held: false,
            off: ModemLines::default(),
            heard: VecDeque::new(),
        }
    }

    /// The port as another client finds it: what was not sent is dropped, and
    /// nobody holds it. Its settings stay.
    pub(super) fn closed(self) -> Self {
        Self::new(self.partner, self.settings)
    }

    pub(super) fn settings(&self) -> PortSettings {
        self.settings
    }

    pub(super) fn set(&mut self, settings: PortSettings) {
        self.settings = settings;
        self.line = line_of(settings);
        self.hold(self.is_held && settings.flow_control == FlowControl::XonXoff);
    }

    /// Bytes that may be given to [`send`](Self::send).
    pub(super) fn room(&self) -> usize {
        TRANSMIT - self.queue.len()
    }

    pub(super) fn send(&mut self, now: Micros, bytes: &[u8]) {
        if self.queue.is_empty() {
            self.free_since = self.free_since.max(now);
        }
        self.queue.extend(bytes);
    }

    pub(super) fn purge_transmit(&mut self) {
        self.queue.clear();
    }

    pub(super) fn purge_receive(&mut self) {
        self.heard.clear();
    }

    pub(super) fn inject(&mut self, now: Micros, signal: Signal) {
        self.hear(now, signal);
    }

    pub(super) fn next_heard(&self) -> Option<Heard> {
        self.heard.front().copied()
    }

    pub(super) fn take_heard(&mut self) {
        self.heard.pop_front();
    }

    /// Does what is due.
    pub(super) fn turn(&mut self, now: Micros) {
        while let Some((at, byte)) = self.next_character() {
            if at > now {
                self.shifting = Some((at, byte));
                break;
            }
            self.free_since = at;
            self.partner.advance(at);
            self.partner.receive(at, byte);
            self.listen(at);
        }
        self.partner.advance(now);
        self.listen(now);
    }

    /// When [`turn`](Self::turn) has something to do.
    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        let leaves = self.shifting.map(|(at, _)| at);
        [leaves, self.partner.next_event()].into_iter().flatten().min()
    }

    /// The character in the shift register, or the next one put there.
    fn next_character(&mut self) -> Option<(Micros, u8)> {
        if let Some(shifting) = self.shifting.take() {
            return Some(shifting);
        }
        if self.is_held {
            return None;
        }
        let byte = self.queue.pop_front()?;
        Some((self.free_since + self.line.characters(1), byte))
    }

    fn listen(&mut self, now: Micros) {
        while let Some(signal) = self.partner.poll_signal(now) {
            self.hear(now, signal);
        }
    }

    fn hear(&mut self, now: Micros, signal: Signal) {
        match signal {
            Signal::Character(byte @ (XON | XOFF))
                if self.settings.flow_control == FlowControl::XonXoff =>
            {
                self.is_held = byte == XOFF;
                self.free_since = self.free_since.max(now);
            }
            Signal::Character(byte) => self.keep(Heard::Byte(byte)),
            Signal::LineError { kind, byte } => {
                if let Some(byte) = byte {
                    self.keep(Heard::Byte(byte));
                }
                self.keep(Heard::Error(kind));
            }
            Signal::ModemLines { lines, on } => {
                self.off = ModemLines((self.off.0 & !lines.0) | (lines.0 & !on.0));
                self.free_since = self.free_since.max(now);
                self.hold(self.is_held && self.settings.flow_control == FlowControl::XonXoff);
                self.keep(Heard::Lines(lines, on));
            }
        }
    }

    /// Held by XOFF, or by the line that the port obeys.
    fn hold(&mut self, by_code: bool) {
        self.is_held = match self.settings.flow_control {
            FlowControl::RtsCts => self.off.contains(ModemLines::CTS),
            FlowControl::Dsr => self.off.contains(ModemLines::DSR),
            FlowControl::Dcd => self.off.contains(ModemLines::DCD),
            FlowControl::None | FlowControl::XonXoff => by_code,
        };
    }

    fn keep(&mut self, heard: Heard) {
        match self.heard.len() {
            ..RECEIVE => self.heard.push_back(heard),
            RECEIVE => self.heard.push_back(Heard::Error(LineErrorKind::Overrun)),
            _ => {}
        }
    }
}
