//! Flash memories that Linux has as MTD devices (`/dev/mtdN`).
//!
//! Unsafe, because each request's number must be paired with the type that the kernel reads or writes. What keeps it sound:
//! both pairs stand in this file once, as declared in Linux's `mtd/mtd-abi.h`, both types are `repr(C)` and valid for any
//! bits, and descriptors are borrowed.
#![allow(unsafe_code)]

use crate::device::{Device, Geometry, LARGEST_GRANULE};
use crate::file::lock;
use rustix::ioctl::{Getter, Opcode, Setter, ioctl, opcode};
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt;
use std::path::Path;

const GET_INFO: Opcode = opcode::read::<Info>(b'M', 1);
const ERASE: Opcode = opcode::write::<Extent>(b'M', 2);

/// `MTD_RAM`, `MTD_NORFLASH` and `MTD_DATAFLASH`: what may hold slots.
const KINDS: [u8; 3] = [1, 3, 6];
/// `MTD_WRITEABLE`.
const WRITEABLE: u32 = 0x400;

/// `struct mtd_info_user`.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
struct Info {
    kind: u8,
    flags: u32,
    size: u32,
    erase: u32,
    write: u32,
    spare: u32,
    unused: u64,
}

/// `struct erase_info_user`.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
struct Extent {
    start: u32,
    length: u32,
}

/// A NOR flash memory of Linux. NAND memories are refused: they have bad blocks, which need UBI.
///
/// ```no_run
/// use softplug_unit_slots::{MtdDevice, Options, Slots, Trust};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let device = MtdDevice::open("/dev/mtd3".as_ref())?;
/// let options = Options { trust: Trust::signed(&[[0x3A; 32]]), attempts: 3, most_erases: 50_000 };
/// let mut slots = Slots::open(device, options)?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct MtdDevice {
    file: File,
    geometry: Geometry,
}

impl MtdDevice {
    /// Opens a device and asks for its sizes.
    ///
    /// # Errors
    /// It cannot be opened, is no MTD device, cannot be written, or is of a kind that cannot hold slots;
    /// with [`ErrorKind::ResourceBusy`], somebody else has it by the same name.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        // SAFETY: MEMGETINFO writes one mtd_info_user.
        let info: Info = unsafe { ioctl(&file, Getter::<GET_INFO, Info>::new())? };
        let unsupported = |message| Err(io::Error::new(ErrorKind::Unsupported, message));
        if !KINDS.contains(&info.kind) {
            return unsupported("only NOR flash, data flash and memory can hold slots");
        }
        if info.flags & WRITEABLE == 0 {
            return unsupported("this memory cannot be written");
        }
        lock(&file)?;
        let geometry = Geometry { size: info.size, erase: info.erase, granule: info.write };
        if !geometry.is_sound() || info.write > LARGEST_GRANULE {
            return unsupported("memories with such blocks or granules cannot hold slots");
        }
        Ok(Self { file, geometry })
    }
}

impl Device for MtdDevice {
    type Error = io::Error;

    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> io::Result<()> {
        self.file.read_exact_at(into, at.into())
    }

    fn erase(&mut self, at: u32, length: u32) -> io::Result<()> {
        // Block by block: some drivers do not give the processor away before they are done.
        for start in (at..at.saturating_add(length)).step_by(self.geometry.erase as usize) {
            let extent = Extent { start, length: self.geometry.erase };
            // SAFETY: MEMERASE reads one erase_info_user.
            unsafe { ioctl(&self.file, Setter::<ERASE, Extent>::new(extent))? };
        }
        Ok(())
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all_at(bytes, at.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_those_of_the_kernel() {
        assert_eq!((size_of::<Info>(), size_of::<Extent>()), (32, 8));
        if cfg!(target_arch = "x86_64") {
            assert_eq!((GET_INFO, ERASE), (0x8020_4D01, 0x4008_4D02));
        }
    }

    #[test]
    fn a_file_is_no_flash_memory() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, [0xFF; 4_096]).unwrap();
        let error = MtdDevice::open(&path).unwrap_err();
        assert_eq!(error.raw_os_error(), Some(25), "{error}");
    }
}
