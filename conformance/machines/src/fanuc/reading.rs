//! READ: what arrives, when the host is held, and how it ends.

use softplug_abi::Micros;

use super::options::Interface;
use super::reader::Finding;
use super::remote::Heard;
use super::{AlarmKind, Control, Mode, Press, Reading, Role};

impl Control {
    /// The reader is started.
    pub(super) fn start_reading(&mut self) {
        let now = self.now;
        self.reader.rewind();
        self.execution.begin();
        self.position = 0;
        let is_remote = self.options.interface == Interface::RemoteA;
        self.mode = Mode::Reading(Reading { is_open: is_remote, is_holding: false });
        if is_remote {
            self.remote.start(now);
        } else {
            self.send_code(now, Role::Start);
        }
    }

    /// A character's last bit came, whenever the software looks at it.
    pub(super) fn meet(&mut self, at: Micros) {
        let Mode::Reading(Reading { is_open: true, .. }) = self.mode else { return };
        self.silent_since = at;
        self.counters.arrived += 1;
        self.position += 1;
        let late = self.hold.character(at);
        let is_strict = self.options.interface == Interface::ReaderPunch;
        if is_strict && late > self.options.tolerance {
            self.raise(AlarmKind::BufferOverflow);
        }
    }

    /// A character of the tape.
    pub(super) fn read(&mut self, byte: u8) {
        let finding = self.reader.take(byte);
        let held = self.hold.total(self.now);
        match finding {
            Finding::Skipped => return,
            Finding::Text(_) | Finding::Block if self.execution.level() == self.options.buffer => {
                return self.raise(AlarmKind::BufferOverflow);
            }
            Finding::Text(character) => {
                self.execution.arrive();
                self.text.push(character);
            }
            Finding::Block => {
                self.execution.arrive();
                self.text.push(b'\n');
                self.execution.complete(self.now, held);
            }
            Finding::End => {
                self.text.push(b'%');
                self.execution.end(self.now, held);
                if self.options.interface != Interface::RemoteA {
                    self.end_reading();
                }
                return;
            }
            Finding::Alarm(kind) => return self.raise(kind),
        }
        self.decide_on_arrival();
    }

    fn decide_on_arrival(&mut self) {
        let free = self.options.buffer - self.execution.level();
        if free >= self.options.reserve {
            return;
        }
        let Mode::Reading(reading) = &mut self.mode else { return };
        if std::mem::replace(&mut reading.is_holding, true) {
            return;
        }
        // A block longer than the buffer would never be complete.
        self.execution.flush(self.now, self.hold.total(self.now));
        if self.options.interface != Interface::RemoteA {
            self.send_code(self.now, Role::Hold);
        }
        self.decide_on_draining();
    }

    pub(super) fn decide_on_draining(&mut self) {
        let free = self.options.buffer - self.execution.level();
        if free < self.options.resume {
            return;
        }
        let Mode::Reading(reading) = &mut self.mode else { return };
        if std::mem::replace(&mut reading.is_holding, false)
            && self.options.interface != Interface::RemoteA
        {
            self.send_code(self.now, Role::Start);
        }
    }

    /// When DC1 is repeated.
    pub(super) fn next_dc1(&self, reading: Reading) -> Option<Micros> {
        let span = self.options.repeat_dc1?;
        let is_silent = reading.is_open
            && !reading.is_holding
            && self.codes.is_empty()
            && self.uart.has_room()
            && self.options.interface != Interface::RemoteA;
        is_silent.then_some(self.silent_since + span)
    }

    /// The closing `%` was read.
    fn end_reading(&mut self) {
        self.counters.programs += 1;
        self.mode = Mode::Idle;
        self.hold.end(self.now);
        // What was still to be said of the buffer has no meaning any more.
        self.codes.clear();
        if let Some(delay) = self.options.final_dc3 {
            self.send_code(self.now + delay, Role::Close);
        }
    }

    /// RESET or an alarm in mid-reading.
    pub(super) fn break_reading(&mut self, press: &Press) {
        self.mode = Mode::Idle;
        self.hold.end(self.now);
        self.codes.clear();
        if self.options.interface == Interface::RemoteA {
            self.remote.tell(*press == Press::Alarm);
            return;
        }
        self.send_code(self.now, Role::Close);
        if self.options.tell_reset {
            let role = if *press == Press::Alarm { Role::Alarm } else { Role::Reset };
            self.codes.push_back((self.now, role));
        }
    }

    pub(super) fn send_code(&mut self, at: Micros, role: Role) {
        self.codes.push_back((at, role));
        if self.options.codes_twice {
            self.codes.push_back((at, role));
        }
    }

    /// A character of a message of protocol A.
    pub(super) fn hear(&mut self, byte: u8) {
        let (heard, answer) = self.remote.take(self.now, byte);
        self.message.extend(answer.into_iter().flatten());
        match heard {
            Heard::Nothing => {}
            Heard::Clear => self.execution.begin(),
            Heard::Data(data) => {
                for byte in data {
                    if matches!(self.mode, Mode::Reading(_)) {
                        self.read(byte);
                    }
                }
            }
            Heard::End => {
                if matches!(self.mode, Mode::Reading(_)) {
                    self.counters.programs += 1;
                    self.execution.end(self.now, self.hold.total(self.now));
                    self.mode = Mode::Idle;
                }
            }
        }
    }

    /// Whether the remote buffer has room for more data.
    pub(super) fn has_space(&self) -> bool {
        self.options.buffer - self.execution.level() > self.options.remote.space
    }
}
