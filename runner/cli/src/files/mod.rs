//! Files: reading what is given, replacing what is ours, keeping what came.

mod partial;

pub(crate) use partial::Partial;

use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use softplug_live::plain_text;
use softplug_live::store::copy_at_one_moment;

use crate::failure::Failure;

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
    fn a_file_without_an_end_is_not_read() {
        let failure = read(Path::new("/dev/zero")).unwrap_err();
        assert!(failure.message.contains("has more than"), "{}", failure.message);
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
