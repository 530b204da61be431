//! Wakes a thread and tells it what for: one bit for each thing that it looks after.
//! Waking neither locks nor allocates: it is done by threads that serve links.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Wake, Waker};
use std::thread::Thread;

/// Most things that a thread looks after.
pub(crate) const SLOTS: usize = 4_096;
const WORDS: usize = SLOTS / 64;

/// The bits, and the thread.
pub(crate) struct Wakes {
    words: [AtomicU64; WORDS],
    thread: Thread,
}

impl Wakes {
    pub(crate) fn new(thread: Thread) -> Arc<Self> {
        Arc::new(Self { words: [const { AtomicU64::new(0) }; WORDS], thread })
    }

    /// What sets the bit of `slot` and wakes the thread.
    pub(crate) fn waker(self: &Arc<Self>, slot: usize) -> Waker {
        debug_assert!(slot < SLOTS, "slots are counted when they are given");
        Arc::new(Slot { wakes: Arc::clone(self), slot }).into()
    }

    /// The slots that were woken since the last call.
    pub(crate) fn take(&self) -> impl Iterator<Item = usize> {
        self.words.iter().enumerate().flat_map(|(at, word)| {
            let mut bits = word.swap(0, Ordering::AcqRel);
            std::iter::from_fn(move || {
                let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
                bits &= bits - 1;
                Some(at * 64 + bit)
            })
        })
    }
}

struct Slot {
    wakes: Arc<Wakes>,
    slot: usize,
}

impl Wake for Slot {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        let word = &self.wakes.words[self.slot / 64];
        let bit = 1 << (self.slot % 64);
        if word.fetch_or(bit, Ordering::AcqRel) & bit == 0 {
            self.wakes.thread.unpark();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_was_woken_is_told_once() {
        let wakes = Wakes::new(std::thread::current());
        for slot in [0, 63, 64, SLOTS - 1, 63] {
            wakes.waker(slot).wake();
        }
        // Permission to go on was given, once.
        std::thread::park();
        assert_eq!(wakes.take().collect::<Vec<_>>(), [0, 63, 64, SLOTS - 1]);
        assert_eq!(wakes.take().count(), 0);
    }
}
