//! What lies where on a device: `docs/unit/slots.md`, *Layout*.

use crate::device::Geometry;
use crate::error::SetUpError;
use crate::record::{RECORD, RECORDS};
use crate::slot::{LEAST_ROOM, LONGEST_MODULE, Slot};

/// Bytes of a header.
pub(crate) const HEADER: usize = 192;

/// One of the two places for a header in a slot. They take turns.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Place {
    First,
    Second,
}

impl Place {
    pub(crate) const BOTH: [Self; 2] = [Self::First, Self::Second];

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// Addresses on a device.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) geometry: Geometry,
    /// Bytes of a slot.
    slot: u32,
    /// Bytes of a header, as whole granules.
    pub(crate) header: u32,
    /// Bytes of the area of one header and its records.
    pub(crate) area: u32,
    /// Bytes from one record to the next.
    pub(crate) stride: u32,
    /// Bytes of a module at most.
    pub(crate) room: u32,
}

impl Layout {
    pub(crate) fn of(geometry: Geometry) -> Result<Self, SetUpError> {
        if !geometry.is_sound() {
            return Err(SetUpError::Geometry(geometry));
        }
        let stride = geometry.granule.max(RECORD as u32);
        let header = (HEADER as u32).next_multiple_of(geometry.granule);
        let area = header + u32::from(RECORDS) * stride;
        // In 64 bits: an erase block may be as large as it likes.
        let blocks = |bytes: u32| u64::from(bytes).next_multiple_of(u64::from(geometry.erase));
        let needed = 2 * (2 * blocks(area) + blocks(LEAST_ROOM));
        if u64::from(geometry.size) < needed {
            return Err(SetUpError::TooSmall { size: geometry.size, needed });
        }
        let area = blocks(area) as u32;
        let slot = geometry.size / 2 / geometry.erase * geometry.erase;
        let room = (slot - 2 * area).min(LONGEST_MODULE);
        Ok(Self { geometry, slot, header, area, stride, room })
    }

    /// Where an area begins, and with it its header.
    pub(crate) const fn area(&self, slot: Slot, place: Place) -> u32 {
        let before = match place {
            Place::First => 0,
            Place::Second => self.area,
        };
        slot.index() as u32 * self.slot + before
    }

    /// Where a record behind it begins.
    pub(crate) const fn record(&self, slot: Slot, place: Place, number: u8) -> u32 {
        self.area(slot, place) + self.header + number as u32 * self.stride
    }

    /// Where a slot's module begins.
    pub(crate) const fn module(&self, slot: Slot) -> u32 {
        slot.index() as u32 * self.slot + 2 * self.area
    }

    /// Bytes that are erased for a module of this length.
    pub(crate) const fn blocks(&self, length: u32) -> u32 {
        // No overflow: the length is at most `room`, and a slot is whole blocks.
        length.div_ceil(self.geometry.erase) * self.geometry.erase
    }
}
