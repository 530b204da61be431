//! Folders for what machines send and for what they may ask for. Names come
//! from the line and are never used as paths.

mod copying;
mod inbox;
mod names;
mod shelf;
mod writers;

pub use copying::{FileState, copy_at_one_moment};
pub use inbox::{Inbox, Kept, Mark};
pub use names::{numbered, safe_name};
pub use shelf::Shelf;
pub use writers::is_open_for_writing;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Renames `from` to the first name of `names` that is not taken, and tells
/// which. Never overwrites, also if the name came up meanwhile.
pub fn rename_to_free(
    from: &Path,
    names: impl IntoIterator<Item = PathBuf>,
) -> io::Result<PathBuf> {
    for to in names {
        match rename_to_new(from, &to) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            renamed => return renamed.map(|()| to),
        }
    }
    Err(io::Error::new(io::ErrorKind::AlreadyExists, "every name is taken"))
}

/// A rename that never overwrites, also if the name came up meanwhile.
pub fn rename_to_new(from: &Path, to: &Path) -> io::Result<()> {
    match fs::hard_link(from, to) {
        Ok(()) => fs::remove_file(from),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(error),
        // Some file systems have no links.
        Err(_) if fs::symlink_metadata(to).is_err() => fs::rename(from, to),
        Err(_) => Err(io::ErrorKind::AlreadyExists.into()),
    }
}

/// On Unix a new name is only on the disk once its folder is.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}
