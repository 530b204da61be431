//! A file as it is at one moment: copied, so that what is sent does not change any more.

use std::fs::{self, File};
use std::io::{self, Seek};
use std::path::Path;
use std::time::SystemTime;

use super::is_open_for_writing;

/// A file that changes while it is copied is copied again so often.
const ATTEMPTS: usize = 3;

/// Copies the file into `into`, which stands at its beginning then; how many bytes. `None`: somebody
/// is writing it, or it changes while it is copied, each time.
///
/// # Errors
/// It cannot be read, or `into` not be written.
pub fn copy_at_one_moment(path: &Path, into: &mut File) -> io::Result<Option<u64>> {
    for _ in 0..ATTEMPTS {
        into.set_len(0)?;
        into.rewind()?;
        let mut file = File::open(path)?;
        let Some(before) = FileState::at_rest(&file)? else { continue };
        let size = io::copy(&mut file, into)?;
        // Of the path: it may lead to another file by now.
        if FileState::at_rest(&File::open(path)?)? == Some(before) && size == before.size {
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

    /// As it is now; `None` while somebody is known to have it open for writing. What was at rest with
    /// one state before and behind a copy has not changed in between.
    ///
    /// # Errors
    /// The system does not say.
    pub fn at_rest(file: &File) -> io::Result<Option<Self>> {
        if is_open_for_writing(file) == Some(true) { Ok(None) } else { Self::of(file).map(Some) }
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

    #[test]
    fn a_file_that_is_being_written_is_not_copied_before_it_is_closed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("O1.nc");
        let mut writer = File::create(&path).unwrap();
        writer.write_all(b"G1 X1\n").unwrap();
        let mut copy = tempfile::tempfile().unwrap();
        let copied = copy_at_one_moment(&path, &mut copy).unwrap();
        // Elsewhere than on a disk of this computer nobody knows of writers.
        let is_known = is_open_for_writing(&File::open(&path).unwrap()).is_some();
        assert_eq!(copied, (!is_known).then_some(6));
        drop(writer);
        assert_eq!(copy_at_one_moment(&path, &mut copy).unwrap(), Some(6));
    }

    /// Its size is said to be none, as that of a file that grows behind every look.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_that_is_never_the_same_is_not_copied() {
        let mut copy = tempfile::tempfile().unwrap();
        assert_eq!(copy_at_one_moment(Path::new("/proc/self/status"), &mut copy).unwrap(), None);
    }
}
