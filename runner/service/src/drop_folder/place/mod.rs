//! A drop folder on the disk or on a share: what is listed, claimed and put away there.
//!
//! Whoever may write into the folder may put anything there. So nothing is found by a path: each
//! folder is opened once, no symbolic link is followed below the drop folder, and only files are read.
//!
//! ```text
//! O1.nc                     put here by somebody
//! work/.owner               whose folder it is
//! work/CLAIM/O1.nc          claimed: it becomes a job, or is one
//! work/CLAIM/.away          it is being put away
//! done/O1.nc, O1.nc.txt     its last bit has left
//! failed/O1.nc, O1.nc.txt   it has not
//! ```

mod shelf;

pub(super) use shelf::Shelf;

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd as _, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStringExt as _;
use std::path::Path;

use rustix::fs::{AtFlags, CWD, Dir, FileType, Mode, OFlags, RenameFlags, Stat};
use rustix::fs::{mkdirat, openat, renameat, renameat_with, statat, unlinkat};
use rustix::io::Errno;

use super::names::is_passed_over;
use super::settling::FileState;

/// Names that are looked at in one go; what is more than these waits until there are fewer.
const LISTED: usize = 20_000;
const OWNER: &str = ".owner";
/// In the folder of a claim: its file is about to be put away, and if it is not there, it has been.
const AWAY: &str = ".away";
/// Most bytes of it.
const OWNER_BYTES: u64 = 4_096;
/// A claim's name: a time and a random number, in hex digits.
const CLAIM: usize = 13 + 16;

/// An open drop folder.
#[derive(Debug)]
pub(super) struct Place {
    folder: OwnedFd,
    work: OwnedFd,
}

/// What stands in it.
#[derive(Debug, Default)]
pub(super) struct Listing {
    /// Files that may become jobs.
    pub(super) files: BTreeMap<OsString, FileState>,
    /// What is no file, and what it is.
    pub(super) odd: BTreeMap<OsString, &'static str>,
}

/// What the folder of a claim holds.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Held {
    /// What was claimed, or what somebody has put in its place.
    File(OsString),
    /// Nothing: it has been put away.
    PutAway,
    /// Nothing, as somebody has removed it.
    Nothing,
}

/// Whose a drop folder is.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Whose {
    Ours,
    /// What the owner says of itself.
    Theirs(String),
}

/// What is found under the name of a drop folder.
#[derive(Debug)]
pub(super) enum Found {
    /// The folder.
    Place(Place),
    /// Another one than before, as where a share is not mounted: nothing of ours is in it.
    Other,
}

impl Place {
    /// Opens the folder, and makes what belongs into it, unless it `is_known`: then it has that. The
    /// folder itself is never made. Where a share is not mounted, nothing must begin in its place.
    pub(super) fn open(folder: &Path, is_known: bool) -> io::Result<Found> {
        let folder = openat(CWD, folder, OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
        let work = if is_known {
            match child(folder.as_fd(), "work") {
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Other),
                work => work?,
            }
        } else {
            below(folder.as_fd(), "work")?
        };
        if is_known {
            match statat(&work, OWNER, AtFlags::SYMLINK_NOFOLLOW) {
                Err(Errno::NOENT) => return Ok(Found::Other),
                found => found?,
            };
        }
        Ok(Found::Place(Self { folder, work }))
    }

    /// Whose it is; ours from now on if it was nobody's. It gets its owner in one step: of two who
    /// come at once, one is the owner, and the other one is told.
    pub(super) fn whose(&self, owner: &str) -> io::Result<Whose> {
        loop {
            match self.said(OsStr::new(OWNER))? {
                Some(text) if text == owner => return Ok(Whose::Ours),
                Some(text) if text.is_empty() => self.remove_nobody()?,
                Some(text) => return Ok(Whose::Theirs(text)),
                None => self.take_over(owner)?,
            }
        }
    }

    /// What the owner says of itself in this file; none if there is none.
    fn said(&self, file: &OsStr) -> io::Result<Option<String>> {
        let mut text = String::new();
        match read(self.work.as_fd(), file) {
            Ok(file) => file.take(OWNER_BYTES).read_to_string(&mut text)?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        Ok(Some(text))
    }

    /// An empty file is nobody. If it is not empty any more, as another one was quicker, it goes back.
    fn remove_nobody(&self) -> io::Result<()> {
        let aside = beside_owner();
        match renameat(&self.work, OWNER, &self.work, &*aside) {
            Err(Errno::NOENT) => return Ok(()),
            moved => moved?,
        }
        if self.said(&aside)?.is_some_and(|text| !text.is_empty()) {
            match rename_to_new(&self.work, &aside, &self.work, OsStr::new(OWNER)) {
                // It is there again.
                Err(Errno::EXIST) => {}
                moved => return Ok(moved?),
            }
        }
        Ok(unlinkat(&self.work, &*aside, AtFlags::empty())?)
    }

    /// Makes it ours, unless somebody else was quicker.
    fn take_over(&self, owner: &str) -> io::Result<()> {
        let new = beside_owner();
        let written = write_new(&self.work, &new, owner);
        let placed = written.and_then(|()| {
            match rename_to_new(&self.work, &new, &self.work, OsStr::new(OWNER)) {
                Ok(()) => Ok(()),
                Err(Errno::EXIST) => Ok(unlinkat(&self.work, &*new, AtFlags::empty())?),
                Err(error) => Err(error.into()),
            }
        });
        if placed.is_err() {
            let _ = unlinkat(&self.work, &*new, AtFlags::empty());
        }
        placed
    }

    /// What stands in the folder.
    pub(super) fn list(&self) -> io::Result<Listing> {
        let mut listing = Listing::default();
        for name in names(self.folder.as_fd())? {
            if is_passed_over(&name) {
                continue;
            }
            let Ok(found) = statat(&self.folder, &*name, AtFlags::SYMLINK_NOFOLLOW) else {
                continue;
            };
            match FileType::from_raw_mode(found.st_mode) {
                FileType::RegularFile if Shelf::is_name(&name) => {
                    listing.odd.insert(name, "a file where a folder of the gateway belongs");
                }
                FileType::RegularFile => drop(listing.files.insert(name, state(&found))),
                // Folders are for people to keep order in.
                FileType::Directory => {}
                kind => drop(listing.odd.insert(name, what(kind))),
            }
        }
        Ok(listing)
    }

    /// Opens a file of the folder for reading, without taking it.
    pub(super) fn peek(&self, name: &OsStr) -> io::Result<File> {
        read(self.folder.as_fd(), name)
    }

    /// Takes a file out of the folder under this claim.
    pub(super) fn claim(&self, name: &OsStr, claim: &str) -> io::Result<()> {
        mkdirat(&self.work, claim, mode(0o777))?;
        let moved = child(self.work.as_fd(), claim).and_then(|to| {
            renameat(&self.folder, name, &to, name)?;
            Ok(to)
        });
        match moved {
            Ok(to) => {
                for folder in [&to, &self.work, &self.folder] {
                    sync(folder);
                }
                Ok(())
            }
            Err(error) => {
                let _ = unlinkat(&self.work, claim, AtFlags::REMOVEDIR);
                Err(error)
            }
        }
    }

    /// All claims, the oldest first.
    pub(super) fn claims(&self) -> io::Result<Vec<String>> {
        let is_claim = |name: &String| {
            name.len() == CLAIM && name.bytes().all(|byte| byte.is_ascii_hexdigit())
        };
        let names = names(self.work.as_fd())?.into_iter();
        let mut claims: Vec<String> =
            names.filter_map(|name| name.into_string().ok()).filter(is_claim).collect();
        claims.sort_unstable();
        Ok(claims)
    }

    /// What stands in the folder of a claim.
    pub(super) fn claimed(&self, claim: &str) -> io::Result<Held> {
        let folder = match child(self.work.as_fd(), claim) {
            Err(error) if is_missing(&error) => return Ok(Held::Nothing),
            folder => folder?,
        };
        let mut names = names(folder.as_fd())?;
        let is_away = names.iter().any(|name| name == AWAY);
        names.retain(|name| name != AWAY);
        Ok(match names.into_iter().min() {
            Some(name) => Held::File(name),
            None if is_away => Held::PutAway,
            None => Held::Nothing,
        })
    }

    /// Opens the file of a claim. `None`: it is no file.
    pub(super) fn read(&self, claim: &str, name: &OsStr) -> io::Result<Option<File>> {
        let folder = child(self.work.as_fd(), claim)?;
        let found = statat(&folder, name, AtFlags::SYMLINK_NOFOLLOW)?;
        if FileType::from_raw_mode(found.st_mode) != FileType::RegularFile {
            return Ok(None);
        }
        read(folder.as_fd(), name).map(Some)
    }

    /// Removes the folder of a claim, if no file is in it.
    pub(super) fn forget(&self, claim: &str) {
        if let Ok(folder) = child(self.work.as_fd(), claim) {
            let _ = unlinkat(&folder, AWAY, AtFlags::empty());
        }
        let _ = unlinkat(&self.work, claim, AtFlags::REMOVEDIR);
        sync(&self.work);
    }
}

pub(super) fn state_of(file: &File) -> io::Result<FileState> {
    Ok(state(&rustix::fs::fstat(file)?))
}

fn state(found: &Stat) -> FileState {
    FileState {
        inode: found.st_ino,
        size: u64::try_from(found.st_size).unwrap_or(0),
        modified: (found.st_mtime, found.st_mtime_nsec as i64),
        changed: (found.st_ctime, found.st_ctime_nsec as i64),
    }
}

fn mode(bits: u32) -> Mode {
    Mode::from_raw_mode(bits)
}

/// A folder of this one, which is made if need be.
fn below(folder: BorrowedFd<'_>, name: &str) -> io::Result<OwnedFd> {
    match mkdirat(folder, name, mode(0o777)) {
        Ok(()) | Err(Errno::EXIST) => child(folder, name),
        // What is there is there, also where nothing may be made.
        Err(error) => child(folder, name).map_err(|_| error.into()),
    }
}

fn child(folder: BorrowedFd<'_>, name: &str) -> io::Result<OwnedFd> {
    let flags = OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    Ok(openat(folder, name, flags, Mode::empty())?)
}

/// Neither a link is followed, nor a pipe waited for.
fn read(folder: BorrowedFd<'_>, name: &OsStr) -> io::Result<File> {
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let file = File::from(openat(folder, name, flags, Mode::empty())?);
    if file.metadata()?.is_file() { Ok(file) } else { Err(io::Error::other("it is no file")) }
}

fn names(folder: BorrowedFd<'_>) -> io::Result<Vec<OsString>> {
    let mut names = Vec::new();
    for entry in Dir::read_from(folder)? {
        let name = entry?.file_name().to_bytes().to_vec();
        if name != b"." && name != b".." {
            names.push(OsString::from_vec(name));
        }
        if names.len() == LISTED {
            break;
        }
    }
    Ok(names)
}

/// A name that nobody else uses.
fn beside_owner() -> OsString {
    format!("{OWNER}-{:016x}", RandomState::new().build_hasher().finish()).into()
}

/// Writes a file that only we know, until all of it is there.
fn write_new(folder: &OwnedFd, name: &OsStr, text: &str) -> io::Result<()> {
    let flags =
        OFlags::WRONLY | OFlags::CREATE | OFlags::TRUNC | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let mut file = File::from(openat(folder, name, flags, mode(0o666))?);
    file.write_all(text.as_bytes()).and_then(|()| file.sync_all())
}

/// Never overwrites. Some shares have no such rename: there it is looked first.
fn rename_to_new(from: &OwnedFd, name: &OsStr, to: &OwnedFd, new: &OsStr) -> Result<(), Errno> {
    match renameat_with(from, name, to, new, RenameFlags::NOREPLACE) {
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => {
            if statat(to, new, AtFlags::SYMLINK_NOFOLLOW).is_ok() {
                return Err(Errno::EXIST);
            }
            renameat(from, name, to, new)
        }
        renamed => renamed,
    }
}

/// Some shares cannot bring a folder onto the disk, and say so: then it is theirs to see to.
fn sync(folder: &OwnedFd) {
    let _ = rustix::fs::fsync(folder);
}

/// Whether there is no such folder.
fn is_missing(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

fn what(kind: FileType) -> &'static str {
    match kind {
        FileType::Symlink => "a symbolic link",
        FileType::Fifo => "a pipe",
        FileType::Socket => "a socket",
        FileType::CharacterDevice | FileType::BlockDevice => "a device",
        _ => "no file",
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    const ONE: &str = "00000000000010000000000000001";
    const TWO: &str = "00000000000020000000000000002";

    fn names_in(path: &Path) -> Vec<String> {
        let entries = fs::read_dir(path).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort_unstable();
        names
    }

    fn opened(folder: &Path) -> Place {
        match Place::open(folder, false).unwrap() {
            Found::Place(place) => place,
            Found::Other => panic!("it is new"),
        }
    }

    #[test]
    fn of_many_who_come_at_once_one_is_the_owner() {
        // Nobody was there, or somebody has said that nobody is.
        for (before, names) in [(None, &["a", "b", "c", "d"][..]), (Some(""), &["a", "b"])] {
            let folder = tempfile::tempdir().unwrap();
            let place = opened(folder.path());
            for _ in 0..50 {
                let owner = folder.path().join("work/.owner");
                let _ = fs::remove_file(&owner);
                if let Some(text) = before {
                    fs::write(&owner, text).unwrap();
                }
                let come = |name: &'static str| place.whose(name).unwrap() == Whose::Ours;
                let owners = std::thread::scope(|scope| {
                    let who: Vec<_> =
                        names.iter().map(|name| scope.spawn(move || come(name))).collect();
                    who.into_iter().map(|one| u32::from(one.join().unwrap())).sum::<u32>()
                });
                assert_eq!(owners, 1, "{before:?}");
            }
            assert_eq!(names_in(&folder.path().join("work")), [".owner"]);
        }
    }

    #[test]
    fn a_file_is_claimed_and_put_away_beside_its_result_and_nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let place = opened(folder.path());
        assert!(matches!(place.whose("me").unwrap(), Whose::Ours));
        assert!(matches!(place.whose("me").unwrap(), Whose::Ours));
        assert_eq!(place.whose("you").unwrap(), Whose::Theirs("me".to_owned()));
        for (claim, text) in [(ONE, "first"), (TWO, "second")] {
            fs::write(at("O1.nc"), text).unwrap();
            place.claim(OsStr::new("O1.nc"), claim).unwrap();
        }
        assert_eq!(place.claims().unwrap(), [ONE, TWO]);
        let Held::File(name) = place.claimed(ONE).unwrap() else { panic!("it is there") };
        let put = |claim, tag, text| place.put_away(claim, Shelf::Done, &name, tag, text).unwrap();
        assert_eq!(put(ONE, "7", "job 7"), "O1.nc");
        assert_eq!(put(TWO, "8", "job 8"), "O1-8.nc");
        assert_eq!(names_in(&at("done")), ["O1-8.nc", "O1-8.nc.txt", "O1.nc", "O1.nc.txt"]);
        assert_eq!(fs::read_to_string(at("done/O1-8.nc")).unwrap(), "second");
        assert_eq!(fs::read_to_string(at("done/O1.nc.txt")).unwrap(), "job 7");
        // Whoever comes after a kill knows that nobody has removed them.
        for claim in [ONE, TWO] {
            assert_eq!(place.claimed(claim).unwrap(), Held::PutAway);
            place.forget(claim);
            assert_eq!(place.claimed(claim).unwrap(), Held::Nothing);
        }
        assert_eq!(place.claims().unwrap(), [""; 0]);
    }

    #[test]
    fn what_was_broken_off_between_result_and_file_has_one_result() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let place = opened(folder.path());
        fs::write(at("O1.nc"), "G1").unwrap();
        place.claim(OsStr::new("O1.nc"), ONE).unwrap();
        fs::create_dir(at("done")).unwrap();
        fs::write(at("done/O1.nc.txt"), "job 7").unwrap();
        fs::write(at("done").join(format!(".{ONE}")), "jo").unwrap();
        let name = OsStr::new("O1.nc");
        assert_eq!(place.put_away(ONE, Shelf::Done, name, "7", "job 7").unwrap(), "O1.nc");
        assert_eq!(names_in(&at("done")), ["O1.nc", "O1.nc.txt"]);
    }

    #[test]
    fn nothing_below_is_reached_through_a_symbolic_link() {
        let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let at = |name: &str| folder.path().join(name);
        symlink(other.path(), at("work")).unwrap();
        assert!(Place::open(folder.path(), false).is_err());
        fs::remove_file(at("work")).unwrap();
        let place = opened(folder.path());
        symlink(other.path(), at("done")).unwrap();
        fs::write(at("O1.nc"), "G1").unwrap();
        place.claim(OsStr::new("O1.nc"), ONE).unwrap();
        assert!(place.put_away(ONE, Shelf::Done, OsStr::new("O1.nc"), "7", "job 7").is_err());
        assert_eq!(names_in(other.path()), [""; 0]);
        // A link that came in the place of a file is never read.
        fs::write(other.path().join("secret"), "secret").unwrap();
        symlink(other.path().join("secret"), at("O2.nc")).unwrap();
        assert!(place.peek(OsStr::new("O2.nc")).is_err());
        place.claim(OsStr::new("O2.nc"), TWO).unwrap();
        assert!(place.read(TWO, OsStr::new("O2.nc")).unwrap().is_none());
        symlink("x", at("O3")).unwrap();
        let listing = place.list().unwrap();
        assert!(listing.files.is_empty());
        let odd = ["O3", "done"].map(|name| (OsString::from(name), "a symbolic link"));
        assert_eq!(listing.odd, BTreeMap::from(odd));
    }

    #[test]
    fn a_file_that_is_called_like_a_folder_of_ours_is_no_program() {
        let folder = tempfile::tempdir().unwrap();
        let place = opened(folder.path());
        for name in ["done", "failed", "failed.nc"] {
            fs::write(folder.path().join(name), "G1").unwrap();
        }
        let listing = place.list().unwrap();
        assert_eq!(listing.files.into_keys().collect::<Vec<_>>(), ["failed.nc"]);
        assert_eq!(listing.odd.into_keys().collect::<Vec<_>>(), ["done", "failed"]);
    }

    #[test]
    fn the_folder_itself_is_never_made() {
        let folder = tempfile::tempdir().unwrap();
        let error = Place::open(&folder.path().join("share"), false).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        assert_eq!(names_in(folder.path()), [""; 0]);
        // Nor is anything in a folder that is not the one that is known.
        let other = || matches!(Place::open(folder.path(), true).unwrap(), Found::Other);
        assert!(other());
        assert_eq!(names_in(folder.path()), [""; 0]);
        fs::create_dir(folder.path().join("work")).unwrap();
        assert!(other());
        fs::write(folder.path().join("work/.owner"), "").unwrap();
        assert!(!other());
    }
}
