//! A device in working memory, for trying.

use crate::device::{Device, Geometry};

/// Bytes in memory that behave as a flash memory does.
///
/// ```
/// use softplug_unit_slots::{Device, Geometry, Misuse, Ram};
///
/// let mut bytes = [0xFF; 8_192];
/// let mut ram = Ram::new(&mut bytes, Geometry { size: 8_192, erase: 1_024, granule: 4 }).unwrap();
/// ram.program(4, &[1, 2, 3, 4])?;
/// assert_eq!(ram.program(4, &[1, 2, 3, 4]), Err(Misuse::NotErased { at: 4 }));
/// assert_eq!(ram.program(9, &[0; 4]), Err(Misuse::Place { at: 9, length: 4 }));
/// ram.erase(0, 1_024)?;
/// assert_eq!(bytes[4], 0xFF);
/// # Ok::<(), Misuse>(())
/// ```
#[derive(Debug)]
pub struct Ram<'a> {
    bytes: &'a mut [u8],
    geometry: Geometry,
}

impl<'a> Ram<'a> {
    /// A device with this content; none if the geometry is not sound or not that of the bytes.
    ///
    /// The example of [`Ram`] shows it.
    pub fn new(bytes: &'a mut [u8], geometry: Geometry) -> Option<Self> {
        let fits = geometry.is_sound() && bytes.len() == geometry.size as usize;
        fits.then_some(Self { bytes, geometry })
    }

    fn part(&mut self, at: u32, length: usize, unit: u32) -> Result<&mut [u8], Misuse> {
        let place = Misuse::Place { at, length };
        if !at.is_multiple_of(unit) || !length.is_multiple_of(unit as usize) {
            return Err(place);
        }
        let from = at as usize;
        let to = from.checked_add(length).ok_or(place)?;
        self.bytes.get_mut(from..to).ok_or(place)
    }
}

impl Device for Ram<'_> {
    type Error = Misuse;

    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), Misuse> {
        let part = self.part(at, into.len(), self.geometry.granule)?;
        into.copy_from_slice(part);
        Ok(())
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), Misuse> {
        self.part(at, length as usize, self.geometry.erase)?.fill(0xFF);
        Ok(())
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Misuse> {
        let part = self.part(at, bytes.len(), self.geometry.granule)?;
        if let Some(place) = part.iter().position(|byte| *byte != 0xFF) {
            return Err(Misuse::NotErased { at: at + place as u32 });
        }
        part.copy_from_slice(bytes);
        Ok(())
    }
}

/// A device was asked for what it must not be asked for: a bug of the caller.
///
/// The example of [`Ram`] shows it.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Misuse {
    /// Address or length are not multiples, or outside the device.
    #[error("{length} bytes at {at:#x} are no whole blocks or granules of the device")]
    Place {
        /// Address.
        at: u32,
        /// Bytes.
        length: usize,
    },
    /// A byte that is to be programmed is not erased.
    #[error("the byte at {at:#x} was programmed before and not erased since")]
    NotErased {
        /// Its address.
        at: u32,
    },
}
