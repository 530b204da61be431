//! What a slot holds, as far as its bytes say.

use crate::access;
use crate::device::{Device, LARGEST_GRANULE};
use crate::header::{Header, NoHeader};
use crate::layout::{HEADER, Layout, Place};
use crate::record::{Log, RECORD, RECORDS, Record, State};
use crate::slot::Slot;

/// What a slot holds, as its header and records say. Its module may be damaged all the same.
///
/// The example of [`Slots`](crate::Slots) shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Content {
    /// Nothing.
    #[error("is empty")]
    Empty,
    /// Bytes that are not ours.
    #[error("holds bytes that no unit wrote")]
    Garbage,
    /// A header that is not whole: power failed while it was written, or it has decayed.
    #[error("has a damaged header")]
    Damaged,
    /// The device cannot read it.
    #[error("cannot be read")]
    Unreadable,
    /// A header in another format.
    #[error("was written in format {0}, and this is format 1")]
    OtherVersion(u16),
    /// A header for other sizes of the device.
    #[error("was written for other sizes of the device")]
    OtherGeometry,
    /// A module, whole or not.
    #[error("holds a module of {} bytes", .0.length)]
    Module(Held),
}

/// A module in a slot.
///
/// The example of [`Slots`](crate::Slots) shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Held {
    /// What has become of it.
    pub state: State,
    /// The higher, the newer: each download has one of its own.
    pub generation: u32,
    /// Bytes.
    pub length: u32,
    /// SHA-256.
    pub digest: [u8; 32],
    /// The id of the key that signed it; none if it is not signed.
    pub key: Option<[u8; 32]>,
}

/// The header that counts, and what its records say.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Current {
    pub(crate) place: Place,
    pub(crate) header: Header,
    pub(crate) log: Log,
}

impl Current {
    pub(crate) const fn state(&self) -> State {
        self.log.state()
    }

    /// Erasures of the slot until now.
    pub(crate) fn erases(&self) -> u32 {
        self.header.erases.saturating_add(u32::from(self.log.retired))
    }

    pub(crate) fn held(&self) -> Held {
        let Header { generation, length, digest, signature, .. } = self.header;
        let key = signature.map(|signature| signature.key);
        Held { state: self.state(), generation, length, digest, key }
    }
}

/// The newer of a slot's headers with its records, or why there is none.
pub(crate) fn scan<D: Device>(
    device: &mut D,
    layout: &Layout,
    slot: Slot,
) -> Result<Current, Content> {
    let [first, second] = Place::BOTH.map(|place| {
        let mut buffer = [0; LARGEST_GRANULE as usize];
        let bytes = &mut buffer[..layout.header as usize];
        let read = access::read(device, layout.area(slot, place), bytes);
        let (bytes, _) = buffer.split_first_chunk::<HEADER>().expect("a header is shorter");
        match read {
            Ok(()) => Header::read(bytes, slot, layout).map_err(|none| match none {
                NoHeader::Blank => Content::Empty,
                NoHeader::Garbage => Content::Garbage,
                NoHeader::Damaged => Content::Damaged,
                NoHeader::OtherVersion(format) => Content::OtherVersion(format),
                NoHeader::OtherGeometry => Content::OtherGeometry,
            }),
            Err(_) => Err(Content::Unreadable),
        }
    });
    let (place, header) = match (first, second) {
        // Whoever wrote this may have put its own module where ours was.
        (Err(other @ (Content::OtherVersion(_) | Content::OtherGeometry)), _)
        | (_, Err(other @ (Content::OtherVersion(_) | Content::OtherGeometry))) => {
            return Err(other);
        }
        (Ok(first), Ok(second)) if second.generation > first.generation => (Place::Second, second),
        (Ok(first), _) => (Place::First, first),
        (Err(_), Ok(second)) => (Place::Second, second),
        (Err(first), Err(second)) => return Err(worse(first, second)),
    };
    let log = read_log(device, layout, slot, place, header.generation);
    Ok(Current { place, header, log })
}

/// What is more worth telling of two headers that are none.
fn worse(first: Content, second: Content) -> Content {
    let all = [Content::Unreadable, Content::Damaged, Content::Garbage];
    all.into_iter().find(|one| *one == first || *one == second).unwrap_or(Content::Empty)
}

fn read_log<D: Device>(
    device: &mut D,
    layout: &Layout,
    slot: Slot,
    place: Place,
    generation: u32,
) -> Log {
    let mut log = Log::new();
    let mut buffer = [0; LARGEST_GRANULE as usize];
    let bytes = &mut buffer[..layout.stride as usize];
    for number in 0..RECORDS {
        // What cannot be read was torn while it was written.
        let is_read = access::read(device, layout.record(slot, place, number), bytes).is_ok();
        if is_read && bytes.iter().all(|byte| *byte == 0xFF) {
            continue;
        }
        log.next = number + 1;
        let record = bytes.first_chunk::<RECORD>().filter(|_| is_read);
        if let Some(record) = record.and_then(|bytes| Record::read(bytes, generation, number)) {
            log.take(record);
        }
    }
    log
}
