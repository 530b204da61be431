//! Our side of the line: which characters have left.

use crate::model::Broken;
use crate::port::Port;
use std::collections::BTreeSet;

/// The port, and the numbers of the characters that left it and will.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    pub(super) port: Port,
    /// Characters that have left.
    left: u64,
    /// Numbers of control codes of ours that have still to leave.
    codes: BTreeSet<u64>,
}

impl Wire {
    pub(super) fn new(depth: usize) -> Self {
        Self { port: Port::new(depth), left: 0, codes: BTreeSet::new() }
    }

    /// A control code of ours passes what waits, and a hold. Returns its number.
    pub(super) fn say(&mut self, code: u8) -> u64 {
        self.port.send_urgently(&[code]);
        let number = self.last_inside() + self.port.urgent() as u64;
        self.codes.insert(number);
        number
    }

    /// Number of the last character that the port holds.
    pub(super) fn last_inside(&self) -> u64 {
        self.left + self.port.inside() as u64
    }

    /// The last bit of a character has left: its number, and whether it was a
    /// control code of ours.
    pub(super) fn character_left(&mut self) -> (u64, bool) {
        self.port.left();
        self.left += 1;
        (self.left, self.codes.remove(&self.left))
    }

    /// All that waits is dropped, as closing does.
    pub(super) fn clear(&mut self) {
        self.port.clear();
        let last = self.last_inside();
        self.codes.retain(|number| *number <= last);
    }

    /// The instant is over.
    ///
    /// # Errors
    /// The wire is free and the next character has not begun.
    pub(super) fn settled(&mut self, clause: &'static str) -> Result<(), Broken> {
        self.port.settled(clause)
    }
}
