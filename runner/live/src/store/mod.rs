//! Folders for what machines send and for what they may ask for. Names come
//! from the line and are never used as paths.

mod copying;
mod inbox;
mod names;
mod partial;
mod shelf;
mod writers;

pub use copying::{FileState, copy_at_one_moment};
pub use inbox::{Inbox, Kept, Mark};
pub use names::{numbered, safe_name};
pub use partial::PartialFile;
pub use shelf::Shelf;
pub use writers::is_open_for_writing;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// The first name of `names` that is not taken, by `take`, which never overwrites.
fn first_free(
    names: impl IntoIterator<Item = PathBuf>,
    mut take: impl FnMut(&Path) -> io::Result<()>,
) -> io::Result<PathBuf> {
    for name in names {
        match take(&name) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            taken => return taken.map(|()| name),
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
