//! The slots' flash, and a block of it that counts starts.
//!
//! QEMU's board has RAM where a product has flash. It is used as NOR flash would be: erased in blocks of 4 KiB to FF,
//! programmed once. It outlives a reset of the board, as flash does, and not the end of QEMU.
//!
//! The unsafe code here reads and writes these bytes, which the linker gives to nothing else (memory.x). A plug-in that
//! runs is read by reference ([`Flash::code`]); the slots erase and program only the other slot then.
#![allow(unsafe_code)]

use core::{ptr, slice};
use softplug_unit_slots::{Device, Geometry};
use thiserror::Error;

const STARTS: usize = 0x0007_F000;
const SLOTS: usize = 0x0008_0000;
const GEOMETRY: Geometry = Geometry { size: 512 * 1_024, erase: 4_096, granule: 4 };
const ERASED: u32 = u32::MAX;

/// The flash with the slots.
pub(crate) struct Flash;

/// A word was to be programmed that was not erased: the memory has failed.
#[derive(Copy, Clone, Debug, Error)]
#[error("the word at {at:#x} is not erased")]
pub(crate) struct NotErased {
    at: u32,
}

impl Flash {
    /// The bytes at this place of the slots.
    pub(crate) fn code(at: u32, length: u32) -> &'static [u8] {
        let (at, length) = (at as usize, length as usize);
        assert!(at + length <= GEOMETRY.size as usize, "it lies in the slots");
        // SAFETY: inside the slots' flash. It does not change as long as this module runs: the slots write to the
        // other slot only, and one that is no longer run is no longer referred to.
        unsafe { slice::from_raw_parts((SLOTS + at) as *const u8, length) }
    }
}

fn word(at: usize) -> *mut u32 {
    at as *mut u32
}

fn program(at: usize, value: u32) -> Result<(), NotErased> {
    // SAFETY: callers give words of the flash; nothing refers to those that are erased.
    unsafe {
        if ptr::read_volatile(word(at)) != ERASED {
            return Err(NotErased { at: at as u32 });
        }
        ptr::write_volatile(word(at), value);
    }
    Ok(())
}

fn erase(at: usize, length: usize) {
    for place in (at..at + length).step_by(4) {
        // SAFETY: callers give blocks of the flash to which nothing refers.
        unsafe { ptr::write_volatile(word(place), ERASED) }
    }
}

impl Device for Flash {
    type Error = NotErased;

    fn geometry(&self) -> Geometry {
        GEOMETRY
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), NotErased> {
        into.copy_from_slice(Self::code(at, into.len() as u32));
        Ok(())
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), NotErased> {
        assert!(at + length <= GEOMETRY.size, "it lies in the slots");
        erase(SLOTS + at as usize, length as usize);
        Ok(())
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), NotErased> {
        assert!(at as usize + bytes.len() <= GEOMETRY.size as usize, "it lies in the slots");
        let words = bytes.as_chunks::<4>().0;
        for (place, bytes) in (SLOTS + at as usize..).step_by(4).zip(words) {
            program(place, u32::from_le_bytes(*bytes))?;
        }
        Ok(())
    }
}

/// Counts this start: a number that no start before had, as long as the flash keeps.
pub(crate) fn count_start() -> u32 {
    const WORDS: usize = 1_024;
    // SAFETY: the words of this block.
    let read = |nth: usize| unsafe { ptr::read_volatile(word(STARTS + 4 * nth)) };
    // Each start has programmed its number behind the one before.
    let free = (0..WORDS).find(|&nth| read(nth) == ERASED);
    let last = free.unwrap_or(WORDS).checked_sub(1).map_or(0, read);
    let number = last.wrapping_add(1);
    let at = free.unwrap_or_else(|| {
        erase(STARTS, 4 * WORDS);
        0
    });
    // A word that fails is not erased, and the next start takes the one behind it.
    let _ = program(STARTS + 4 * at, number);
    number
}
