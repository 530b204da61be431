//! A folder of files that are named by their SHA-256: plug-ins and snapshots of
//! programs. What has a name has its content; it is never written again.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use softplug_host::Digest;
use softplug_live::store::sync_folder;
use tempfile::NamedTempFile;

use super::{DiskError, is_full, make_folder, sweep, temporary_in};

/// One file in the folder.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Object {
    /// Its SHA-256, which is its name.
    pub digest: Digest,
    /// Its length.
    pub size: u64,
}

/// `FOLDER/ab/cdef….EXTENSION`.
#[derive(Clone, Debug)]
pub struct Objects {
    folder: PathBuf,
    extension: &'static str,
}

impl Objects {
    /// The folder, which is made if need be. `extension` goes with its dot.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open(folder: &Path, extension: &'static str) -> Result<Self, DiskError> {
        make_folder(folder)?;
        Ok(Self { folder: folder.to_owned(), extension })
    }

    /// Where the object is, or would be.
    pub fn path(&self, digest: Digest) -> PathBuf {
        let hex = digest.to_string();
        let (shelf, name) = hex.split_at(2);
        self.folder.join(shelf).join(format!("{name}{}", self.extension))
    }

    /// Keeps all that `from` gives. It is on the disk when this returns. The same content is
    /// kept once.
    ///
    /// # Errors
    /// It cannot be read or written; then nothing is kept.
    pub fn put(&self, from: &mut dyn Read) -> Result<Object, DiskError> {
        let (file, object) =
            self.spool(from).map_err(DiskError::when("write into", &self.folder))?;
        let path = self.path(object.digest);
        let shelf = path.parent().unwrap_or(&self.folder);
        make_folder(shelf)?;
        let placed = || {
            file.as_file().sync_all()?;
            // Over one that is there: it may be damaged, this one is not.
            file.persist(&path)?;
            sync_folder(shelf)
        };
        placed().map_err(DiskError::when("write", &path))?;
        Ok(object)
    }

    /// The object, to be read.
    ///
    /// # Errors
    /// It is not there, or cannot be opened.
    pub fn open_object(&self, digest: Digest) -> Result<File, DiskError> {
        let path = self.path(digest);
        super::open(&path).map_err(DiskError::when("read", &path))
    }

    /// Whether it is there, and how large.
    pub fn find(&self, digest: Digest) -> Option<Object> {
        let metadata = fs::metadata(self.path(digest)).ok()?;
        metadata.is_file().then_some(Object { digest, size: metadata.len() })
    }

    /// All of them, in the order of their digests. Files with other names are not ours.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn all(&self) -> Result<Vec<Object>, DiskError> {
        let mut objects = Vec::new();
        for shelf in super::names_in(&self.folder)? {
            if shelf.len() != 2 {
                continue;
            }
            for name in super::names_in(&self.folder.join(&shelf))? {
                let hex = name.strip_suffix(self.extension).unwrap_or_default();
                let digest = format!("{shelf}{hex}").parse();
                objects.extend(digest.ok().and_then(|digest| self.find(digest)));
            }
        }
        Ok(objects)
    }

    /// Removes an object.
    ///
    /// # Errors
    /// It cannot be removed, or is not there.
    pub fn remove(&self, digest: Digest) -> Result<(), DiskError> {
        super::remove(&self.path(digest))
    }

    /// Removes what killed writers left behind. Only for whoever has the folder to himself.
    pub fn sweep(&self) {
        sweep(&self.folder);
    }

    fn spool(&self, from: &mut dyn Read) -> io::Result<(NamedTempFile, Object)> {
        let mut file = temporary_in(&self.folder)?;
        let object = copy(from, file.as_file_mut())?;
        Ok((file, object))
    }
}

/// Copies all that can be read, and tells what it was.
pub fn copy(from: &mut dyn Read, to: &mut dyn Write) -> io::Result<Object> {
    let mut from = BufReader::with_capacity(64 * 1024, from);
    let mut sum = Sha256::new();
    let mut size = 0;
    loop {
        let count = match from.fill_buf() {
            Ok([]) => break,
            Ok(bytes) => {
                to.write_all(bytes)?;
                sum.update(bytes);
                bytes.len()
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            // Not to be taken for our own disk's.
            Err(error) if is_full(&error) => return Err(io::Error::other(error)),
            Err(error) => return Err(error),
        };
        size += count as u64;
        from.consume(count);
    }
    Ok(Object { digest: Digest::from_bytes(sum.finalize().into()), size })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_kept_once_under_its_digest() {
        let folder = tempfile::tempdir().unwrap();
        let objects = Objects::open(folder.path(), ".nc").unwrap();
        let one = objects.put(&mut &b"G1"[..]).unwrap();
        assert_eq!(objects.put(&mut &b"G1"[..]).unwrap(), one);
        let two = objects.put(&mut &b"G2 X1"[..]).unwrap();
        assert_eq!((one.digest, one.size, two.size), (Digest::of(b"G1"), 2, 5));
        fs::write(folder.path().join(".new-left"), "half").unwrap();
        fs::write(folder.path().join("notes"), "theirs").unwrap();
        let mut expected = [one, two];
        expected.sort_by_key(|object| object.digest);
        assert_eq!(objects.all().unwrap(), expected);
        let mut text = String::new();
        objects.open_object(two.digest).unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "G2 X1");
        objects.sweep();
        objects.remove(one.digest).unwrap();
        assert_eq!(objects.find(one.digest), None);
        assert!(objects.remove(one.digest).unwrap_err().is_missing());
        assert!(!folder.path().join(".new-left").exists());
    }

    #[test]
    fn what_cannot_be_read_leaves_nothing() {
        struct Broken;
        impl Read for Broken {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                Err(io::Error::other("gone"))
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let objects = Objects::open(folder.path(), "").unwrap();
        let mut from = b"half".chain(Broken);
        assert!(objects.put(&mut from).unwrap_err().to_string().ends_with("gone"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
