//! What we tell the machine as a receiver: XOFF and XON.

use super::rules::{Control, Rules};
use super::wire::Wire;
use softplug_abi::Micros;

/// Which of the two the machine was told last, and which have still to leave.
#[derive(Clone, Debug, Default)]
pub(super) struct Speaker {
    /// The machine was told to stop, or will be as soon as it can be told.
    is_stopped: bool,
    /// Characters that came later than the last XOFF.
    in_spite: usize,
    /// When that one was said.
    said: Micros,
    /// When XON is repeated.
    repeat: Option<Micros>,
    /// A control byte that has still to leave: which of all characters it is, and
    /// what it says.
    to_leave: Option<(u64, Control)>,
}

impl Speaker {
    /// The machine was told to stop.
    pub(super) fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// When XON is repeated.
    pub(super) fn deadline(&self) -> Option<Micros> {
        self.repeat
    }

    /// The machine has to stop.
    pub(super) fn stop(&mut self, at: Micros, rules: &Rules, wire: &mut Wire) {
        (self.is_stopped, self.in_spite, self.repeat, self.said) = (true, 0, None, at);
        self.say(Control::Xoff, rules, wire);
    }

    /// The machine may go on.
    pub(super) fn go(&mut self, rules: &Rules, wire: &mut Wire) {
        (self.is_stopped, self.repeat) = (false, None);
        self.say(Control::Xon, rules, wire);
    }

    /// So many characters came at one time though the machine was told to stop.
    pub(super) fn came_in_spite(
        &mut self,
        at: Micros,
        count: usize,
        rules: &Rules,
        wire: &mut Wire,
    ) {
        if at > self.said {
            self.in_spite += count;
        }
        if rules.xoff_repeat > 0 && self.in_spite >= rules.xoff_repeat {
            self.stop(at, rules, wire);
        }
    }

    /// XON is said again after so long a silence.
    pub(super) fn repeat_from(&mut self, at: Micros, rules: &Rules) {
        self.repeat = rules.xon_repeat.map(|span| at + span);
    }

    /// Something has come: XON was heard.
    pub(super) fn was_heard(&mut self) {
        self.repeat = None;
    }

    /// XON is due again, if it is.
    pub(super) fn due(&mut self, at: Micros, rules: &Rules, wire: &mut Wire) {
        if self.repeat.is_some_and(|repeat| repeat <= at) {
            self.say(Control::Xon, rules, wire);
            self.repeat_from(at, rules);
        }
    }

    /// A character has left. What the machine was to be told in the meantime follows
    /// now, if it is another thing.
    pub(super) fn left(&mut self, number: u64, rules: &Rules, wire: &mut Wire) {
        // Where the port holds more than one character, it may have taken some that waited.
        if let Some((_, said)) = self.to_leave.take_if(|(which, _)| *which == number) {
            let wanted = if self.is_stopped { Control::Xoff } else { Control::Xon };
            if said != wanted {
                self.say(wanted, rules, wire);
            }
        }
    }

    /// One of ours has to leave before the next: a repeat is left out meanwhile.
    fn say(&mut self, control: Control, rules: &Rules, wire: &mut Wire) {
        if self.to_leave.is_none() {
            let byte = match control {
                Control::Xon => rules.xon,
                Control::Xoff => rules.xoff,
            };
            self.to_leave = Some((wire.say(byte), control));
        }
    }
}
