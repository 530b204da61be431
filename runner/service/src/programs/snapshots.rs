//! Programs as they were when a job was given: what is sent does not change any more.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, TryLockError};

use serde::{Deserialize, Serialize};
use softplug_catalogue::{HEAD_BYTES, Notations};
use softplug_host::Digest;
use softplug_live::store::FileState;

use super::ProgramError;
use crate::disk::{self, DiskError, Object, Objects};

/// A program that changes while it is copied is copied again so often.
const ATTEMPTS: usize = 3;

/// A program's content as it was when the job was given.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Data {
    /// SHA-256.
    #[serde(rename = "sha256", with = "crate::disk::digest_text")]
    pub digest: Digest,
    /// Bytes.
    pub size: u64,
}

/// A folder of snapshots, by content.
#[derive(Clone, Debug)]
pub struct Snapshots {
    objects: Objects,
    /// Held while one has been taken that no job needs yet.
    holds: Arc<RwLock<()>>,
}

/// As long as it is there, no snapshot is removed.
#[derive(Debug)]
pub struct Hold<'a> {
    _guard: RwLockReadGuard<'a, ()>,
}

impl Snapshots {
    /// The folder, which is made if need be. It belongs to one gateway.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open_folder(folder: &Path) -> Result<Self, DiskError> {
        let objects = Objects::open(folder, "")?;
        objects.sweep();
        Ok(Self { objects, holds: Arc::default() })
    }

    /// To be had before one is taken, or a job is read whose snapshot is wanted, and kept
    /// until a job that needs it is written down.
    pub fn hold(&self) -> Hold<'_> {
        Hold { _guard: self.holds.read().unwrap_or_else(PoisonError::into_inner) }
    }

    /// Takes one of a file, as it is at one moment. `name` is what people call it.
    ///
    /// # Errors
    /// It cannot be read, is empty or being written, or the disk would not take it.
    pub fn take(&self, path: &Path, name: &str) -> Result<Data, ProgramError> {
        for _ in 0..ATTEMPTS {
            let mut file = disk::open(path).map_err(DiskError::when("read", path))?;
            let before = FileState::at_rest(&file).map_err(DiskError::when("read", path))?;
            let Some(before) = before else { continue };
            let object = self.objects.put(&mut file)?;
            // Of the path: it may lead to another file by now.
            let now = disk::open(path).map_err(DiskError::when("read", path))?;
            let now = FileState::at_rest(&now).map_err(DiskError::when("read", path))?;
            if now != Some(before) || object.size != before.size {
                continue;
            }
            return filled(object, name);
        }
        Err(ProgramError::Busy(name.to_owned()))
    }

    /// Takes one of all that comes, at most so many bytes.
    ///
    /// # Errors
    /// It cannot be read, is empty or too large, or the disk would not take it.
    pub fn take_all(
        &self,
        from: &mut dyn Read,
        name: &str,
        most: u64,
    ) -> Result<Data, ProgramError> {
        let object = self.objects.put(&mut from.take(most.saturating_add(1)))?;
        if object.size > most {
            self.objects.remove(object.digest)?;
            return Err(ProgramError::TooLarge { most });
        }
        filled(object, name)
    }

    /// A snapshot, to be read.
    ///
    /// # Errors
    /// It is not there.
    pub fn open(&self, data: Data) -> Result<File, DiskError> {
        self.objects.open_object(data.digest)
    }

    /// The name that the program says of itself near its beginning, if it does.
    pub fn name_of(&self, data: Data, notations: &Notations) -> Option<String> {
        let mut head = Vec::new();
        self.open(data).ok()?.take(HEAD_BYTES as u64).read_to_end(&mut head).ok()?;
        notations.name_in(&head)
    }

    /// Where the file of one is.
    pub(crate) fn path(&self, data: Data) -> PathBuf {
        self.objects.path(data.digest)
    }

    /// Removes all but those that `needed` tells; how many bytes. `None`: somebody has a
    /// `Hold`, nothing was done.
    ///
    /// # Errors
    /// It is not known what is needed, the folder cannot be read, or a file not removed.
    pub fn collect_garbage<E: From<DiskError>>(
        &self,
        needed: impl FnOnce() -> Result<BTreeSet<Digest>, E>,
    ) -> Result<Option<u64>, E> {
        let _alone = match self.holds.try_write() {
            Ok(alone) => alone,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return Ok(None),
        };
        let needed = needed()?;
        let mut freed = 0;
        for object in self.objects.all()? {
            if !needed.contains(&object.digest) {
                self.objects.remove(object.digest)?;
                freed += object.size;
            }
        }
        Ok(Some(freed))
    }
}

fn filled(object: Object, name: &str) -> Result<Data, ProgramError> {
    if object.size == 0 {
        return Err(ProgramError::Empty(name.to_owned()));
    }
    Ok(Data { digest: object.digest, size: object.size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_live::store::is_open_for_writing;
    use std::fs;
    use std::io::Write as _;

    fn text(snapshots: &Snapshots, data: Data) -> String {
        let mut text = String::new();
        snapshots.open(data).unwrap().read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn editing_a_program_changes_nothing_that_was_taken() {
        let folder = tempfile::tempdir().unwrap();
        let snapshots = Snapshots::open_folder(&folder.path().join("snapshots")).unwrap();
        let path = folder.path().join("O1.nc");
        fs::write(&path, "G1 X1").unwrap();
        let first = snapshots.take(&path, "O1.nc").unwrap();
        fs::write(&path, "G1 X2").unwrap();
        let second = snapshots.take(&path, "O1.nc").unwrap();
        fs::remove_file(&path).unwrap();
        assert_eq!((&*text(&snapshots, first), &*text(&snapshots, second)), ("G1 X1", "G1 X2"));

        let needed = || Ok::<_, DiskError>(BTreeSet::from([first.digest]));
        let hold = snapshots.hold();
        assert_eq!(snapshots.collect_garbage(needed).unwrap(), None);
        drop(hold);
        assert_eq!(snapshots.collect_garbage(needed).unwrap(), Some(5));
        assert!(snapshots.open(second).unwrap_err().is_missing());
        assert_eq!(text(&snapshots, first), "G1 X1");
    }

    #[test]
    fn what_is_being_written_is_not_taken_before_it_is_closed() {
        let folder = tempfile::tempdir().unwrap();
        let snapshots = Snapshots::open_folder(&folder.path().join("snapshots")).unwrap();
        let path = folder.path().join("O1.nc");
        let mut writer = File::create(&path).unwrap();
        writer.write_all(b"G1 X1").unwrap();
        // Elsewhere than on a disk of this computer nobody knows of writers.
        if is_open_for_writing(&File::open(&path).unwrap()).is_some() {
            let refused = snapshots.take(&path, "O1.nc").unwrap_err();
            assert!(matches!(refused, ProgramError::Busy(_)), "{refused}");
        }
        drop(writer);
        assert_eq!(text(&snapshots, snapshots.take(&path, "O1.nc").unwrap()), "G1 X1");
    }

    #[test]
    fn nothing_and_too_much_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let snapshots = Snapshots::open_folder(folder.path()).unwrap();
        let refused =
            |bytes: &[u8]| snapshots.take_all(&mut &*bytes, "O1", 4).unwrap_err().to_string();
        assert_eq!(refused(b""), "the program \"O1\" is empty: there is nothing to send");
        assert_eq!(
            refused(b"12345"),
            "the program is larger than 4 bytes, which is the most that is taken"
        );
        assert_eq!(snapshots.take_all(&mut &b"1234"[..], "O1", 4).unwrap().size, 4);
    }
}
