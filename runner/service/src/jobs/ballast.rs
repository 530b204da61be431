//! A file that is there only to be removed when the disk is full, so that what is
//! under way can still be written down.

use std::fs;
use std::path::PathBuf;

use crate::disk::{self, DiskError};

/// Room for the endings of some thousand jobs.
const BYTES: usize = 1 << 20;

#[derive(Debug)]
pub(super) struct Ballast {
    path: PathBuf,
}

impl Ballast {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path }
    }

    /// Makes it, if it is not there.
    pub(super) fn load(&self) -> Result<(), DiskError> {
        let is_there =
            fs::metadata(&self.path).is_ok_and(|metadata| metadata.len() == BYTES as u64);
        // Not of zeros: some file systems would not give them room.
        if is_there { Ok(()) } else { disk::write_whole(&self.path, &vec![0xa5; BYTES]) }
    }

    /// Gives its room away; `false` if there is none to give.
    pub(super) fn drop_it(&self) -> bool {
        disk::remove(&self.path).is_ok()
    }
}
