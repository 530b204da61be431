//! A file that behaves as a flash memory does, for trying.

use crate::device::{Device, Geometry};
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::vec;
use std::vec::Vec;

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
#[derive(Debug)]
pub struct FileDevice {
    file: File,
    geometry: Geometry,
}

impl FileDevice {
    /// Opens a file of this size, or makes one that is erased.
    ///
    /// # Errors
    /// The file cannot be opened or made, or has another size, or the geometry is not sound.
    pub fn open(path: &Path, geometry: Geometry) -> io::Result<Self> {
        if !geometry.is_sound() {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "a device with such sizes cannot be",
            ));
        }
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        match file.metadata()?.len() {
            0 => {
                file.write_all(&vec![0xFF; geometry.size as usize])?;
                file.sync_all()?;
            }
            size if size == u64::from(geometry.size) => {}
            _ => {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "the file has another size than the device",
                ));
            }
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
            Err(io::ErrorKind::InvalidInput.into())
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
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        self.put(at, bytes)
    }
}
