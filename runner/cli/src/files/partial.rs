//! A file that is being received.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use softplug_live::store::{PartialFile, numbered, sync_folder};
use softplug_live::transfer::Sink;

use super::{folder_of, unwritable};
use crate::failure::Failure;
use crate::screen::Screen;

/// It has its own name only once it is complete.
#[derive(Debug)]
pub(crate) struct Partial {
    pub(crate) file: PartialFile,
    out: PathBuf,
    /// What `out` links to, or itself.
    target: PathBuf,
    force: bool,
    /// It is complete, and on the disk under its name.
    is_complete: bool,
    /// What a killed command left, put aside.
    left: Option<PathBuf>,
}

impl Partial {
    /// Whether `OUT` can be received into: unless `force`, neither it nor
    /// `OUT.partial` may be there.
    pub(crate) fn check(out: &Path, force: bool) -> Result<(), Failure> {
        if out.is_dir() || out.file_name().is_none() {
            return Err(Failure::usage(format_args!(
                "{} is a folder: give the file to write",
                out.display()
            )));
        }
        if fs::metadata(out).is_ok_and(|metadata| !metadata.is_file()) {
            return Err(Failure::usage(format_args!(
                "{} is a device or the like: give a file to write",
                out.display()
            )));
        }
        let folder = folder_of(out);
        if !folder.is_dir() {
            return Err(Failure::usage(format_args!("there is no folder {}", folder.display())));
        }
        let is_there = |path: &Path| !force && fs::symlink_metadata(path).is_ok();
        if is_there(out) {
            return Err(Failure::usage(format_args!("{} is there already", out.display()))
                .hint("choose another name, or overwrite it with --force"));
        }
        let partial = partial_path(out);
        let taken = PartialFile::take_over(&partial);
        if taken.is_err_and(|error| error.kind() == io::ErrorKind::WouldBlock) {
            return Err(under_way(&partial));
        }
        if is_there(&partial) { Err(left_behind(&partial)) } else { Ok(()) }
    }

    /// Makes `OUT.partial`, after the same checks. With `force`, what a killed reception left under that
    /// name is put aside.
    pub(crate) fn create(out: &Path, force: bool) -> Result<Self, Failure> {
        Self::check(out, force)?;
        // Through a link, so that the link stays one.
        let target = match out.canonicalize() {
            Ok(target) if out.is_symlink() => target,
            _ => out.to_owned(),
        };
        let path = partial_path(&target);
        let failure = |error: &io::Error| match error.kind() {
            io::ErrorKind::WouldBlock => under_way(&path),
            // Since it was put aside.
            io::ErrorKind::AlreadyExists if force => under_way(&path),
            io::ErrorKind::AlreadyExists => left_behind(&path),
            _ => unwritable(&path, error),
        };
        // Its lock is held until the new file has one.
        let aside =
            if force { put_aside(&path, &target).map_err(|error| failure(&error))? } else { None };
        let file = PartialFile::create(&path).map_err(|error| failure(&error))?;
        let left = aside.map(|aside| aside.path().to_owned());
        Ok(Self { file, out: out.to_owned(), target, force, is_complete: false, left })
    }

    /// Says where that is what a killed command left, if there was something.
    pub(crate) fn say_left(&self, screen: &Screen) {
        if let Some(left) = &self.left {
            let left = left.display();
            screen.note(format_args!("what a killed command left of the file is in {left}"));
        }
    }

    /// Writes all that there is and gives it its name; where that fails nothing is left.
    pub(crate) fn write(mut self, bytes: &[u8]) -> Result<PathBuf, Failure> {
        if let Err(error) = self.file.write_all(bytes) {
            let _ = self.file.remove();
            return Err(unwritable(&self.out, &error));
        }
        self.complete()
    }

    /// The reception is complete: gives the file its name, and tells it.
    pub(crate) fn complete(mut self) -> Result<PathBuf, Failure> {
        if let Err(error) = Sink::complete(&mut self) {
            let failure = Failure::usage(format_args!(
                "cannot give {} its name {}: {error}",
                self.file.path().display(),
                self.out.display()
            ));
            return Err(match self.keep() {
                Some(kept) => failure
                    .hint(format_args!("what was received is complete, in {}", kept.display())),
                None => failure,
            });
        }
        Ok(self.out)
    }

    /// The reception failed: what came stays as `OUT.failed`, or with a number if
    /// there is one already; an empty file does not. Tells where it stays. What was complete before
    /// has its name, and stays there.
    pub(crate) fn keep(mut self) -> Option<PathBuf> {
        if self.is_complete {
            return Some(self.out);
        }
        if self.file.file().metadata().is_ok_and(|metadata| metadata.len() == 0) {
            let _ = self.file.remove();
            return None;
        }
        if let Err(error) = self.file.file().sync_all() {
            let file = self.file.path().display();
            tracing::warn!(%file, %error, "not known to be on the disk");
        }
        match self.file.keep_as_free(failed_names(&self.out)) {
            Ok(kept) => Some(kept),
            Err(error) => {
                tracing::warn!(file = %self.file.path().display(), %error, "not renamed");
                self.file.is_in_place().then(|| self.file.path().to_owned())
            }
        }
    }
}

impl Write for Partial {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    /// What there is of it is on the disk then, under the name that it has.
    fn flush(&mut self) -> io::Result<()> {
        self.file.file().sync_all()?;
        sync_folder(folder_of(self.file.path()))
    }
}

impl Sink for Partial {
    fn complete(&mut self) -> io::Result<()> {
        self.file.file().sync_all()?;
        if self.is_complete {
            return Ok(());
        }
        if self.force {
            self.file.rename_over(&self.target)?;
        } else {
            self.file.rename_to_new(&self.target).map_err(|error| match error.kind() {
                io::ErrorKind::AlreadyExists => {
                    io::Error::new(error.kind(), "another file of this name came up meanwhile")
                }
                _ => error,
            })?;
        }
        sync_folder(folder_of(&self.target))?;
        self.is_complete = true;
        Ok(())
    }
}

/// Keeps what a killed reception left: as failed, as it is not known to be whole. Nothing is to be kept
/// of an empty file, nor of a link, which is not followed.
fn put_aside(partial: &Path, out: &Path) -> io::Result<Option<PartialFile>> {
    match fs::symlink_metadata(partial) {
        Ok(metadata) if metadata.is_file() => {}
        Ok(_) => return fs::remove_file(partial).map(|()| None),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    }
    let mut left = PartialFile::take_over(partial)?;
    if left.file().metadata()?.len() == 0 {
        return left.remove().map(|()| None);
    }
    left.file().sync_all()?;
    left.keep_as_free(failed_names(out))?;
    Ok(Some(left))
}

/// Names for what is not whole, of which the first that is not taken is taken.
fn failed_names(out: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    numbered(out.parent().unwrap_or(Path::new("")), &name, ".failed")
}

fn partial_path(out: &Path) -> PathBuf {
    let mut path = out.as_os_str().to_owned();
    path.push(".partial");
    PathBuf::from(path)
}

fn left_behind(partial: &Path) -> Failure {
    Failure::usage(format_args!(
        "{} is there already, from a reception that is under way or was killed",
        partial.display()
    ))
    .hint("move it away, or let --force keep it as a failed one")
}

fn under_way(partial: &Path) -> Failure {
    Failure::usage(format_args!("{} is just being written by another command", partial.display()))
        .hint("wait until that has ended, or choose another name")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complete_file_gets_its_name_and_overwrites_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("O1.nc");
        let mut partial = Partial::create(&out, false).unwrap();
        partial.file.write_all(b"G1").unwrap();
        assert!(!out.exists() && folder.path().join("O1.nc.partial").exists());
        // Somebody else is quicker: both files stay.
        fs::write(&out, "theirs").unwrap();
        let failure = partial.complete().unwrap_err();
        assert!(failure.message.contains("O1.nc.partial"), "{}", failure.message);
        assert_eq!(fs::read(&out).unwrap(), b"theirs");
        assert_eq!(fs::read(folder.path().join("O1.nc.failed")).unwrap(), b"G1");

        assert!(Partial::create(&out, false).is_err());
        let mut partial = Partial::create(&out, true).unwrap();
        partial.file.write_all(b"G2").unwrap();
        partial.complete().unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"G2");
        assert!(!folder.path().join("O1.nc.partial").exists());
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_not_replaced_and_links_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.spt"), folder.path().join("b.spt"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink("a.spt", &link).unwrap();
        Partial::create(&link, true).unwrap().write(b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());

        std::os::unix::fs::symlink("/dev/null", folder.path().join("null")).unwrap();
        for force in [false, true] {
            let failure = Partial::check(&folder.path().join("null"), force).unwrap_err();
            assert!(failure.message.contains("is a device or the like"), "{}", failure.message);
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_a_killed_reception_left_is_taken_away_and_never_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let (victim, out) = (folder.path().join("victim"), folder.path().join("O1.nc"));
        fs::write(&victim, "theirs").unwrap();
        for is_link in [true, false] {
            if is_link {
                std::os::unix::fs::symlink("victim", folder.path().join("O1.nc.partial")).unwrap();
            } else {
                fs::hard_link(&victim, folder.path().join("O1.nc.partial")).unwrap();
            }
            assert!(Partial::create(&out, false).is_err());
            Partial::create(&out, true).unwrap().write(b"G1").unwrap();
            assert_eq!(fs::read(&victim).unwrap(), b"theirs");
            assert!(fs::symlink_metadata(&out).unwrap().is_file());
            assert_eq!(fs::read(&out).unwrap(), b"G1");
        }
    }

    #[test]
    fn what_was_complete_keeps_its_name_whatever_fails_behind_it() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("O1.nc");
        let mut partial = Partial::create(&out, false).unwrap();
        partial.write_all(b"G1").unwrap();
        Sink::complete(&mut partial).unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"G1");
        assert!(!folder.path().join("O1.nc.partial").exists());
        assert_eq!(partial.keep(), Some(out));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn force_takes_nothing_from_a_reception_that_is_under_way() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("O1.nc");
        let mut partial = Partial::create(&out, true).unwrap();
        partial.write_all(b"G1").unwrap();
        for failure in [Partial::check(&out, true), Partial::create(&out, true).map(drop)] {
            let message = failure.unwrap_err().message;
            assert!(message.ends_with("is just being written by another command"), "{message}");
        }
        partial.complete().unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"G1");
    }

    #[test]
    fn what_a_killed_reception_left_is_kept_beside_what_force_writes() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("O1.nc");
        fs::write(folder.path().join("O1.nc.partial"), "half").unwrap();
        let partial = Partial::create(&out, true).unwrap();
        let left = folder.path().join("O1.nc.failed");
        assert_eq!(partial.left.as_ref(), Some(&left));
        assert_eq!(partial.keep(), None);
        assert_eq!(fs::read(&left).unwrap(), b"half");
    }

    #[test]
    fn what_came_stays_and_nothing_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("O1.nc");
        assert_eq!(Partial::create(&out, false).unwrap().keep(), None);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        for (bytes, name) in [("G1", "O1.nc.failed"), ("G2", "O1-2.nc.failed")] {
            let mut partial = Partial::create(&out, false).unwrap();
            partial.file.write_all(bytes.as_bytes()).unwrap();
            assert_eq!(partial.keep(), Some(folder.path().join(name)));
            assert_eq!(fs::read(folder.path().join(name)).unwrap(), bytes.as_bytes());
        }
        // What a killed command left is not lost to the next attempt.
        let _under_way = Partial::create(&out, false).unwrap();
        assert!(Partial::create(&out, false).is_err());
    }
}
