//! A slot's header: which module is in it, or on the way into it.

use crate::crc::crc32;
use crate::layout::{HEADER, Layout};
use crate::signature::Signature;
use crate::slot::Slot;

/// The format that this crate reads and writes.
pub const FORMAT: u16 = 1;

const MAGIC: &[u8; 8] = b"SPLGSLOT";
const CRC: usize = HEADER - 4;

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Header {
    /// Goes up by one with each download into either slot.
    pub(crate) generation: u32,
    /// Erasures of this slot, the one for this header included.
    pub(crate) erases: u32,
    /// Those of the other slot, as known when this was written.
    pub(crate) other_erases: u32,
    pub(crate) length: u32,
    pub(crate) digest: [u8; 32],
    pub(crate) signature: Option<Signature>,
}

/// Why bytes are no header of ours.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum NoHeader {
    Blank,
    Garbage,
    /// It begins as one, and then is wrong.
    Damaged,
    OtherVersion(u16),
    OtherGeometry,
}

impl Header {
    pub(crate) fn write(&self, slot: Slot, layout: &Layout) -> [u8; HEADER] {
        let mut bytes = [0; HEADER];
        let geometry = layout.geometry;
        bytes[..8].copy_from_slice(MAGIC);
        bytes[8..10].copy_from_slice(&FORMAT.to_le_bytes());
        bytes[10] = slot.index() as u8;
        bytes[11] = u8::from(self.signature.is_some());
        let numbers = [
            geometry.erase,
            geometry.granule,
            geometry.size,
            self.generation,
            self.erases,
            self.other_erases,
            self.length,
        ];
        for (field, number) in bytes[12..40].chunks_exact_mut(4).zip(numbers) {
            field.copy_from_slice(&number.to_le_bytes());
        }
        bytes[40..72].copy_from_slice(&self.digest);
        if let Some(signature) = &self.signature {
            bytes[72..104].copy_from_slice(&signature.key);
            bytes[104..168].copy_from_slice(&signature.bytes);
        }
        let crc = crc32(&bytes[..CRC]);
        bytes[CRC..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    pub(crate) fn read(
        bytes: &[u8; HEADER],
        slot: Slot,
        layout: &Layout,
    ) -> Result<Self, NoHeader> {
        if bytes.iter().all(|byte| *byte == 0xFF) {
            return Err(NoHeader::Blank);
        }
        if !bytes.starts_with(MAGIC) {
            return Err(NoHeader::Garbage);
        }
        let u32_at = |at: usize| u32::from_le_bytes(array(&bytes[at..]));
        if crc32(&bytes[..CRC]) != u32_at(CRC) {
            return Err(NoHeader::Damaged);
        }
        // Magic, format and CRC stand in the same places in every format.
        let format = u16::from_le_bytes(array(&bytes[8..]));
        if format != FORMAT {
            return Err(NoHeader::OtherVersion(format));
        }
        let geometry = layout.geometry;
        if [u32_at(12), u32_at(16), u32_at(20)] != [geometry.erase, geometry.granule, geometry.size]
        {
            return Err(NoHeader::OtherGeometry);
        }
        let signature = Signature { key: array(&bytes[72..]), bytes: array(&bytes[104..]) };
        let header = Self {
            generation: u32_at(24),
            erases: u32_at(28),
            other_erases: u32_at(32),
            length: u32_at(36),
            digest: array(&bytes[40..]),
            signature: (bytes[11] != 0).then_some(signature),
        };
        let is_possible = header.length != 0 && header.length <= layout.room;
        // Whatever else is wrong in it: each header has one encoding.
        if is_possible && header.write(slot, layout) == *bytes {
            Ok(header)
        } else {
            Err(NoHeader::Damaged)
        }
    }
}

/// The first bytes of a slice that is at least as long.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[..N]);
    array
}
