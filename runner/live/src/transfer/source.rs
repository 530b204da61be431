//! Where the data of a job comes from.

use softplug_link::Supply;
use std::io::{self, Read, Seek, SeekFrom};

/// What a program can be read from, twice if it is checked.
pub trait ReadSeek: Read + Seek {}

impl<T: Read + Seek> ReadSeek for T {}

/// A source and how far it has been read.
#[derive(Debug)]
pub(super) struct Source<S> {
    from: S,
    /// Bytes given to the plug-in since the beginning or the last rewind.
    pub(super) supplied: u64,
    /// Why it cannot be read on.
    pub(super) error: Option<io::Error>,
}

impl<S: Read + Seek> Source<S> {
    pub(super) fn new(from: S) -> Self {
        Self { from, supplied: 0, error: None }
    }

    /// The next bytes. Never an end where there is an error: it would pass for
    /// the program's.
    pub(super) fn supply(&mut self, buffer: &mut [u8]) -> Supply {
        if self.error.is_some() {
            return Supply::Later;
        }
        loop {
            match self.from.read(buffer) {
                Ok(0) => return Supply::End,
                Ok(count) => {
                    self.supplied += count as u64;
                    return Supply::Bytes(count);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    self.error = Some(error);
                    return Supply::Later;
                }
            }
        }
    }

    pub(super) fn rewind(&mut self) {
        self.supplied = 0;
        if let Err(error) = self.from.seek(SeekFrom::Start(0)) {
            self.error = Some(error);
        }
    }
}
