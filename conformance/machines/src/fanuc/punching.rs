//! PUNCH at the line: the host's stops, damage on the way, the end.

use softplug_abi::{LineErrorKind, Micros, ModemLines};

use super::options::{Code, Parity};
use super::punch::Punch;
use super::tape::Tape;
use super::{Control, DC1, DC2, DC3, Mode, Press, Role, Signal};

impl Control {
    /// The punch is started; READ follows if the tape asks for a program.
    pub(super) fn start_punching(&mut self, program: &[u8], then_read: bool) {
        let now = self.now;
        let mut punch = Punch::new(&self.options, &Tape::new(&self.options), program);
        punch.then_read = then_read;
        punch.asks_at = self.options.punch.wait_dc1.map(|wait| now + wait);
        self.position = 0;
        // What the host said before does not stop this punch.
        self.stopped.end();
        self.show(ModemLines::CTS, true);
        if self.options.punch.dc2 {
            self.codes.push_back((now, Role::AskPunch));
        }
        self.mode = Mode::Punching(punch);
    }

    /// The next character of the tape, if it may leave.
    pub(super) fn next_of_tape(&mut self) -> Option<u8> {
        let Mode::Punching(punch) = &mut self.mode else { return None };
        if punch.asks_at.is_some() {
            return None;
        }
        let is_stopped = self.stopped.is_on() || self.not_clear.is_on();
        if is_stopped && self.allowance == 0 {
            return None;
        }
        let byte = punch.next()?;
        if is_stopped {
            self.allowance -= 1;
        }
        Some(byte)
    }

    /// What becomes of the character on its way to the host.
    pub(super) fn damaged(&self, byte: u8) -> Signal {
        let damage = &self.options.punch.damage;
        let Ok(at) = damage.binary_search_by_key(&self.position, |(place, _)| *place) else {
            return Signal::Character(byte);
        };
        let in_software = self.options.code == Code::Iso && self.options.parity == Parity::Software;
        match damage[at].1 {
            LineErrorKind::Parity if in_software => Signal::Character(byte ^ 0x80),
            kind @ (LineErrorKind::Break | LineErrorKind::Overrun) => {
                Signal::LineError { kind, byte: None }
            }
            kind => Signal::LineError { kind, byte: Some(byte) },
        }
    }

    /// A character of the tape has left.
    pub(super) fn tape_left(&mut self, at: Micros) {
        self.counters.punched += 1;
        self.position += 1;
        self.stopped.character(at);
        self.not_clear.character(at);
    }

    pub(super) fn end_punch_if_out(&mut self) {
        let now = self.now;
        let Mode::Punching(punch) = &self.mode else { return };
        if !punch.is_out() || !self.uart.has_room() {
            return;
        }
        let (verdict, then_read) = (punch.verdict, punch.then_read);
        self.mode = Mode::Idle;
        self.counters.punches += 1;
        self.show(ModemLines::CTS, false);
        if let Some(role) = verdict {
            self.codes.push_back((now + self.options.punch.tell_after, role));
        }
        if then_read {
            self.do_press(Press::Read);
        }
    }

    /// RESET or an alarm in mid-punch.
    pub(super) fn break_punch(&mut self, press: &Press) {
        if let Mode::Punching(punch) = &mut self.mode {
            let role = if *press == Press::Alarm { Role::Alarm } else { Role::Reset };
            punch.break_off(&self.options, role);
            // The stop was for the data.
            self.stopped.end();
            self.end_punch_if_out();
        }
    }

    /// A code of the host while the control punches.
    pub(super) fn obey(&mut self, byte: u8) {
        let Mode::Punching(punch) = &mut self.mode else { return };
        let resume = if self.options.punch.resume_on_dc2 { DC2 } else { DC1 };
        match byte & 0x7F {
            DC1 if punch.asks_at.is_some() => punch.asks_at = None,
            DC3 => {
                let most = self.options.punch.after_dc3;
                if self.stopped.begin(self.now) {
                    self.limit(most, self.not_clear.is_on());
                }
            }
            code if code == resume => self.stopped.end(),
            // The answer to DC2, where the punch does not wait for it.
            DC1 => {}
            _ => self.counters.ignored += 1,
        }
    }

    /// The host has set RTS (our CS) or DTR (our DR).
    pub(super) fn see_modem_lines(&mut self, lines: ModemLines, on: ModemLines) {
        if !self.options.modem_lines {
            return;
        }
        if lines.contains(ModemLines::RTS) {
            if on.contains(ModemLines::RTS) {
                self.not_clear.end();
            } else if self.not_clear.begin(self.now) {
                self.limit(self.options.punch.after_cs, self.stopped.is_on());
            }
        }
        if lines.contains(ModemLines::DTR) && !on.contains(ModemLines::DTR) {
            self.raise(super::AlarmKind::NotReady);
        }
    }

    /// So many more characters may leave, the one on the wire included.
    fn limit(&mut self, most: u32, is_limited: bool) {
        let on_wire = !self.uart.has_room() && self.on_wire == Role::Tape;
        let most = most.saturating_sub(u32::from(on_wire));
        self.allowance = if is_limited { self.allowance.min(most) } else { most };
    }
}
