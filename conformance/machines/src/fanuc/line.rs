//! What leaves the control and what reaches it, character by character.

use softplug_abi::{Micros, ModemLines};

use super::options::Interface;
use super::{Control, DC1, DC2, DC3, Mode, NAK, Role, SYN, Signal, Sort, tape};

impl Control {
    /// Codes go in front of messages, these in front of the tape.
    pub(super) fn feed_transmitter(&mut self) {
        if !self.uart.has_room() {
            return;
        }
        let now = self.now;
        let (role, byte) = if let Some((_, role)) = self.codes.pop_front_if(|(at, _)| *at <= now) {
            (role, self.code(role))
        } else if let Some(byte) = self.message.pop_front() {
            (Role::Message, byte)
        } else if let Some(byte) = self.next_of_tape() {
            (Role::Tape, byte)
        } else {
            return;
        };
        let taken = self.uart.push(now, byte & self.mask(), Sort::Data);
        debug_assert!(taken, "there was room");
        self.on_wire = role;
    }

    fn code(&self, role: Role) -> u8 {
        let code = match role {
            Role::Start => DC1,
            Role::AskPunch => DC2,
            Role::Hold | Role::Close => DC3,
            Role::Reset => SYN,
            Role::Alarm => NAK,
            Role::Tape | Role::Message => 0,
        };
        if self.options.codes_with_parity { tape::with_even_parity(code) } else { code }
    }

    pub(super) fn leave(&mut self, at: Micros) {
        let Some(left) = self.uart.poll(at) else { return };
        let mut signal = Signal::Character(left.byte);
        match self.on_wire {
            Role::Start => {
                self.counters.dc1s += 1;
                self.silent_since = at;
                self.hold.end(at);
                if let Mode::Reading(reading) = &mut self.mode {
                    reading.is_open = true;
                }
            }
            Role::Hold => {
                self.counters.dc3s += 1;
                if matches!(self.mode, Mode::Reading(_)) {
                    self.hold.begin(at);
                }
            }
            Role::Close => self.counters.dc3s += 1,
            Role::AskPunch => self.counters.punched += 1,
            Role::Tape => {
                signal = self.damaged(left.byte);
                self.tape_left(at);
            }
            Role::Reset | Role::Alarm | Role::Message => {}
        }
        self.signals.push_back((at, signal));
        if self.on_wire == Role::Tape {
            self.end_punch_if_out();
        }
    }

    pub(super) fn look_at_arrivals(&mut self, at: Micros) {
        while let Some(byte) = self.uart.serve(at) {
            match (&self.mode, self.options.interface) {
                (_, Interface::RemoteA) => self.hear(byte),
                (Mode::Idle, _) => self.counters.ignored += 1,
                (Mode::Reading(reading), _) if reading.is_open => self.read(byte),
                (Mode::Reading(_), _) => self.counters.before_dc1 += 1,
                (Mode::Punching(_), _) => self.obey(byte),
            }
        }
    }

    pub(super) fn show_ready(&mut self, is_on: bool) {
        let ready = ModemLines::DSR.union(ModemLines::DCD);
        self.show(ready, is_on);
    }

    pub(super) fn show(&mut self, lines: ModemLines, is_on: bool) {
        if self.options.modem_lines {
            let on = if is_on { lines } else { ModemLines::default() };
            self.signals.push_back((self.now, Signal::ModemLines { lines, on }));
        }
    }

    /// Seven data bits carry no eighth.
    pub(super) fn mask(&self) -> u8 {
        if self.options.line.data_bits < 8 { 0x7F } else { 0xFF }
    }
}
