//! What waits to be sent: the transmit queue with its hold, and the urgent
//! bytes that pass both.

use crate::fault::RuleBroken;
use crate::marks::Marks;
use alloc::collections::VecDeque;
use core::hash::{Hash, Hasher};
use softplug_abi::limits::{MARKS, URGENT_BYTES};
use softplug_abi::{MarkId, MarkState};

/// What [`Link::take`](crate::Link::take) gave to the port.
///
/// The example of [`Link`](crate::Link) shows it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Taken {
    /// Nothing may be sent now.
    Nothing,
    /// So many bytes were put into the buffer.
    Bytes(usize),
    /// Send a break of so many µs, after all bytes before it have left.
    Break(u32),
}

#[derive(Clone, Hash, Debug)]
enum Urgent {
    Byte { byte: u8, mark: MarkId },
    Break(u32),
}

#[derive(Clone, Debug)]
pub(crate) struct Queue {
    bytes: VecDeque<u8>,
    urgent: VecDeque<Urgent>,
    held: bool,
    capacity: u32,
    /// What the plug-in knows to be free.
    room: u32,
    /// Free, but not reported yet.
    unreported: u32,
    /// Bytes ever queued.
    queued: u64,
    /// Bytes ever given to the port.
    given: u64,
    maybe_left: u64,
    surely_left: u64,
    /// Bytes that each discard dropped, not reported yet.
    discarded: VecDeque<u32>,
    marks: Marks,
}

impl Queue {
    pub(crate) fn new(capacity: u32) -> Self {
        Self {
            bytes: VecDeque::with_capacity(capacity as usize),
            urgent: VecDeque::with_capacity(URGENT_BYTES),
            held: false,
            capacity,
            room: capacity,
            unreported: 0,
            queued: 0,
            given: 0,
            maybe_left: 0,
            surely_left: 0,
            discarded: VecDeque::new(),
            marks: Marks::default(),
        }
    }

    pub(crate) fn transmit(&mut self, mark: MarkId, bytes: &[u8]) -> Result<(), RuleBroken> {
        let count = bytes.len() as u32;
        if count > self.room {
            return Err(RuleBroken::TransmitRoom { asked: count, room: self.room });
        }
        self.check_mark(mark)?;
        self.room -= count;
        self.queued += u64::from(count);
        self.bytes.extend(bytes);
        if mark != MarkId::NONE {
            if self.bytes.is_empty() {
                self.marks.give(mark, self.given);
            } else {
                self.marks.queue(mark, self.queued);
            }
        }
        Ok(())
    }

    pub(crate) fn transmit_urgent(&mut self, mark: MarkId, bytes: &[u8]) -> Result<(), RuleBroken> {
        if self.urgent.len() + bytes.len() > URGENT_BYTES {
            return Err(RuleBroken::UrgentFull);
        }
        self.check_mark(mark)?;
        let last = bytes.len() - 1;
        let with_mark = |(at, byte): (usize, &u8)| Urgent::Byte {
            byte: *byte,
            mark: if at == last { mark } else { MarkId::NONE },
        };
        self.urgent.extend(bytes.iter().enumerate().map(with_mark));
        Ok(())
    }

    pub(crate) fn send_break(&mut self, micros: u32) -> Result<(), RuleBroken> {
        if self.urgent.len() == URGENT_BYTES {
            return Err(RuleBroken::UrgentFull);
        }
        self.urgent.push_back(Urgent::Break(micros));
        Ok(())
    }

    fn check_mark(&self, mark: MarkId) -> Result<(), RuleBroken> {
        if mark != MarkId::NONE && !self.marks.has_room() {
            Err(RuleBroken::TooManyMarks)
        } else {
            Ok(())
        }
    }

    pub(crate) fn set_held(&mut self, held: bool) {
        self.held = held;
    }

    pub(crate) fn is_held(&self) -> bool {
        self.held
    }

    pub(crate) fn has_to_send(&self) -> bool {
        !self.urgent.is_empty() || (!self.held && !self.bytes.is_empty())
    }

    /// Bytes that wait, urgent ones left out.
    pub(crate) fn waiting(&self) -> usize {
        self.bytes.len()
    }

    /// Characters that the port was ever given.
    pub(crate) fn given(&self) -> u64 {
        self.given
    }

    /// These, and those that wait behind them, urgent ones left out.
    pub(crate) fn tail(&self) -> u64 {
        self.given + self.bytes.len() as u64
    }

    pub(crate) fn discard(&mut self) {
        let dropped = self.bytes.len() as u32;
        self.bytes.clear();
        self.marks.drop_queued();
        self.discarded.push_back(dropped);
    }

    /// Moves what the port may send into `buffer`: urgent bytes first, then the
    /// queue unless it is held.
    pub(crate) fn take(&mut self, buffer: &mut [u8]) -> Taken {
        let mut count = 0;
        while count < buffer.len() {
            match self.urgent.pop_front() {
                Some(Urgent::Byte { byte, mark }) => {
                    buffer[count] = byte;
                    count += 1;
                    self.given += 1;
                    if mark != MarkId::NONE {
                        self.marks.give(mark, self.given);
                    }
                }
                Some(Urgent::Break(micros)) if count == 0 => return Taken::Break(micros),
                Some(later) => {
                    self.urgent.push_front(later);
                    return Taken::Bytes(count);
                }
                None => break,
            }
        }
        if !self.held {
            count += self.take_queued(&mut buffer[count..]);
        }
        if count == 0 { Taken::Nothing } else { Taken::Bytes(count) }
    }

    fn take_queued(&mut self, buffer: &mut [u8]) -> usize {
        let count = buffer.len().min(self.bytes.len());
        if count == 0 {
            return 0;
        }
        let (front, back) = self.bytes.as_slices();
        let split = front.len().min(count);
        buffer[..split].copy_from_slice(&front[..split]);
        buffer[split..count].copy_from_slice(&back[..count - split]);
        self.bytes.drain(..count);
        self.given += count as u64;
        self.unreported += count as u32;
        self.marks.taken(self.queued - self.bytes.len() as u64, self.given);
        count
    }

    /// How many characters, of all that the port was given, maybe and surely
    /// have left.
    pub(crate) fn left(&mut self, maybe: u64, surely: u64) {
        self.maybe_left = self.maybe_left.max(maybe.min(self.given));
        self.surely_left = self.surely_left.max(surely.min(self.given));
        self.maybe_left = self.maybe_left.max(self.surely_left);
    }

    /// Whether a mark is on a byte that the port was given.
    pub(crate) fn awaits_departures(&self) -> bool {
        self.marks.awaits_departures()
    }

    pub(crate) fn next_mark(&mut self) -> Option<(MarkId, MarkState)> {
        self.marks.next_report(self.maybe_left, self.surely_left)
    }

    /// The answer to a discard; its bytes are room again.
    pub(crate) fn next_discarded(&mut self) -> Option<u32> {
        let bytes = self.discarded.pop_front()?;
        self.room += bytes;
        Some(bytes)
    }

    /// Takes the answer to a discard back: it will be given again.
    pub(crate) fn undo_discarded(&mut self, bytes: u32) {
        self.room -= bytes;
        self.discarded.push_front(bytes);
    }

    /// Whether something is to be reported of what was given to the port.
    pub(crate) fn has_reports(&self) -> bool {
        self.room_is_due() || self.awaits_departures()
    }

    fn room_is_due(&self) -> bool {
        self.unreported >= self.capacity.div_ceil(4)
            || (self.bytes.is_empty() && self.unreported > 0)
    }

    /// Growth of room to report: a quarter of the capacity, or all that there
    /// is once the queue has run empty.
    pub(crate) fn next_room(&mut self) -> Option<u32> {
        if !self.room_is_due() {
            return None;
        }
        let grown = core::mem::take(&mut self.unreported);
        self.room += grown;
        Some(grown)
    }

    /// What the plug-in knows to be free.
    pub(crate) fn known_room(&self) -> u32 {
        self.room
    }

    /// All that is free, reported or not.
    pub(crate) fn whole_room(&self) -> u32 {
        self.room + self.unreported
    }

    /// The plug-in was told the [whole room](Self::whole_room).
    pub(crate) fn restate_room(&mut self) {
        self.room += core::mem::take(&mut self.unreported);
    }

    /// All that decides what comes, and not how much has gone before.
    pub(crate) fn hash_ahead(&self, state: &mut impl Hasher) {
        // A field that is added has to be thought of here.
        let Self {
            bytes,
            urgent,
            held,
            capacity,
            room,
            unreported,
            queued,
            given,
            maybe_left,
            surely_left,
            discarded,
            marks,
        } = self;
        (bytes, urgent, held, capacity, room, unreported, discarded).hash(state);
        (given - maybe_left, given - surely_left).hash(state);
        marks.hash_ahead(*queued, *given, state);
    }

    /// Whether nothing waits, nothing is held and no mark is outstanding.
    pub(crate) fn is_idle(&self) -> bool {
        let nothing_waits = self.bytes.is_empty() && self.urgent.is_empty();
        nothing_waits && !self.held && self.discarded.is_empty() && self.marks.count() == 0
    }

    pub(crate) fn marks_outstanding(&self) -> u32 {
        self.marks.count() as u32
    }

    /// For a rerun: so many marks are outstanding of which nothing else is known.
    pub(crate) fn mark_unnamed(&mut self, count: u32) {
        (0..count.min(MARKS as u32)).for_each(|_| self.marks.give(MarkId::NONE, u64::MAX));
    }

    /// For a rerun: the plug-in was told the end of this mark.
    pub(crate) fn settle_mark(&mut self, mark: MarkId) {
        self.marks.settle(mark);
    }

    /// For a rerun: the plug-in was told so much room.
    pub(crate) fn set_room(&mut self, room: u32) {
        self.room = room;
    }

    /// Growth that was told counts as not told.
    pub(crate) fn shrink_room(&mut self, grown: u32) {
        self.room -= grown;
    }

    /// The plug-in was told so much more room.
    pub(crate) fn grow_room(&mut self, grown: u32) {
        self.room = self.room.saturating_add(grown);
    }

    /// For a rerun: the plug-in was told that a discard dropped so much.
    pub(crate) fn told_discarded(&mut self, bytes: u32) {
        self.discarded.pop_front();
        self.grow_room(bytes);
    }

    /// For a rerun: what waits is not looked at any more.
    pub(crate) fn forget_waiting(&mut self) {
        self.bytes.clear();
        self.urgent.clear();
    }

    /// Drops all that waits, and the hold. Positions go on: the port still
    /// counts what it was given.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.urgent.clear();
        self.marks = Marks::default();
        self.held = false;
        self.discarded.clear();
        self.room = self.capacity;
        self.unreported = 0;
    }
}
