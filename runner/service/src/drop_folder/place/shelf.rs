//! How a file is put away: it or its result is never there without the other, nothing is
//! overwritten, and what was broken off is done again.

use std::ffi::{OsStr, OsString};
use std::io::{self, Read as _};
use std::os::fd::{AsFd as _, OwnedFd};

use rustix::fs::{AtFlags, renameat, statat, unlinkat};
use rustix::io::Errno;

use super::{AWAY, Place, below, child, read, rename_to_new, sync, write_new};
use crate::drop_folder::names::put_away;

/// Where a file is put when all is over.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(in crate::drop_folder) enum Shelf {
    Done,
    Failed,
}

impl Shelf {
    pub(in crate::drop_folder) const fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
        }
    }

    /// Whether one is called so.
    pub(super) fn is_name(name: &OsStr) -> bool {
        [Self::Done, Self::Failed].into_iter().any(|shelf| name == shelf.name())
    }
}

impl Place {
    /// Puts the file of a claim away, with a result beside it, and gives the name that it has then.
    /// Broken off anywhere, it can be done again with the same text. The claim is still to be
    /// [forgotten](Self::forget).
    pub(in crate::drop_folder) fn put_away(
        &self,
        claim: &str,
        shelf: Shelf,
        name: &OsStr,
        tag: &str,
        text: &str,
    ) -> io::Result<OsString> {
        let from = child(self.work.as_fd(), claim)?;
        self.shelve(claim, shelf, text, |to, new| place(&from, to, new, (name, tag, text)))
    }

    /// Puts the result alone there, as the file is gone, and gives the name of the result.
    pub(in crate::drop_folder) fn put_result(
        &self,
        claim: &str,
        shelf: Shelf,
        name: &OsStr,
        tag: &str,
        text: &str,
    ) -> io::Result<OsString> {
        self.shelve(claim, shelf, text, |to, new| place_alone(to, new, (name, tag, text)))
    }

    /// Writes the result, hidden until all of it is there, and has it placed.
    fn shelve(
        &self,
        claim: &str,
        shelf: Shelf,
        text: &str,
        place: impl FnOnce(&OwnedFd, &OsStr) -> io::Result<OsString>,
    ) -> io::Result<OsString> {
        let to = below(self.folder.as_fd(), shelf.name())?;
        let new = OsString::from(format!(".{claim}"));
        let written = write_new(&to, &new, text);
        let placed = written.and_then(|()| place(&to, &new));
        if placed.is_err() {
            let _ = unlinkat(&to, &*new, AtFlags::empty());
        }
        let placed = placed?;
        sync(&to);
        Ok(placed)
    }
}

/// Result first, then the file: a name whose result is there is this one's or taken.
fn place(
    from: &OwnedFd,
    to: &OwnedFd,
    new: &OsStr,
    (name, tag, text): (&OsStr, &str, &str),
) -> io::Result<OsString> {
    let mut last = Errno::EXIST;
    for (file, result) in put_away(name, tag) {
        match place_result(to, new, (&file, &result), text) {
            Ok(()) => {}
            Err(error @ (Errno::EXIST | Errno::NAMETOOLONG)) => {
                last = error;
                continue;
            }
            Err(error) => return Err(error.into()),
        }
        sync(to);
        write_new(from, OsStr::new(AWAY), "")?;
        match rename_to_new(from, name, to, &file) {
            Ok(()) => return Ok(file),
            Err(error @ (Errno::EXIST | Errno::NAMETOOLONG)) => {
                last = error;
                renameat(to, &*result, to, new)?;
            }
            Err(error) => {
                let _ = renameat(to, &*result, to, new);
                return Err(error.into());
            }
        }
    }
    Err(last.into())
}

/// The result of a file that is gone.
fn place_alone(
    to: &OwnedFd,
    new: &OsStr,
    (name, tag, text): (&OsStr, &str, &str),
) -> io::Result<OsString> {
    let mut last = Errno::EXIST;
    for (file, result) in put_away(name, tag) {
        match place_result(to, new, (&file, &result), text) {
            Ok(()) => return Ok(result),
            Err(error @ (Errno::EXIST | Errno::NAMETOOLONG)) => last = error,
            Err(error) => return Err(error.into()),
        }
    }
    Err(last.into())
}

/// Gives the result its name, unless there is such a file or another's result.
fn place_result(
    to: &OwnedFd,
    new: &OsStr,
    (file, result): (&OsStr, &OsStr),
    text: &str,
) -> Result<(), Errno> {
    if statat(to, file, AtFlags::SYMLINK_NOFOLLOW).is_ok() {
        return Err(Errno::EXIST);
    }
    match rename_to_new(to, new, to, result) {
        // Written before a gateway was killed.
        Err(Errno::EXIST) if has_text(to, result, text) => unlinkat(to, new, AtFlags::empty()),
        placed => placed,
    }
}

fn has_text(folder: &OwnedFd, name: &OsStr, text: &str) -> bool {
    let Ok(file) = read(folder.as_fd(), name) else { return false };
    let mut found = Vec::new();
    let most = text.len() as u64 + 1;
    file.take(most).read_to_end(&mut found).is_ok() && found == text.as_bytes()
}
