//! What of the transmit queue is the job's.

use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Runs that are told apart. A control that waits for its answers makes two.
const MOST: usize = 7;

/// The queue from its end: bytes of the job and others, by turns.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(super) struct Queue {
    /// Lengths, the latest first.
    runs: [u32; MOST],
    /// The latest is the job's.
    is_own: bool,
    spare: [u8; 3],
}

impl Queue {
    /// A job begins: what the queue has is not its.
    pub(super) fn begin(&mut self) {
        *self = Self::new_zeroed();
        self.runs[0] = u32::MAX;
    }

    pub(super) fn push(&mut self, length: usize, is_own: bool) {
        if self.is_own != is_own {
            self.is_own = is_own;
            self.runs.copy_within(..MOST - 1, 1);
            self.runs[0] = 0;
        }
        self.runs[0] = self.runs[0].saturating_add(length as u32);
    }

    /// How many of so many bytes at its end are the job's. Of what is not known rather too many.
    pub(super) fn own(&self, bytes: u32) -> u32 {
        let (mut rest, mut own, mut is_own) = (bytes, 0, self.is_own);
        for run in self.runs {
            let part = rest.min(run);
            rest -= part;
            own += if is_own { part } else { 0 };
            is_own = !is_own;
        }
        own + rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_dropped_is_the_jobs_as_far_as_it_was_queued_for_it() {
        let mut queue = Queue::new_zeroed();
        queue.push(40, true);
        queue.begin();
        queue.push(6, false);
        queue.push(20, true);
        queue.push(10, true);
        queue.push(6, false);
        assert_eq!([4, 6, 7, 36, 37, 100].map(|bytes| queue.own(bytes)), [0, 0, 1, 30, 30, 30]);
    }

    #[test]
    fn what_is_not_known_counts_as_the_jobs() {
        let mut queue = Queue::new_zeroed();
        queue.begin();
        for _ in 0..MOST {
            queue.push(1, true);
            queue.push(1, false);
        }
        assert_eq!([MOST as u32, 100].map(|bytes| queue.own(bytes)), [3, 3 + 93]);
    }
}
