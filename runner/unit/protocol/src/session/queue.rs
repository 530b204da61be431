//! Frames with messages that wait to leave, or to be confirmed.

use softplug_abi::{Micros, NoSpace};

use super::SessionError;
use crate::frame::PAYLOAD;
use crate::message::Encode;

#[derive(Debug)]
pub(super) struct Queue<const SLOTS: usize, const BYTES: usize> {
    /// A ring: `held` of them from `first` on.
    slots: [Slot<BYTES>; SLOTS],
    first: usize,
    held: usize,
    /// Of those held, how many have left since the last [`go_back`](Self::go_back).
    left: usize,
    /// Of those held, how many have ever left: nothing is appended to them.
    sealed: usize,
    /// The number of the first one.
    number: u32,
    /// The most bytes of payload that the other side takes.
    limit: usize,
}

/// Frames have come to the other side that had not been confirmed.
#[derive(Copy, Clone, Debug)]
pub(super) struct Confirmed {
    /// When the last of them left, unless it left more than once.
    pub(super) sent_at: Option<Micros>,
}

/// Confirmed was what was never sent.
#[derive(Debug)]
pub(super) struct NeverSent;

#[derive(Copy, Clone, Debug)]
struct Slot<const BYTES: usize> {
    bytes: [u8; BYTES],
    length: usize,
    /// When it left, if it left once.
    sent_at: Option<Micros>,
    is_repeated: bool,
}

impl<const SLOTS: usize, const BYTES: usize> Queue<SLOTS, BYTES> {
    /// The most bytes of payload that this side takes: what it has room to send itself.
    pub(super) const TAKES: u16 = if BYTES < PAYLOAD { BYTES as u16 } else { PAYLOAD as u16 };

    pub(super) fn new() -> Self {
        let empty = Slot { bytes: [0; BYTES], length: 0, sent_at: None, is_repeated: false };
        Self { slots: [empty; SLOTS], first: 0, held: 0, left: 0, sealed: 0, number: 1, limit: 0 }
    }

    pub(super) fn clear(&mut self, takes: usize) {
        (self.first, self.held, self.left, self.sealed, self.number) = (0, 0, 0, 0, 1);
        self.limit = takes.min(usize::from(Self::TAKES));
    }

    pub(super) fn limit(&self) -> usize {
        self.limit
    }

    pub(super) fn is_under_way(&self) -> bool {
        self.left > 0
    }

    pub(super) fn has_room(&self, bytes: usize) -> bool {
        bytes <= self.limit && (self.held < SLOTS || self.room_in_open() >= bytes)
    }

    fn room_in_open(&self) -> usize {
        let is_open = self.held > self.sealed;
        if is_open {
            self.limit.saturating_sub(self.slots[self.at(self.held - 1)].length)
        } else {
            0
        }
    }

    /// Appends to the last frame while that has not left, or begins another.
    pub(super) fn push(&mut self, message: &impl Encode) -> Result<(), SessionError> {
        if self.held > self.sealed && self.append(message).is_ok() {
            return Ok(());
        }
        if self.held == SLOTS {
            return Err(SessionError::Full);
        }
        let at = self.at(self.held);
        let slot = &mut self.slots[at];
        (slot.length, slot.sent_at, slot.is_repeated) = (0, None, false);
        self.held += 1;
        self.append(message).map_err(|NoSpace| {
            self.held -= 1;
            SessionError::TooLong
        })
    }

    fn append(&mut self, message: &impl Encode) -> Result<(), NoSpace> {
        let (at, limit) = (self.at(self.held - 1), self.limit);
        let slot = &mut self.slots[at];
        let free = slot.bytes.get_mut(slot.length..limit).ok_or(NoSpace)?;
        slot.length += message.encode(free)?;
        Ok(())
    }

    /// The next frame to leave: its number and payload.
    pub(super) fn next(&mut self, now: Micros) -> Option<(u32, &[u8])> {
        if self.left == self.held {
            return None;
        }
        let (at, number) = (self.at(self.left), self.number.wrapping_add(self.left as u32));
        self.left += 1;
        self.sealed = self.sealed.max(self.left);
        let slot = &mut self.slots[at];
        slot.is_repeated = slot.sent_at.is_some();
        slot.sent_at = Some(now);
        Some((number, &slot.bytes[..slot.length]))
    }

    /// All that has left and is not confirmed leaves again.
    pub(super) fn go_back(&mut self) {
        self.left = 0;
    }

    /// All frames up to `taken` have come; `None`: that is no news.
    ///
    /// # Errors
    /// It was never sent.
    pub(super) fn confirm(&mut self, taken: u32) -> Result<Option<Confirmed>, NeverSent> {
        let count = taken.wrapping_sub(self.number.wrapping_sub(1));
        if count as i32 <= 0 {
            return Ok(None);
        }
        let count = count as usize;
        if count > self.sealed {
            return Err(NeverSent);
        }
        let last = &self.slots[self.at(count - 1)];
        let sent_at = last.sent_at.filter(|_| !last.is_repeated);
        self.first = self.at(count);
        self.held -= count;
        self.sealed -= count;
        self.left = self.left.saturating_sub(count);
        self.number = self.number.wrapping_add(count as u32);
        Ok(Some(Confirmed { sent_at }))
    }

    fn at(&self, offset: usize) -> usize {
        (self.first + offset) % SLOTS
    }
}
