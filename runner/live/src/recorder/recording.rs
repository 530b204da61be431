//! What a flight recorder has kept, taken out of it.

use std::fmt;

use softplug_abi::{EventKind, Micros};
use softplug_link::UnderWay;

/// Before each payload: time, kind, length.
pub(super) const HEAD: usize = 8 + 2 + 2;

pub(super) fn put_head(at: &mut [u8], now: Micros, kind: EventKind, length: usize) {
    at[..8].copy_from_slice(&now.0.to_le_bytes());
    at[8..10].copy_from_slice(&kind.code().to_le_bytes());
    at[10..HEAD].copy_from_slice(&(length as u16).to_le_bytes());
}

/// The last events that a plug-in was given.
#[derive(Clone, PartialEq, Eq, Default)]
pub struct Recording {
    bytes: Vec<u8>,
    is_whole: bool,
    under_way: UnderWay,
}

/// An event as the plug-in was given it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Entry<'a> {
    /// When, on the link's clock.
    pub at: Micros,
    /// Its kind.
    pub kind: EventKind,
    /// Its payload, as the ABI encodes it.
    pub payload: &'a [u8],
}

impl Recording {
    pub(super) fn new(bytes: Vec<u8>, is_whole: bool, under_way: UnderWay) -> Self {
        Self { bytes, is_whole, under_way }
    }

    /// Whether it begins where a new instance can begin: with its settings, or
    /// with a saved state. Only then it can be given to another instance.
    pub fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// What was under way on the link when it begins.
    pub fn under_way(&self) -> &UnderWay {
        &self.under_way
    }

    /// Whether nothing was kept.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The events, the earliest first.
    pub fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        let mut rest = &self.bytes[..];
        std::iter::from_fn(move || {
            let (head, after) = rest.split_at_checked(HEAD)?;
            let at = Micros(i64::from_le_bytes(head[..8].try_into().ok()?));
            let kind = EventKind::from_code(u16::from_le_bytes([head[8], head[9]]))?;
            let length = usize::from(u16::from_le_bytes([head[10], head[11]]));
            let (payload, after) = after.split_at_checked(length)?;
            rest = after;
            is_kept(kind).then_some(Entry { at, kind, payload })
        })
    }
}

impl fmt::Debug for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("Recording");
        shown.field("events", &self.entries().count()).field("is_whole", &self.is_whole);
        shown.finish_non_exhaustive()
    }
}

/// Whether an entry can be of this kind.
fn is_kept(kind: EventKind) -> bool {
    kind != EventKind::Continue
}
