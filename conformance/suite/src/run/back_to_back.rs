//! Characters that follow each other at once on a line.

use softplug_abi::{LineParameters, Micros};

/// Characters that leave back to back, counted from the first so that
/// roundings do not add up.
pub(crate) struct Run {
    start: Micros,
    length: u64,
    line: LineParameters,
}

impl Run {
    pub(crate) fn new(line: LineParameters) -> Self {
        Self { start: Micros::ZERO, length: 0, line }
    }

    /// When the next character begins if it follows at once.
    pub(crate) fn end(&self) -> Micros {
        self.start + self.line.characters(self.length)
    }

    /// Takes a character; returns whether it follows the run at once.
    pub(crate) fn add(&mut self, at: Micros) -> bool {
        let follows = self.length > 0 && at == self.end();
        if !follows {
            self.start = at;
            self.length = 0;
        }
        self.length += 1;
        follows
    }
}
