//! The folders of programs. A name is a list of plain words: none leads out.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use softplug_catalogue::{HEAD_BYTES, Notations, is_same_program};
use softplug_live::store::{Shelf, safe_name, sync_folder};

use super::{Data, ProgramError, Snapshots};
use crate::disk::{self, DiskError, make_folder};

/// Folders within folders, at most.
const DEPTH: usize = 5;
/// Of more programs than this no list is made.
const LISTED: usize = 20_000;

/// `O1234.nc`, `lathes/O1234.nc`.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct ProgramName(String);

impl ProgramName {
    /// As text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for ProgramName {
    type Err = ProgramError;

    fn from_str(text: &str) -> Result<Self, ProgramError> {
        let is_plain = |part: &str| safe_name(part).is_some_and(|safe| safe == part);
        let parts = text.split('/').count();
        if parts > DEPTH || !text.split('/').all(is_plain) {
            return Err(ProgramError::Name(
                text.chars().take(80).flat_map(char::escape_debug).collect(),
            ));
        }
        Ok(Self(text.to_owned()))
    }
}

impl fmt::Display for ProgramName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A program in a folder.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Program {
    /// Its name, with its folders.
    pub name: String,
    /// Bytes.
    pub size: u64,
    /// When it was written, in milliseconds since 1970.
    pub modified: u64,
}

/// The folders of programs of a gateway. New ones go into the first.
#[derive(Clone, Debug)]
pub struct Programs {
    /// Without links in their paths.
    roots: Vec<PathBuf>,
}

impl Programs {
    /// The folders, which are made if need be.
    ///
    /// # Errors
    /// One cannot be made.
    pub fn open(folders: &[PathBuf]) -> Result<Self, DiskError> {
        let root = |folder: &PathBuf| {
            make_folder(folder)?;
            folder.canonicalize().map_err(DiskError::when("read the folder", folder))
        };
        Ok(Self { roots: folders.iter().map(root).collect::<Result<_, _>>()? })
    }

    /// All programs, by name. One that stands in two folders is the first one's.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn list(&self) -> Result<Vec<Program>, DiskError> {
        let mut programs: Vec<Program> = Vec::new();
        for root in &self.roots {
            let mut found = Vec::new();
            list(root, root, "", DEPTH, &mut found)?;
            programs.extend(found);
        }
        programs.sort_by(|one, other| one.name.cmp(&other.name));
        programs.dedup_by(|later, first| later.name == first.name);
        Ok(programs)
    }

    /// A program, to be read.
    ///
    /// # Errors
    /// There is none of this name, or it cannot be read.
    pub fn download(&self, name: &ProgramName) -> Result<(File, Program), ProgramError> {
        let path = self.find(name)?;
        let file = disk::open(&path).map_err(DiskError::when("read", &path))?;
        let metadata = file.metadata().map_err(DiskError::when("read", &path))?;
        Ok((file, program(name.to_string(), &metadata)))
    }

    /// Its content as it is now, for a job.
    ///
    /// # Errors
    /// There is none of this name, it is empty or being written, or the disk would not take it.
    pub fn snapshot(
        &self,
        name: &ProgramName,
        snapshots: &Snapshots,
    ) -> Result<Data, ProgramError> {
        snapshots.take(&self.find(name)?, name.as_str())
    }

    /// Keeps a program. It is on the disk, whole, when this returns, and not there before.
    ///
    /// # Errors
    /// The name is taken, what gives it fails, it is too large, or the disk would not take it.
    pub fn upload(
        &self,
        name: &ProgramName,
        from: &mut dyn Read,
        most: u64,
        replace: bool,
    ) -> Result<Program, ProgramError> {
        let there = self.find(name).ok();
        if there.is_some() && !replace {
            return Err(ProgramError::Exists(name.to_string()));
        }
        // What is replaced is replaced where it is.
        let has_it = |root: &&PathBuf| there.as_ref().is_some_and(|there| there.starts_with(root));
        let root = self.roots.iter().find(has_it).or(self.roots.first());
        let root = root.ok_or(ProgramError::NoFolder)?;
        let path = root.join(name.as_str());
        let folder = path.parent().unwrap_or(root);
        if let Some(there) = folder.ancestors().find(|folder| folder.exists())
            && !is_inside(there, root)
        {
            return Err(ProgramError::Name(name.to_string()));
        }
        let is_program = folder.ancestors().take_while(|of| *of != root).any(Path::is_file);
        if is_program || path.is_dir() {
            return Err(ProgramError::InTheWay(name.to_string()));
        }
        make_folder(folder)?;
        let mut file = disk::temporary_beside(&path).map_err(DiskError::when("write", &path))?;
        // A program that is replaced by nothing is a mistake.
        if copy(from, file.as_file_mut(), most, &path)? == 0 {
            return Err(ProgramError::Empty(name.to_string()));
        }
        let placed = || {
            file.as_file().sync_all()?;
            open_to_others(file.as_file())?;
            if replace {
                file.persist(&path)?
            } else {
                file.persist_noclobber(&path)?
            };
            sync_folder(folder)?;
            fs::metadata(&path)
        };
        match placed() {
            Ok(metadata) => Ok(program(name.to_string(), &metadata)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                Err(ProgramError::Exists(name.to_string()))
            }
            Err(error) => Err(DiskError::when("write", &path)(error).into()),
        }
    }

    /// Removes a program. Jobs that send it go on.
    ///
    /// # Errors
    /// There is none of this name, or it cannot be removed.
    pub fn delete(&self, name: &ProgramName) -> Result<(), ProgramError> {
        Ok(disk::remove(&self.find(name)?)?)
    }

    /// The program that a machine means by `asked`, in the first of these folders that has one.
    /// An empty name of a folder means the folders of programs themselves.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn search(
        &self,
        folders: &[String],
        asked: &str,
    ) -> Result<Option<ProgramName>, DiskError> {
        let found =
            self.search_with(folders, &mut |shelf| Ok(shelf.find(asked)?.into_iter().collect()))?;
        Ok(found.into_iter().next())
    }

    /// The programs whose text says that they are called `asked`, in the first of these folders
    /// that has one: two at most, as one of two is a guess.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn search_text(
        &self,
        folders: &[String],
        asked: &str,
        notations: &Notations,
    ) -> Result<Vec<ProgramName>, DiskError> {
        let mut is_it =
            |head: &[u8]| notations.name_in(head).is_some_and(|name| is_same_program(&name, asked));
        self.search_with(folders, &mut |shelf| shelf.find_by_text(HEAD_BYTES, &mut is_it))
    }

    fn search_with(
        &self,
        folders: &[String],
        find: &mut dyn FnMut(&Shelf) -> io::Result<Vec<PathBuf>>,
    ) -> Result<Vec<ProgramName>, DiskError> {
        for folder in folders {
            let folder = folder.trim_matches('/');
            if !folder.is_empty() && folder.parse::<ProgramName>().is_err() {
                continue;
            }
            for root in &self.roots {
                let path = root.join(folder);
                if !is_inside(&path, root) {
                    continue;
                }
                let Ok(shelf) = Shelf::new(&path) else { continue };
                let found = find(&shelf).map_err(DiskError::when("read the folder", &path))?;
                if found.is_empty() {
                    continue;
                }
                let names = found.iter().filter_map(|path| path.file_name()?.to_str());
                let below = |name: &str| match folder {
                    "" => name.to_owned(),
                    folder => format!("{folder}/{name}"),
                };
                return Ok(names.filter_map(|name| below(name).parse().ok()).collect());
            }
        }
        Ok(Vec::new())
    }

    fn find(&self, name: &ProgramName) -> Result<PathBuf, ProgramError> {
        let paths = self.roots.iter().map(|root| (root, root.join(name.as_str())));
        let mut files = paths.filter(|(root, path)| path.is_file() && is_inside(path, root));
        let found = files.next().map(|(_, path)| path);
        found.ok_or_else(|| ProgramError::NotFound(name.to_string()))
    }
}

/// Also where links lead.
fn is_inside(path: &Path, root: &Path) -> bool {
    path.canonicalize().is_ok_and(|real| real.starts_with(root))
}

fn list(
    root: &Path,
    folder: &Path,
    prefix: &str,
    depth: usize,
    found: &mut Vec<Program>,
) -> Result<(), DiskError> {
    for name in disk::names_in(folder)? {
        let path = folder.join(&name);
        let full = format!("{prefix}{name}");
        if found.len() >= LISTED || full.parse::<ProgramName>().is_err() || !is_inside(&path, root)
        {
            continue;
        }
        let Ok(metadata) = fs::metadata(&path) else { continue };
        if metadata.is_file() {
            found.push(program(full, &metadata));
        } else if metadata.is_dir() && depth > 1 && !path.is_symlink() {
            list(root, &path, &format!("{full}/"), depth - 1, found)?;
        }
    }
    Ok(())
}

fn program(name: String, metadata: &fs::Metadata) -> Program {
    let modified = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let modified = modified.map_or(0, |since| since.as_millis() as u64);
    Program { name, size: metadata.len(), modified }
}

fn copy(from: &mut dyn Read, to: &mut File, most: u64, path: &Path) -> Result<u64, ProgramError> {
    let mut buffer = vec![0; 64 * 1024];
    let mut bytes = 0;
    loop {
        let count = match from.read(&mut buffer) {
            Ok(0) => return Ok(bytes),
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(ProgramError::Source(error)),
        };
        bytes += count as u64;
        if bytes > most {
            return Err(ProgramError::TooLarge { most });
        }
        to.write_all(&buffer[..count]).map_err(DiskError::when("write", path))?;
    }
}

/// A temporary file is its maker's alone; programs are everybody's to read.
#[cfg(unix)]
fn open_to_others(file: &File) -> io::Result<()> {
    file.set_permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644))
}

#[cfg(not(unix))]
fn open_to_others(_: &File) -> io::Result<()> {
    Ok(())
}
