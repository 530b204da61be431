//! The operator's panel.

use super::{Control, Interface, Mode, Press};

impl Control {
    /// Which of what the operator still has to do comes next: who wants to read or punch
    /// waits until the control is free.
    pub(super) fn next_press(&self) -> Option<usize> {
        let is_idle = matches!(self.mode, Mode::Idle);
        self.panel.iter().position(|(_, press)| is_idle || !press.needs_free_control())
    }

    /// A control that is busy takes nothing but RESET, alarms and its switch.
    pub(super) fn do_press(&mut self, press: Press) {
        let is_idle = matches!(self.mode, Mode::Idle);
        match press {
            Press::Read if is_idle => self.start_reading(),
            Press::Punch(program) if is_idle && self.has_punch() => {
                self.start_punching(&program, false);
            }
            Press::Request(name) if is_idle && self.has_punch() => {
                let number = self.options.request_program;
                let program = format!("O{number:04}\n(SEND {name})\n");
                self.start_punching(program.as_bytes(), true);
            }
            Press::Read | Press::Punch(_) | Press::Request(_) => {}
            Press::Reset | Press::Alarm => self.break_off(&press),
            Press::Off => {
                self.mode = Mode::Idle;
                self.hold.end(self.now);
                self.execution.clear();
                self.codes.clear();
                self.message.clear();
                self.remote.switch_off();
                self.show_ready(false);
            }
            Press::On => self.show_ready(true),
        }
    }

    /// Whatever goes on ends here.
    pub(super) fn break_off(&mut self, press: &Press) {
        self.execution.clear();
        match self.mode {
            Mode::Idle if self.options.interface == Interface::RemoteA => {
                self.remote.tell(*press == Press::Alarm);
            }
            Mode::Idle => {}
            Mode::Reading(_) => self.break_reading(press),
            Mode::Punching(_) => self.break_punch(press),
        }
    }

    /// Protocol A carries programs one way only.
    fn has_punch(&self) -> bool {
        self.options.interface != Interface::RemoteA
    }
}
