//! A file as it is at one moment: copied, so that what is sent does not change any more.

use std::fs::{self, File};
use std::io::{self, Seek};
use std::path::Path;
use std::time::SystemTime;

/// A file that changes while it is copied is copied again so often.
const ATTEMPTS: usize = 3;

/// Copies the file into `into`, which stands at its beginning then; how many bytes. `None`: it
/// changes while it is copied, each time.
///
/// # Errors
/// It cannot be read, or `into` not be written.
pub fn copy_at_one_moment(path: &Path, into: &mut File) -> io::Result<Option<u64>> {
    for _ in 0..ATTEMPTS {
        into.set_len(0)?;
        into.rewind()?;
        let mut file = File::open(path)?;
        let before = FileState::of(&file)?;
        let size = io::copy(&mut file, into)?;
        // Of the path: it may lead to another file by now.
        if FileState::of(&File::open(path)?)? == before && size == before.size {
            into.rewind()?;
            return Ok(Some(size));
        }
    }
    Ok(None)
}

/// What changes when somebody writes to a file or puts another in its place.
///
/// ```
/// use softplug_live::store::FileState;
///
/// let file = tempfile::tempfile()?;
/// let before = FileState::of(&file)?;
/// file.set_len(3)?;
/// assert_ne!(FileState::of(&file)?, before);
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct FileState {
    /// How many bytes it has.
    pub size: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl FileState {
    /// As it is now.
    ///
    /// # Errors
    /// The system does not say.
    pub fn of(file: &File) -> io::Result<Self> {
        let metadata = file.metadata()?;
        let (size, modified) = (metadata.len(), metadata.modified().ok());
        Ok(Self { size, modified, inode: inode(&metadata) })
    }
}

#[cfg(unix)]
fn inode(metadata: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(metadata)
}

#[cfg(not(unix))]
fn inode(_: &fs::Metadata) -> u64 {
    0
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};

    use super::*;

    #[test]
    fn what_becomes_of_the_file_does_not_become_of_the_copy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("O1.nc");
        fs::write(&path, "G1 X1\nG1 X2\n").unwrap();
        let mut copy = tempfile::tempfile().unwrap();
        copy.write_all(b"something that was longer than that").unwrap();
        assert_eq!(copy_at_one_moment(&path, &mut copy).unwrap(), Some(12));
        File::options().write(true).open(&path).unwrap().set_len(3).unwrap();
        let mut text = String::new();
        copy.read_to_string(&mut text).unwrap();
        assert_eq!(text, "G1 X1\nG1 X2\n");
    }

    /// Its size is said to be none, as that of a file that grows behind every look.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_that_is_never_the_same_is_not_copied() {
        let mut copy = tempfile::tempfile().unwrap();
        assert_eq!(copy_at_one_moment(Path::new("/proc/self/status"), &mut copy).unwrap(), None);
    }
}
