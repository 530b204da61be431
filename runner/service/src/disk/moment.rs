//! Whether somebody writes to a file while it is read.

use std::fs::File;
use std::io;
use std::time::SystemTime;

/// What changes when somebody writes to a file.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Moment {
    /// Bytes.
    pub size: u64,
    modified: Option<SystemTime>,
}

impl Moment {
    /// A file as it is now.
    ///
    /// # Errors
    /// The disk does not say.
    pub fn of(file: &File) -> io::Result<Self> {
        let found = file.metadata()?;
        Ok(Self { size: found.len(), modified: found.modified().ok() })
    }
}
