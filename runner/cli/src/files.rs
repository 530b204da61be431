//! Files: reading what is given, replacing what is ours, keeping what came.

use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use softplug_live::plain_text;
use softplug_live::store::{PartialFile, copy_at_one_moment, numbered, sync_folder};
use softplug_live::transfer::Sink;

use crate::failure::Failure;
use crate::screen::Screen;

/// A program to send.
#[derive(Debug)]
pub(crate) struct Program {
    pub(crate) file: File,
    pub(crate) size: u64,
    /// As it was given, for messages.
    pub(crate) name: String,
}

impl Program {
    /// Of a job without data.
    pub(crate) fn nothing() -> Result<Self, Failure> {
        Ok(Self { file: temporary()?, size: 0, name: "the job".to_owned() })
    }

    /// Takes a copy of the file, so that what is sent is what it was at one moment, whoever writes
    /// to it meanwhile; `-` is standard input, taken in whole, because a check reads the program
    /// before it is sent.
    pub(crate) fn open(path: &Path) -> Result<Self, Failure> {
        let (mut file, name) = if path == Path::new("-") {
            (spool(&mut io::stdin().lock())?, "standard input".to_owned())
        } else {
            (copy(path)?, path.display().to_string())
        };
        let size = file
            .seek(io::SeekFrom::End(0))
            .and_then(|size| file.rewind().map(|()| size))
            .map_err(|error| unreadable(path, &error))?;
        if size == 0 {
            return Err(Failure::usage(format_args!("{name} is empty: there is nothing to send")));
        }
        Ok(Self { file, size, name })
    }

    /// All of it; it stands at its beginning again.
    pub(crate) fn read(&mut self) -> Result<Vec<u8>, Failure> {
        let mut bytes = Vec::new();
        let file = &mut self.file;
        let read = file.take(LARGEST + 1).read_to_end(&mut bytes).and_then(|_| file.rewind());
        read.map_err(|error| unreadable(Path::new(&self.name), &error))?;
        within_bounds(&bytes, Path::new(&self.name))?;
        Ok(bytes)
    }
}

/// The file as it is now.
fn copy(path: &Path) -> Result<File, Failure> {
    let metadata = fs::metadata(path).map_err(|error| unreadable(path, &error))?;
    if metadata.is_dir() {
        return Err(Failure::usage(format_args!(
            "{} is a folder: give the file to send",
            path.display()
        )));
    }
    // Opening a FIFO would wait for a writer, and none of these can be rewound.
    if !metadata.is_file() {
        return Err(Failure::usage(format_args!(
            "{} is not a regular file: give one, or pipe it in and say -",
            path.display()
        )));
    }
    File::open(path).map_err(|error| unreadable(path, &error))?;
    let mut file = temporary()?;
    let copied = copy_at_one_moment(path, &mut file).map_err(|error| {
        Failure::usage(format_args!("cannot copy {} to send it: {error}", path.display()))
    })?;
    match copied {
        Some(_) => Ok(file),
        None => Err(Failure::usage(format_args!(
            "{} is being written: try again when that has ended",
            path.display()
        ))),
    }
}

fn temporary() -> Result<File, Failure> {
    tempfile::tempfile()
        .map_err(|error| Failure::usage(format_args!("cannot make a temporary file: {error}")))
}

fn spool(from: &mut impl Read) -> Result<File, Failure> {
    let spooled = tempfile::tempfile().and_then(|mut file| {
        io::copy(from, &mut file)?;
        Ok(file)
    });
    spooled.map_err(|error| Failure::usage(format_args!("cannot read standard input: {error}")))
}

/// Most bytes of a file that is read as a whole.
const LARGEST: u64 = 256 << 20;

/// All of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LARGEST + 1).read_to_end(&mut bytes))
        .map_err(|error| unreadable(path, &error))?;
    within_bounds(&bytes, path)?;
    Ok(bytes)
}

fn within_bounds(bytes: &[u8], path: &Path) -> Result<(), Failure> {
    if bytes.len() as u64 > LARGEST {
        return Err(Failure::usage(format_args!(
            "{} has more than {LARGEST} bytes: nothing that is read here is as large",
            path.display()
        )));
    }
    Ok(())
}

/// All of a file that is text.
pub(crate) fn read_text(path: &Path) -> Result<String, Failure> {
    String::from_utf8(read(path)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Failure::usage(format_args!("{} is not text: byte {at} is not UTF-8", path.display()))
    })
}

pub(crate) fn unreadable(path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format_args!("cannot read {}: {error}", path.display()))
}

pub(crate) fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format_args!("cannot write {}: {error}", path.display()))
}

/// Writes an SVG picture. It may take the place of another one, and of nothing else: a program that
/// is named by mistake stays. `option` is what names the file.
pub(crate) fn write_picture(path: &Path, svg: &str, option: &str) -> Result<(), Failure> {
    check_picture(path, option)?;
    fs::write(path, svg).map_err(|error| unwritable(path, &error))
}

/// Whether a picture may be written there.
pub(crate) fn check_picture(path: &Path, option: &str) -> Result<(), Failure> {
    let is_kept = path.is_file()
        && fs::read(path).is_ok_and(|bytes| !bytes.is_empty() && !bytes.starts_with(b"<svg"));
    if !is_kept {
        return Ok(());
    }
    let file = plain_text(&path.display().to_string());
    Err(Failure::usage(format_args!(
        "{file} is there and is no picture, which {option} would overwrite; give {option} another one"
    )))
}

/// Files below `paths` that end in `.extension`, sorted; files are taken as they
/// are.
pub(crate) fn gather(paths: &[PathBuf], extension: &str) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in paths {
        if fs::metadata(path).map_err(|error| unreadable(path, &error))?.is_dir() {
            walk(path, extension, &mut files)?;
        } else {
            files.push(path.clone());
        }
    }
    Ok(files)
}

fn walk(folder: &Path, extension: &str, files: &mut Vec<PathBuf>) -> Result<(), Failure> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    let mut entries: Vec<_> = entries
        .map_err(|error| unreadable(folder, &error))?
        .into_iter()
        .map(|entry| entry.path())
        .collect();
    entries.sort();
    for path in entries {
        // A link to a folder is not followed: it may lead in a circle.
        let metadata = fs::symlink_metadata(&path).map_err(|error| unreadable(&path, &error))?;
        if metadata.is_dir() {
            walk(&path, extension, files)?;
        } else if path.extension().is_some_and(|found| found == extension) {
            files.push(path);
        }
    }
    Ok(())
}

/// Replaces a file's content: all of it or nothing.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let replaced = (|| {
        // Through a link, so that the link stays one.
        let path = path.canonicalize()?;
        let mut file = tempfile::NamedTempFile::new_in(folder_of(&path))?;
        file.write_all(bytes)?;
        file.as_file().set_permissions(fs::metadata(&path)?.permissions())?;
        file.as_file().sync_all()?;
        file.persist(&path).map_err(|error| error.error)
    })();
    replaced.map(drop).map_err(|error| unwritable(path, &error))
}

/// Writes a file, new or in the place of another: all of it or nothing.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if path.exists() {
        return replace(path, bytes);
    }
    let written = (|| {
        #[cfg_attr(not(unix), expect(unused_mut))]
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Temporary files are their owner's alone; this one is an ordinary file.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let mut file = builder.tempfile_in(folder_of(path))?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|error| error.error)
    })();
    written.map(drop).map_err(|error| unwritable(path, &error))
}

/// A file that is being received: it has its own name only once it is complete.
#[derive(Debug)]
pub(crate) struct Partial {
    pub(crate) file: PartialFile,
    out: PathBuf,
    /// What `out` links to, or itself.
    target: PathBuf,
    force: bool,
    /// It is complete, and on the disk under its name.
    is_complete: bool,
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

fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// A folder that cannot be used.
pub(crate) fn no_folder(path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format_args!("{} is no folder to use: {error}", path.display()))
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
    fn a_file_without_an_end_is_not_read() {
        let failure = read(Path::new("/dev/zero")).unwrap_err();
        assert!(failure.message.contains("has more than"), "{}", failure.message);
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

    #[cfg(unix)]
    #[test]
    fn replacing_keeps_rights_and_links() {
        use std::os::unix::fs::PermissionsExt;

        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.spt"), folder.path().join("b.spt"));
        fs::write(&file, "old").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink("a.spt", &link).unwrap();
        replace(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn programs_are_files_with_something_in_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("O1.nc");
        fs::write(&file, "").unwrap();
        let message = |path: &Path| Program::open(path).unwrap_err().message;
        assert!(message(&file).ends_with("O1.nc is empty: there is nothing to send"));
        assert!(message(folder.path()).ends_with("is a folder: give the file to send"));
        assert!(message(&folder.path().join("none")).starts_with("cannot read "));
        fs::write(&file, "G1").unwrap();
        assert_eq!(Program::open(&file).unwrap().size, 2);
        assert_eq!(spool(&mut &b"G1X1"[..]).unwrap().metadata().unwrap().len(), 4);
    }
}
