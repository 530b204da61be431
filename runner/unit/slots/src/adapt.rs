//! Drivers that have the traits of `embedded-storage`, as devices.

use crate::device::{Device, Geometry, LARGEST_GRANULE};
use embedded_storage::Storage;
use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind};

/// A NOR flash memory whose driver has `embedded-storage`'s `NorFlash`.
///
/// The granule is the larger of what the driver reads and what it writes at once.
#[derive(Debug)]
pub struct Flash<F>(pub F);

impl<F: NorFlash> Device for Flash<F> {
    type Error = FlashError;

    fn geometry(&self) -> Geometry {
        let granule = if F::WRITE_SIZE > F::READ_SIZE { F::WRITE_SIZE } else { F::READ_SIZE };
        Geometry {
            size: u32::try_from(self.0.capacity()).unwrap_or(0),
            erase: F::ERASE_SIZE as u32,
            granule: granule as u32,
        }
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), FlashError> {
        self.0.read(at, into).map_err(|error| FlashError(error.kind()))
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), FlashError> {
        let to = at.saturating_add(length);
        self.0.erase(at, to).map_err(|error| FlashError(error.kind()))
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.0.write(at, bytes).map_err(|error| FlashError(error.kind()))
    }
}

/// The driver of a flash memory refuses.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the flash driver says: {0}")]
pub struct FlashError(pub NorFlashErrorKind);

/// An EEPROM whose driver has `embedded-storage`'s `Storage`: any byte can be written at any time.
///
/// Erasing writes FF, so every byte of a slot is written twice for a download.
#[derive(Debug)]
pub struct Eeprom<S> {
    /// The driver.
    pub driver: S,
    /// What may be lost at once when power fails during a write, in bytes: it becomes block and granule. Many EEPROMs write a
    /// whole page whatever is written of it; then it is the page's size, as the data sheet has it. 1 for FRAM, and
    /// where the data sheet promises that other bytes stay. More than [`LARGEST_GRANULE`](crate::LARGEST_GRANULE) is refused
    /// when the slots are opened.
    pub page: u32,
}

impl<S: Storage> Device for Eeprom<S>
where
    S::Error: core::error::Error + 'static,
{
    type Error = S::Error;

    fn geometry(&self) -> Geometry {
        let size = u32::try_from(self.driver.capacity()).unwrap_or(0);
        Geometry { size, erase: self.page, granule: self.page }
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), S::Error> {
        self.driver.read(at, into)
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), S::Error> {
        /// Bytes at a time: whole pages, as both are powers of two.
        const ERASED: [u8; LARGEST_GRANULE as usize] = [0xFF; LARGEST_GRANULE as usize];
        let mut done = 0;
        while done < length {
            let next = (length - done).min(LARGEST_GRANULE);
            self.driver.write(at + done, &ERASED[..next as usize])?;
            done += next;
        }
        Ok(())
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), S::Error> {
        self.driver.write(at, bytes)
    }
}
