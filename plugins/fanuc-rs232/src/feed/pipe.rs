//! Between encoder and queue: gathers single bytes, and keeps what there is no
//! room for yet.

use crate::short::shift;
use softplug_plugin::Context;
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Bytes that the pipe holds. More than the queue's room and this must not be
/// pushed before the next flush.
pub(super) const CAPACITY: usize = 128;

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(super) struct Pipe {
    /// Bytes queued for the job.
    queued: u64,
    length: u8,
    spare: [u8; 7],
    bytes: [u8; CAPACITY],
}

impl Pipe {
    pub(super) fn queued(&self) -> u64 {
        self.queued
    }

    pub(super) fn push(&mut self, link: &mut Context<'_>, byte: u8) {
        if usize::from(self.length) == CAPACITY {
            self.flush(link);
        }
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
            self.length += 1;
        }
    }

    /// Queues what there is room for; whether that was all.
    pub(super) fn flush(&mut self, link: &mut Context<'_>) -> bool {
        let count = usize::from(self.length).min(link.transmit_room() as usize);
        self.transmit(link, count);
        self.length -= count as u8;
        shift(&mut self.bytes, count);
        self.length == 0
    }

    fn transmit(&mut self, link: &mut Context<'_>, count: usize) {
        self.queued += count as u64;
        link.transmit(self.bytes.get(..count).unwrap_or_default());
    }

    /// Drops what has not been queued.
    pub(super) fn clear(&mut self) {
        self.length = 0;
    }

    /// Queues as many of `count` NULs as there is room for, in an empty pipe;
    /// returns how many are left.
    pub(super) fn nuls(&mut self, link: &mut Context<'_>, mut count: u32) -> u32 {
        self.bytes = [0; CAPACITY];
        // Other actions of the event need their place in the output too.
        while count > 0 && link.transmit_room() > 0 && link.output_room() > 4 * CAPACITY {
            let some = count.min(link.transmit_room()).min(CAPACITY as u32);
            self.transmit(link, some as usize);
            count -= some;
        }
        count
    }
}
