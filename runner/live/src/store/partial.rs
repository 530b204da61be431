//! A file that is being written and has not got its name yet.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek as _, Write};
use std::path::{Path, PathBuf};

use super::rename_to_new;

/// A file that is being written under a name that says so, such as `O1.nc.partial`.
///
/// It is locked as long as it is written, so that nobody takes it for what a killed program
/// left behind. Its name it gets only while it is the one that was written: not where somebody took
/// it away meanwhile, or put another in its place.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let (partial, name) = (folder.path().join("O1.nc.partial"), folder.path().join("O1.nc"));
/// use std::io::Write;
/// use softplug_live::store::PartialFile;
///
/// let mut file = PartialFile::create(&partial)?;
/// file.write_all(b"G1 X1\n")?;
/// assert!(PartialFile::take_over(&partial).is_err());
/// file.rename_to_new(&name)?;
/// assert_eq!(std::fs::read(&name)?, b"G1 X1\n");
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct PartialFile {
    file: File,
    /// Where it is now.
    path: PathBuf,
}

impl PartialFile {
    /// A new file.
    ///
    /// # Errors
    /// It cannot be made; [`AlreadyExists`](io::ErrorKind::AlreadyExists) where one is there.
    pub fn create(path: &Path) -> io::Result<Self> {
        // Read, because what was written may have to be copied.
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        Self { file, path: path.to_owned() }.locked()
    }

    /// One that is there, and that nobody writes. It must be a file itself: a link is not followed.
    ///
    /// # Errors
    /// It cannot be opened; [`WouldBlock`](io::ErrorKind::WouldBlock) while somebody writes it.
    pub fn take_over(path: &Path) -> io::Result<Self> {
        if !fs::symlink_metadata(path)?.is_file() {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        // Some shares lock only what is open for writing; nothing is written.
        let opened = OpenOptions::new().read(true).write(true).open(path);
        let file = opened.or_else(|_| File::open(path))?;
        Self { file, path: path.to_owned() }.locked()
    }

    fn locked(self) -> io::Result<Self> {
        match self.file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(io::ErrorKind::WouldBlock.into()),
            // Some file systems have no locks.
            Err(TryLockError::Error(error)) => {
                tracing::debug!(file = %self.path.display(), %error, "not locked");
            }
        }
        // Whoever had the lock until now may have moved it, and another be there.
        if self.is_in_place() { Ok(self) } else { Err(io::ErrorKind::WouldBlock.into()) }
    }

    /// The file.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Where it is, unless somebody else moved it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this file is there, and no other in its place. Where the system does not tell files
    /// apart: whether there is one.
    pub fn is_in_place(&self) -> bool {
        let there = fs::symlink_metadata(&self.path);
        #[cfg(unix)]
        let is_it = there.and_then(|there| {
            use std::os::unix::fs::MetadataExt as _;

            let ours = self.file.metadata()?;
            Ok((there.dev(), there.ino()) == (ours.dev(), ours.ino()))
        });
        #[cfg(not(unix))]
        let is_it = there.map(|_| true);
        is_it.unwrap_or(false)
    }

    /// Gives it a name that is not taken.
    ///
    /// # Errors
    /// As for [`rename_over`](Self::rename_over); [`AlreadyExists`](io::ErrorKind::AlreadyExists) where
    /// the name is taken.
    pub fn rename_to_new(&mut self, to: &Path) -> io::Result<()> {
        self.rename(to, rename_to_new)
    }

    /// Gives it a name, in the place of the file that has it.
    ///
    /// # Errors
    /// It cannot be renamed, or it is not there any more, or another in its place.
    pub fn rename_over(&mut self, to: &Path) -> io::Result<()> {
        self.rename(to, |from, to| fs::rename(from, to))
    }

    fn rename(
        &mut self,
        to: &Path,
        rename: impl FnOnce(&Path, &Path) -> io::Result<()>,
    ) -> io::Result<()> {
        self.check()?;
        rename(&self.path, to)?;
        let from = std::mem::replace(&mut self.path, to.to_owned());
        // What was renamed is what was there at that moment.
        if !self.is_in_place() {
            return Err(was_replaced(&from));
        }
        // It may be read now, also where a lock keeps readers away.
        let _ = self.file.unlock();
        Ok(())
    }

    /// Whether it could get its name.
    ///
    /// # Errors
    /// It is not there any more, or another in its place.
    pub fn check(&self) -> io::Result<()> {
        if self.is_in_place() { Ok(()) } else { Err(was_replaced(&self.path)) }
    }

    /// Gives it a name that is not taken, or a copy of it, where it is not in its place any more:
    /// for what is not whole, and is to be kept all the same.
    ///
    /// # Errors
    /// As for [`rename_to_new`](Self::rename_to_new), and if it cannot be copied.
    pub fn keep_as_new(&mut self, to: &Path) -> io::Result<()> {
        if self.is_in_place() {
            return self.rename_to_new(to);
        }
        let mut copy = Self::create(to)?;
        self.file.rewind()?;
        let copied = io::copy(&mut self.file, &mut copy.file).and_then(|_| copy.file.sync_all());
        if let Err(error) = copied {
            copy.remove()?;
            return Err(error);
        }
        *self = copy;
        Ok(())
    }

    /// Keeps it under the first name of `names` that is not taken, and tells which.
    ///
    /// # Errors
    /// As for [`keep_as_new`](Self::keep_as_new).
    pub fn keep_as_free(
        &mut self,
        names: impl IntoIterator<Item = PathBuf>,
    ) -> io::Result<PathBuf> {
        super::first_free(names, |to| self.keep_as_new(to))
    }

    /// Removes it, and no other that is in its place.
    ///
    /// # Errors
    /// It cannot be removed.
    pub fn remove(self) -> io::Result<()> {
        if self.is_in_place() { fs::remove_file(&self.path) } else { Ok(()) }
    }
}

impl Write for PartialFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn was_replaced(path: &Path) -> io::Error {
    let text = format!("somebody removed or replaced {} while it was written", path.display());
    io::Error::other(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_not_taken_over_and_what_is_left_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("O1.partial");
        let kind = |taken: io::Result<PartialFile>| taken.unwrap_err().kind();
        assert_eq!(kind(PartialFile::take_over(&path)), io::ErrorKind::NotFound);
        let mut file = PartialFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        assert_eq!(kind(PartialFile::create(&path)), io::ErrorKind::AlreadyExists);
        assert_eq!(kind(PartialFile::take_over(&path)), io::ErrorKind::WouldBlock);
        drop(file);
        let mut left = PartialFile::take_over(&path).unwrap();
        let names = ["O1", "O1-2"].map(|name| folder.path().join(name));
        fs::write(&names[0], "theirs").unwrap();
        assert_eq!(left.keep_as_free(names.clone()).unwrap(), names[1]);
        assert!(!path.exists());
        assert_eq!(fs::read(&names[0]).unwrap(), b"theirs");
        assert_eq!(fs::read(&names[1]).unwrap(), b"half");
    }

    #[cfg(unix)]
    #[test]
    fn what_somebody_put_in_its_place_gets_no_name_and_nothing_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        let [path, name, kept] = ["O1.partial", "O1", "O1.failed"].map(|n| folder.path().join(n));
        for is_replaced in [true, false] {
            let mut file = PartialFile::create(&path).unwrap();
            file.write_all(b"ours").unwrap();
            fs::remove_file(&path).unwrap();
            if is_replaced {
                fs::write(&path, "theirs").unwrap();
            }
            for renamed in [file.rename_to_new(&name), file.rename_over(&name)] {
                let said = renamed.unwrap_err().to_string();
                assert!(said.contains("somebody removed or replaced"), "{said}");
            }
            assert!(!name.exists());
            file.keep_as_new(&kept).unwrap();
            assert_eq!(fs::read(&kept).unwrap(), b"ours");
            fs::remove_file(&kept).unwrap();
            if is_replaced {
                assert_eq!(fs::read(&path).unwrap(), b"theirs");
                fs::remove_file(&path).unwrap();
            }
        }
    }
}
