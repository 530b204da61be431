//! A folder that takes deliveries: one file each, none overwritten, failed ones
//! kept and marked.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::{PartialFile, first_free, numbered, rename_to_new, safe_name, sync_folder};

/// Whether a delivery is whole.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Mark {
    /// All of it came.
    Complete,
    /// What came is not all, or not as it was sent.
    Failed,
}

/// Where a delivery is now.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Kept {
    /// Its file; `None` for a failed one of which nothing came.
    pub path: Option<PathBuf>,
    /// Its length.
    pub bytes: u64,
}

/// Takes one delivery after the other.
///
/// While a delivery comes, its file ends in `.partial`. A complete one gets the name that
/// the machine gave, as far as [`safe_name`] lets it stand; one without gets a number of its own.
/// A name that is taken gets a number behind it. A failed one ends in `.failed`.
#[derive(Debug)]
pub struct Inbox {
    folder: PathBuf,
    under_way: Option<UnderWay>,
    /// Number of the next delivery without a name.
    number: u32,
}

#[derive(Debug)]
struct UnderWay {
    file: PartialFile,
    bytes: u64,
    /// A write failed, and part of it may stand behind `bytes`.
    is_torn: bool,
}

impl UnderWay {
    /// Takes away what a failed write left behind the good bytes.
    fn mend(&mut self) -> io::Result<()> {
        if self.is_torn {
            let mut file = self.file.file();
            file.set_len(self.bytes)?;
            file.seek(SeekFrom::Start(self.bytes))?;
            self.is_torn = false;
        }
        Ok(())
    }
}

impl Inbox {
    /// Deliveries go into `folder`, which must be there.
    ///
    /// # Errors
    /// It is no folder.
    pub fn new(folder: &Path) -> io::Result<Self> {
        if !fs::metadata(folder)?.is_dir() {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        Ok(Self { folder: folder.to_owned(), under_way: None, number: 1 })
    }

    /// A delivery begins. One that is still under way is kept as failed.
    ///
    /// # Errors
    /// No file can be made.
    pub fn begin(&mut self) -> io::Result<()> {
        self.begin_as("delivery")
    }

    /// Begins a delivery whose file is called `stem.partial` while it comes.
    ///
    /// # Errors
    /// No file can be made.
    pub fn begin_as(&mut self, stem: &str) -> io::Result<()> {
        if self.under_way.is_some() {
            self.end(None, Mark::Failed)?;
        }
        for path in numbered(&self.folder, stem, ".partial") {
            match PartialFile::create(&path) {
                // Of another reception, or of one that was killed.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                // Somebody took it for such a one before it was locked.
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
                Ok(file) => {
                    self.under_way = Some(UnderWay { file, bytes: 0, is_torn: false });
                    return Ok(());
                }
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    /// More bytes of the delivery under way.
    ///
    /// # Errors
    /// They cannot be written. None of them counts then; they may be given again.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(under_way) = &mut self.under_way else { return Ok(()) };
        // What could not be taken away at once is before anything else is written: it would
        // stand in the file twice.
        under_way.mend()?;
        if let Err(error) = under_way.file.write_all(bytes) {
            under_way.is_torn = true;
            // Said by the next write, or at the end, if it cannot be.
            let _ = under_way.mend();
            return Err(error);
        }
        under_way.bytes += bytes.len() as u64;
        Ok(())
    }

    /// Bytes of the delivery under way; `None` if there is none.
    pub fn under_way(&self) -> Option<u64> {
        self.under_way.as_ref().map(|under_way| under_way.bytes)
    }

    /// The delivery under way has ended; `name` is from the line.
    ///
    /// # Errors
    /// The file cannot be brought onto the disk, or somebody removed or replaced it: what came is kept
    /// as failed then. Or it cannot get its name: what came stays in the `.partial` one.
    pub fn end(&mut self, name: Option<&str>, mark: Mark) -> io::Result<Kept> {
        let Some(mut under_way) = self.under_way.take() else {
            return Ok(Kept { path: None, bytes: 0 });
        };
        let mended = under_way.mend();
        let UnderWay { mut file, bytes, .. } = under_way;
        if mark == Mark::Failed && bytes == 0 {
            file.remove()?;
            return Ok(Kept { path: None, bytes });
        }
        let put_away = mended.and_then(|()| file.file().sync_all());
        let put_away = match mark {
            Mark::Complete => put_away.and_then(|()| file.check()),
            Mark::Failed => put_away,
        };
        let is_whole = mark == Mark::Complete && put_away.is_ok();
        let end = if is_whole { "" } else { ".failed" };
        let give = |to: &Path| if is_whole { file.rename_to_new(to) } else { file.keep_as_new(to) };
        let to = match name.and_then(safe_name) {
            Some(name) => first_free(numbered(&self.folder, &name, end), give)?,
            None => self.number(end, give)?,
        };
        put_away?;
        sync_folder(&self.folder)?;
        Ok(Kept { path: Some(to), bytes })
    }

    /// What earlier ones left behind that were killed: keeps it as failed, each with a number of
    /// its own; tells what its file was called without `.partial`. Only for whoever has the
    /// folder to himself, before the first delivery.
    ///
    /// # Errors
    /// The folder cannot be read, or a file not renamed.
    pub fn keep_left_over(&mut self) -> io::Result<Vec<(String, Kept)>> {
        let mut left = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let name = entry?.file_name().into_string().unwrap_or_default();
            let Some(stem) = name.strip_suffix(".partial") else { continue };
            let path = self.folder.join(&name);
            let metadata = fs::symlink_metadata(&path)?;
            if metadata.is_file() {
                left.push((stem.to_owned(), path, metadata.len()));
            }
        }
        left.sort_unstable();
        let mut kept = Vec::new();
        for (stem, path, bytes) in left {
            let path = if bytes == 0 {
                fs::remove_file(&path)?;
                None
            } else {
                File::open(&path)?.sync_all()?;
                Some(self.number(".failed", |to| rename_to_new(&path, to))?)
            };
            kept.push((stem, Kept { path, bytes }));
        }
        sync_folder(&self.folder)?;
        Ok(kept)
    }

    /// Deliveries without a name are counted, so that their order is seen.
    fn number(
        &mut self,
        end: &str,
        mut give: impl FnMut(&Path) -> io::Result<()>,
    ) -> io::Result<PathBuf> {
        loop {
            let number = self.number;
            self.number += 1;
            let names = ["", ".failed"].map(|end| self.folder.join(format!("{number:06}{end}")));
            // A number means one delivery, whole or not.
            if names.iter().any(|name| fs::symlink_metadata(name).is_ok()) {
                continue;
            }
            let to = self.folder.join(format!("{number:06}{end}"));
            match give(&to) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                renamed => return renamed.map(|()| to),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn deliver(inbox: &mut Inbox, bytes: &[u8], name: Option<&str>, mark: Mark) -> Kept {
        inbox.begin().unwrap();
        inbox.write(bytes).unwrap();
        inbox.end(name, mark).unwrap()
    }

    #[test]
    fn nothing_is_overwritten_and_failures_are_marked() {
        let folder = tempfile::tempdir().unwrap();
        let mut inbox = Inbox::new(folder.path()).unwrap();
        for (bytes, mark) in [
            ("one", Mark::Complete),
            ("two", Mark::Complete),
            ("thr", Mark::Failed),
            ("", Mark::Failed),
            ("", Mark::Complete),
        ] {
            deliver(&mut inbox, bytes.as_bytes(), Some("O1"), mark);
        }
        assert_eq!(names(folder.path()), ["O1", "O1-2", "O1-3", "O1.failed"]);
        let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
        assert_eq!((read("O1"), read("O1-2")), (b"one".to_vec(), b"two".to_vec()));
        assert_eq!((read("O1-3"), read("O1.failed")), (Vec::new(), b"thr".to_vec()));
    }

    #[test]
    fn deliveries_without_a_name_are_counted_on() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("000002"), "theirs").unwrap();
        let mut inbox = Inbox::new(folder.path()).unwrap();
        deliver(&mut inbox, b"1", None, Mark::Complete);
        deliver(&mut inbox, b"2", Some("../"), Mark::Failed);
        deliver(&mut inbox, b"3", Some(".."), Mark::Complete);
        assert_eq!(names(folder.path()), ["000001", "000002", "000003.failed", "000004"]);
        let mut again = Inbox::new(folder.path()).unwrap();
        let kept = deliver(&mut again, b"4", None, Mark::Complete);
        assert_eq!(kept.path, Some(folder.path().join("000005")));
        assert_eq!(fs::read(folder.path().join("000002")).unwrap(), b"theirs");
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lie_in_wait_are_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("in");
        fs::create_dir(&inside).unwrap();
        let outside = folder.path().join("precious");
        std::os::unix::fs::symlink(&outside, inside.join("O1")).unwrap();
        std::os::unix::fs::symlink(&outside, inside.join("delivery.partial")).unwrap();
        std::os::unix::fs::symlink(&outside, inside.join("000001")).unwrap();
        let mut inbox = Inbox::new(&inside).unwrap();
        deliver(&mut inbox, b"1", Some("O1"), Mark::Complete);
        deliver(&mut inbox, b"2", None, Mark::Complete);
        assert!(!outside.exists());
        assert_eq!(names(&inside), ["000001", "000002", "O1", "O1-2", "delivery.partial"]);
    }

    #[cfg(unix)]
    #[test]
    fn what_somebody_put_in_its_place_is_not_taken_for_the_delivery() {
        let folder = tempfile::tempdir().unwrap();
        let mut inbox = Inbox::new(folder.path()).unwrap();
        inbox.begin().unwrap();
        inbox.write(b"ours").unwrap();
        fs::remove_file(folder.path().join("delivery.partial")).unwrap();
        fs::write(folder.path().join("delivery.partial"), "theirs").unwrap();
        let error = inbox.end(Some("O1"), Mark::Complete).unwrap_err();
        assert!(error.to_string().contains("somebody removed or replaced"), "{error}");
        assert_eq!(names(folder.path()), ["O1.failed", "delivery.partial"]);
        assert_eq!(fs::read(folder.path().join("O1.failed")).unwrap(), b"ours");
        assert_eq!(fs::read(folder.path().join("delivery.partial")).unwrap(), b"theirs");
    }

    #[test]
    fn what_was_under_way_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let mut inbox = Inbox::new(folder.path()).unwrap();
        inbox.begin().unwrap();
        inbox.write(b"half").unwrap();
        assert_eq!(names(folder.path()), ["delivery.partial"]);
        inbox.begin().unwrap();
        assert_eq!(names(folder.path()), ["000001.failed", "delivery.partial"]);
        assert!(Inbox::new(&folder.path().join("000001.failed")).is_err());
    }
}
