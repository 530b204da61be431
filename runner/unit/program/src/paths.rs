//! What a path leads to, there or not: found out without writing.

use std::ffi::OsString;
use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::fs::{StatVfsMountFlags, statfs, statvfs};
use thiserror::Error;

/// The major number of MTD character devices.
const MTD: u32 = 90;
/// File systems in which nobody can make files: procfs, sysfs, devpts, cgroup, cgroup2 and debugfs.
const UNREAL: [i64; 6] = [0x9fa0, 0x6265_6572, 0x1cd1, 0x0027_e0eb, 0x6367_7270, 0x6462_6720];
/// Most links to links that are followed.
const MOST_LINKS: usize = 40;

/// Why a memory, or what is kept beside it, cannot be where it is to be.
#[derive(Debug, Error)]
pub(crate) enum NoPlace {
    /// A folder, a socket, a block device or the like.
    #[error("it is neither a file nor an MTD character device")]
    Kind,
    /// A character device of another kind.
    #[error("it is a character device, and no MTD device")]
    NoMtd,
    /// A file that is no memory of this size.
    #[error("the file has {bytes} bytes, and `memory_size` is {size}")]
    Size {
        /// What it has.
        bytes: u64,
        /// What it should have.
        size: u32,
    },
    /// A part of the path is a file.
    #[error("{} is no folder", .0.display())]
    NoFolder(PathBuf),
    /// A file system of the kernel's own.
    #[error("nobody can make files in {}", .0.display())]
    Unreal(PathBuf),
    /// It is mounted so that nothing is written.
    #[error("{} is on a file system that is read-only", .0.display())]
    ReadOnly(PathBuf),
    /// The system does not tell.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Whether two paths lead to one file or device, or would, if it were made.
pub(crate) fn is_same(one: &Path, other: &Path) -> bool {
    let (one, other) = (meant(one), meant(other));
    match (fs::metadata(&one), fs::metadata(&other)) {
        (Ok(one), Ok(other)) => identity(&one) == identity(&other),
        _ => one == other,
    }
}

/// Whether a memory of so many bytes can be there, as far as that can be seen.
pub(crate) fn hold_memory(path: &Path, size: u32) -> Result<(), NoPlace> {
    let found = match fs::metadata(path) {
        Ok(found) => found,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return hold_files(meant(path).parent().unwrap_or(Path::new("/")));
        }
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
            return hold_files(path.parent().unwrap_or(Path::new("/")));
        }
        Err(error) => return Err(error.into()),
    };
    let kind = found.file_type();
    if kind.is_char_device() {
        let is_mtd = rustix::fs::major(found.rdev()) == MTD;
        return if is_mtd { Ok(()) } else { Err(NoPlace::NoMtd) };
    }
    if !kind.is_file() {
        return Err(NoPlace::Kind);
    }
    // A shorter one may have been cut short while it was made.
    if found.len() > u64::from(size) {
        return Err(NoPlace::Size { bytes: found.len(), size });
    }
    hold_files(meant(path).parent().unwrap_or(Path::new("/")))
}

/// Whether files can be made in a folder, which is made if it is not there.
pub(crate) fn hold_files(folder: &Path) -> Result<(), NoPlace> {
    let folder = meant(folder);
    let nearest = folder.ancestors().find(|path| fs::symlink_metadata(path).is_ok());
    let nearest = nearest.unwrap_or(Path::new("/"));
    let there = || nearest.to_owned();
    if !fs::metadata(nearest)?.is_dir() {
        return Err(NoPlace::NoFolder(there()));
    }
    // The type has another width on each kind of computer.
    #[allow(clippy::useless_conversion, clippy::unnecessary_cast)]
    let kind = statfs(nearest).map_err(io::Error::from)?.f_type as i64;
    if UNREAL.contains(&kind) {
        return Err(NoPlace::Unreal(there()));
    }
    let flags = statvfs(nearest).map_err(io::Error::from)?.f_flag;
    if flags.contains(StatVfsMountFlags::RDONLY) {
        return Err(NoPlace::ReadOnly(there()));
    }
    Ok(())
}

fn identity(found: &Metadata) -> (bool, u64, u64) {
    let kind = found.file_type();
    if kind.is_char_device() { (true, found.rdev(), 0) } else { (false, found.dev(), found.ino()) }
}

/// The path without links and dots, as far as it is there.
fn meant(path: &Path) -> PathBuf {
    let mut path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for _ in 0..MOST_LINKS {
        let Ok(target) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("/")).join(target);
    }
    let mut missing: Vec<OsString> = Vec::new();
    let mut left = 0;
    let mut there = path.as_path();
    loop {
        if let Ok(found) = there.canonicalize() {
            return missing.into_iter().rev().fold(found, |path, name| path.join(name));
        }
        let Some(parent) = there.parent() else { return path };
        match there.file_name() {
            // A folder that is not there is left again.
            None => left += 1,
            Some(_) if left > 0 => left -= 1,
            Some(name) => missing.push(name.to_owned()),
        }
        there = parent;
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn one_file_has_many_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("state")).unwrap();
        symlink("state", at("also")).unwrap();
        symlink("state/mill.slots", at("link.slots")).unwrap();
        let same =
            ["state/mill.slots", "state/./mill.slots", "none/../state/mill.slots", "link.slots"];
        for _ in 0..2 {
            for one in same {
                assert!(same.iter().all(|other| is_same(&at(one), &at(other))), "{one}");
                assert!(!is_same(&at(one), &at("state/lathe.slots")), "{one}");
            }
            // First it is not there, then it is.
            fs::write(at("state/mill.slots"), "").unwrap();
        }
        fs::hard_link(at("state/mill.slots"), at("hard.slots")).unwrap();
        assert!(is_same(&at("hard.slots"), &at("link.slots")));
        assert!(is_same(Path::new("/dev/null"), Path::new("/dev/./null")));
    }

    #[test]
    fn what_can_be_no_memory_is_seen_without_writing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, vec![0xFF; 70_000]).unwrap();
        let seen = |path: &Path| hold_memory(path, 65_536).map_err(|error| error.to_string());
        let cases = [
            (PathBuf::from("/"), "neither a file"),
            (PathBuf::from("/dev/null"), "no MTD device"),
            (PathBuf::from("/proc/x"), "nobody can make files in /proc"),
            (file.clone(), "has 70000 bytes"),
            (file.join("x"), "is no folder"),
            (file.join("x/y"), "is no folder"),
        ];
        for (path, part) in cases {
            let said = seen(&path).unwrap_err();
            assert!(said.contains(part), "{}: {said}", path.display());
        }
        assert_eq!(seen(&folder.path().join("a/b/mill.slots")), Ok(()));
        assert!(!folder.path().join("a").exists());
    }
}
