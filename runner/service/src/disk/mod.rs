//! Files that are whole or not there: written under a temporary name, brought
//! onto the disk, renamed, and their folder brought onto the disk too.

pub mod digest_text;
mod moment;
mod objects;

pub use moment::Moment;
pub use objects::{Object, Objects, copy};

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use softplug_live::store::sync_folder;
use tempfile::NamedTempFile;
use thiserror::Error;

/// What the disk would not do.
#[derive(Debug, Error)]
#[error("cannot {what} {}: {source}{}", path.display(), advice(source))]
pub struct DiskError {
    /// What was tried.
    pub what: &'static str,
    /// With which file or folder.
    pub path: PathBuf,
    /// Why not.
    pub source: io::Error,
}

impl DiskError {
    /// For `map_err`: what was tried, with what.
    pub fn when<'a>(what: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> Self + 'a {
        move |source| Self { what, path: path.to_owned(), source }
    }

    /// There was no room for it.
    pub fn is_full(&self) -> bool {
        is_full(&self.source)
    }

    /// There is no such file or folder.
    pub fn is_missing(&self) -> bool {
        self.source.kind() == io::ErrorKind::NotFound
    }
}

/// The disk, the quota or the longest file allowed is used up.
pub fn is_full(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}

fn advice(error: &io::Error) -> &'static str {
    if is_full(error) { "; make room on the disk" } else { "" }
}

/// Makes a folder, and those above it, so that they are there after a loss of power.
///
/// # Errors
/// It cannot be made.
pub fn make_folder(folder: &Path) -> Result<(), DiskError> {
    if folder.is_dir() {
        return Ok(());
    }
    if let Some(above) = folder.parent().filter(|above| !above.as_os_str().is_empty()) {
        make_folder(above)?;
    }
    match fs::create_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists && folder.is_dir() => Ok(()),
        made => made.and_then(|()| sync_above(folder)),
    }
    .map_err(DiskError::when("make the folder", folder))
}

/// Puts `bytes` in place of the file, whole or not at all.
///
/// # Errors
/// They cannot be written; the file is as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), DiskError> {
    let written = temporary_beside(path).and_then(|mut file| {
        file.as_file_mut().write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(path)?;
        sync_above(path)
    });
    written.map_err(DiskError::when("write", path))
}

/// Removes a file for good.
///
/// # Errors
/// It cannot be removed, or is not there.
pub fn remove(path: &Path) -> Result<(), DiskError> {
    fs::remove_file(path).and_then(|()| sync_above(path)).map_err(DiskError::when("remove", path))
}

/// Opens a file for reading. A pipe that nobody writes into is not waited for, nor is a device
/// touched further: only a file is opened.
///
/// # Errors
/// It cannot be opened, or is no file.
pub fn open(path: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt as _;
    let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
    let file = fs::OpenOptions::new().read(true).custom_flags(flags.bits() as i32).open(path)?;
    // Of the open file, not of the path: nothing can come between.
    if file.metadata()?.is_file() { Ok(file) } else { Err(io::Error::other("it is no file")) }
}

/// A small file, of which more than `most` bytes are an error.
///
/// # Errors
/// It cannot be read, or is larger.
pub fn read_small(path: &Path, most: usize) -> Result<Vec<u8>, DiskError> {
    let read = || {
        let mut bytes = Vec::new();
        open(path)?.take(most as u64 + 1).read_to_end(&mut bytes)?;
        if bytes.len() > most {
            return Err(io::Error::other(format!("it has more than {most} bytes")));
        }
        Ok(bytes)
    };
    read().map_err(DiskError::when("read", path))
}

/// Names of the files or folders in a folder, sorted, hidden ones and those that are no
/// UTF-8 left out.
///
/// # Errors
/// The folder cannot be read.
pub fn names_in(folder: &Path) -> Result<Vec<String>, DiskError> {
    let read = || {
        let mut names = Vec::new();
        for entry in fs::read_dir(folder)? {
            if let Ok(name) = entry?.file_name().into_string()
                && !name.starts_with('.')
            {
                names.push(name);
            }
        }
        names.sort_unstable();
        Ok(names)
    };
    read().map_err(DiskError::when("read the folder", folder))
}

/// Temporary files begin with this: hidden, and known for what they are.
const TEMPORARY: &str = ".new-";

/// Removes what writers left behind that were killed. Only for whoever has the folder to
/// himself.
pub(crate) fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let is_left = entry.file_name().to_str().is_some_and(|name| name.starts_with(TEMPORARY));
        if is_left && let Err(error) = fs::remove_file(entry.path()) {
            tracing::warn!(file = %entry.path().display(), %error, "a left-over file stays");
        }
    }
}

pub(crate) fn temporary_beside(path: &Path) -> io::Result<NamedTempFile> {
    temporary_in(above(path))
}

/// Written through `as_file_mut`: its own errors have its name, which says nothing to anybody and is
/// another one each time.
fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let made = tempfile::Builder::new().prefix(TEMPORARY).tempfile_in(folder);
    made.map_err(|error| error.kind().into())
}

fn above(path: &Path) -> &Path {
    path.parent().filter(|above| !above.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn sync_above(path: &Path) -> io::Result<()> {
    sync_folder(above(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/c");
        make_folder(path.parent().unwrap()).unwrap();
        write_whole(&path, b"one").unwrap();
        write_whole(&path, b"two").unwrap();
        assert_eq!(read_small(&path, 3).unwrap(), b"two");
        assert!(read_small(&path, 2).unwrap_err().to_string().contains("more than 2 bytes"));
        fs::write(folder.path().join("a/b/.new-x"), "left").unwrap();
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 2);
        sweep(path.parent().unwrap());
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        assert_eq!(names_in(path.parent().unwrap()).unwrap(), ["c"]);
        remove(&path).unwrap();
        assert!(remove(&path).unwrap_err().is_missing());
    }

    #[test]
    fn a_pipe_that_nobody_writes_into_is_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status().unwrap();
        assert!(made.success());
        assert!(read_small(&path, 9).unwrap_err().to_string().ends_with("it is no file"));
        assert!(open(folder.path()).is_err());
    }

    #[test]
    fn a_full_disk_is_known_and_said() {
        let error = DiskError {
            what: "write",
            path: "O1".into(),
            source: io::Error::from(io::ErrorKind::StorageFull),
        };
        assert!(error.is_full());
        assert!(error.to_string().starts_with("cannot write O1: "), "{error}");
        assert!(error.to_string().ends_with("; make room on the disk"), "{error}");
    }
}
