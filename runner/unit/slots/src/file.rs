//! A file that behaves as a flash memory does, for trying.

use crate::device::{Device, Geometry};
use std::borrow::ToOwned;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::vec;
use std::vec::Vec;

/// A file that is being made has this behind its name.
const MAKING: &str = ".new";
/// Most links to links that are followed.
const MOST_LINKS: usize = 40;

/// A file as a device. Each erasure and each programming is on the disk when it returns.
///
/// ```
/// use softplug_unit_slots::{Device, FileDevice, Geometry};
///
/// let folder = tempfile::tempdir()?;
/// let geometry = Geometry { size: 65_536, erase: 4_096, granule: 4 };
/// let mut file = FileDevice::open(&folder.path().join("unit.bin"), geometry)?;
/// file.program(8, b"soft")?;
/// assert!(file.program(8, b"plug").is_err());
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// Nobody else has it as a device meanwhile, in this process or in another one: the file is locked
/// as long as it is open.
#[derive(Debug)]
pub struct FileDevice {
    file: File,
    geometry: Geometry,
}

impl FileDevice {
    /// Opens a file of this size, or makes one that is erased.
    ///
    /// One that was cut short while it was made is made to its end: it is shorter, and has nothing
    /// in it.
    ///
    /// # Errors
    /// The file cannot be opened or made, or has another size, or the geometry is not sound; with
    /// [`ErrorKind::ResourceBusy`], somebody else has it.
    pub fn open(path: &Path, geometry: Geometry) -> io::Result<Self> {
        if !geometry.is_sound() {
            let message = "a device with such sizes cannot be";
            return Err(io::Error::new(ErrorKind::InvalidInput, message));
        }
        let path = &behind_links(path);
        let mut file = match OpenOptions::new().read(true).write(true).open(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return make(path, geometry),
            opened => opened?,
        };
        lock(&file)?;
        if file.metadata()?.len() != u64::from(geometry.size) {
            must_be_unfinished(&mut file, geometry)?;
            fill(&mut file, geometry)?;
        }
        Ok(Self { file, geometry })
    }

    fn put(&mut self, at: u32, bytes: &[u8]) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(at.into()))?;
        self.file.write_all(bytes)?;
        self.file.sync_data()
    }

    fn must_hold(&self, at: u32, length: usize) -> io::Result<()> {
        let end = u64::from(at) + length as u64;
        if end <= u64::from(self.geometry.size) {
            Ok(())
        } else {
            Err(ErrorKind::InvalidInput.into())
        }
    }
}

impl Device for FileDevice {
    type Error = io::Error;

    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(at.into()))?;
        self.file.read_exact(into)
    }

    fn erase(&mut self, at: u32, length: u32) -> io::Result<()> {
        self.must_hold(at, length as usize)?;
        self.put(at, &vec![0xFF; length as usize])
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> io::Result<()> {
        self.must_hold(at, bytes.len())?;
        let mut before: Vec<u8> = vec![0; bytes.len()];
        self.read(at, &mut before)?;
        if before.iter().any(|byte| *byte != 0xFF) {
            let message = "these bytes were programmed before and not erased since";
            return Err(io::Error::new(ErrorKind::InvalidInput, message));
        }
        self.put(at, bytes)
    }
}

/// A file under its name is whole, and locked already: it is made under another one.
fn make(path: &Path, geometry: Geometry) -> io::Result<FileDevice> {
    let mut name = path.file_name().ok_or(ErrorKind::InvalidInput)?.to_owned();
    name.push(MAKING);
    let unfinished = path.with_file_name(name);
    let mut file =
        OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&unfinished)?;
    lock(&file)?;
    // Somebody else may have been quicker: its file was this one a moment ago, or is another.
    let is_taken = fs::symlink_metadata(path).is_ok() || fs::symlink_metadata(&unfinished).is_err();
    let made = if is_taken {
        Err(busy())
    } else {
        fill(&mut file, geometry).and_then(|()| fs::rename(&unfinished, path))
    };
    if let Err(error) = made {
        let _ = fs::remove_file(&unfinished);
        return Err(error);
    }
    sync_folder(path)?;
    Ok(FileDevice { file, geometry })
}

fn fill(file: &mut File, geometry: Geometry) -> io::Result<()> {
    file.rewind()?;
    file.write_all(&vec![0xFF; geometry.size as usize])?;
    file.sync_all()
}

/// What was cut short while it was made has no byte that was programmed: after a loss of power, a
/// file system may give zeros for what it had not written yet.
fn must_be_unfinished(file: &mut File, geometry: Geometry) -> io::Result<()> {
    let mut bytes = Vec::new();
    Read::by_ref(file).take(geometry.size.into()).read_to_end(&mut bytes)?;
    let is_short = bytes.len() < geometry.size as usize;
    if is_short && bytes.iter().all(|byte| matches!(byte, 0x00 | 0xFF)) {
        return Ok(());
    }
    let message = "the file has another size than the device";
    Err(io::Error::new(ErrorKind::InvalidData, message))
}

/// Takes what is open for this process alone, until it is closed.
pub(crate) fn lock(file: &File) -> io::Result<()> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(busy()),
        // A device or a file system without locks is used all the same.
        Err(TryLockError::Error(error))
            if matches!(error.kind(), ErrorKind::Unsupported | ErrorKind::InvalidInput) =>
        {
            Ok(())
        }
        Err(TryLockError::Error(error)) => Err(error),
    }
}

fn busy() -> io::Error {
    io::Error::new(ErrorKind::ResourceBusy, "somebody else has it open as a memory for plug-ins")
}

/// The file that a path means, there or not.
fn behind_links(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(target) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    path
}

/// A name outlives a loss of power only then.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}
