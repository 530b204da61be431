//! What a memory has to be able to do.

use core::error::Error;

/// The largest granule that the layout has room for, in bytes.
pub const LARGEST_GRANULE: u32 = 256;

/// A memory that is erased in blocks and programmed in granules, as NOR flash is.
///
/// Erasing sets every bit. Programming only clears bits, and each granule is programmed at most once
/// between two erasures: memories with an error correction need that. Power that fails meanwhile may leave anything in
/// the blocks that were being erased and in the granules that were being programmed, and changes nothing else.
///
/// There are [`Flash`](crate::Flash) and [`Eeprom`](crate::Eeprom) for drivers with the traits of `embedded-storage`,
/// [`Ram`](crate::Ram) for trying, and with the feature `std` files and Linux' MTD devices. The traits
/// of `embedded-storage` themselves have their geometry in constants; that of an MTD device is known when it is opened.
///
/// The example of [`Slots`](crate::Slots) uses one.
pub trait Device {
    /// Why the device does not do what it was asked for.
    type Error: Error + 'static;

    /// Its sizes. They never change.
    fn geometry(&self) -> Geometry;

    /// Reads bytes. Address and length are multiples of the granule and inside the device.
    ///
    /// # Errors
    /// The device cannot. It is asked again, and what stays unreadable counts as damaged.
    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), Self::Error>;

    /// Sets all bytes to FF. Address and length are multiples of the erase block and inside the device.
    ///
    /// # Errors
    /// The device cannot; what is in these blocks is not known then.
    fn erase(&mut self, at: u32, length: u32) -> Result<(), Self::Error>;

    /// Programs bytes that are erased. Address and length are multiples of the granule and inside the device. When it
    /// returns, the bytes survive a loss of power.
    ///
    /// # Errors
    /// The device cannot; what is in these granules is not known then.
    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Self::Error>;
}

impl<D: Device + ?Sized> Device for &mut D {
    type Error = D::Error;

    fn geometry(&self) -> Geometry {
        (**self).geometry()
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), Self::Error> {
        (**self).read(at, into)
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), Self::Error> {
        (**self).erase(at, length)
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        (**self).program(at, bytes)
    }
}

/// Sizes of a device, in bytes.
///
/// ```
/// use softplug_unit_slots::Geometry;
///
/// let flash = Geometry { size: 1 << 20, erase: 4_096, granule: 1 };
/// assert!(flash.is_sound());
/// assert!(!Geometry { granule: 3, ..flash }.is_sound());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Geometry {
    /// The whole device: a multiple of `erase`.
    pub size: u32,
    /// What is erased at once: a multiple of `granule`. 1 for an EEPROM.
    pub erase: u32,
    /// What is programmed at once, or may be lost at once when power fails: a power of two, at most [`LARGEST_GRANULE`].
    pub granule: u32,
}

impl Geometry {
    /// Whether these sizes fit together.
    ///
    /// The example of [`Geometry`] shows it.
    pub const fn is_sound(self) -> bool {
        self.granule.is_power_of_two()
            && self.granule <= LARGEST_GRANULE
            && self.erase != 0
            && self.erase.is_multiple_of(self.granule)
            && self.size.is_multiple_of(self.erase)
    }
}
