//! Our side of the line: which characters have left.

use crate::model::Broken;
use crate::port::Port;

/// The port, and how many characters have left it.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    pub(super) port: Port,
    left: u64,
}

impl Wire {
    pub(super) fn new(depth: usize) -> Self {
        Self { port: Port::new(depth), left: 0 }
    }

    /// One of our control bytes passes what waits, and a hold. Returns which
    /// character of all that leave it will be.
    pub(super) fn say(&mut self, byte: u8) -> u64 {
        self.port.send_urgently(&[byte]);
        self.last_inside() + self.port.urgent() as u64
    }

    /// Which character of all that leave the last one is that the port holds.
    pub(super) fn last_inside(&self) -> u64 {
        self.left + self.port.inside() as u64
    }

    /// The last bit of a character has left. Returns which it was.
    pub(super) fn character_left(&mut self) -> u64 {
        self.port.left();
        self.left += 1;
        self.left
    }

    /// The instant is over.
    ///
    /// # Errors
    /// The wire is free and the next character has not begun.
    pub(super) fn settled(&mut self, clause: &'static str) -> Result<(), Broken> {
        self.port.settled(clause)
    }
}
