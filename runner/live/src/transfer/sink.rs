//! Where what a machine sends goes.

use std::io::{self, Write};

/// Takes what a machine sends, and is told when that is whole.
pub trait Sink: Write {
    /// All has come: puts it where it belongs. The partner is told only then that it has arrived, so
    /// it must be on the disk, under its name, when this returns.
    ///
    /// # Errors
    /// It cannot be put there: the partner is not told.
    fn complete(&mut self) -> io::Result<()> {
        self.flush()
    }
}

impl Sink for Vec<u8> {}

impl Sink for io::Sink {}
