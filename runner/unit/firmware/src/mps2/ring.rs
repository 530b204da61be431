//! Bytes from an interrupt handler to the one thread.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// A queue with one writer and one reader. It holds `SIZE - 1` bytes.
pub(crate) struct Ring<const SIZE: usize> {
    bytes: [AtomicU8; SIZE],
    head: AtomicUsize,
    tail: AtomicUsize,
}

impl<const SIZE: usize> Ring<SIZE> {
    pub(crate) const fn new() -> Self {
        let bytes = [const { AtomicU8::new(0) }; SIZE];
        Self { bytes, head: AtomicUsize::new(0), tail: AtomicUsize::new(0) }
    }

    pub(crate) fn is_full(&self) -> bool {
        let next = (self.tail.load(Ordering::Relaxed) + 1) % SIZE;
        next == self.head.load(Ordering::Acquire)
    }

    /// Only for the writer, and only if it is not full.
    pub(crate) fn push(&self, byte: u8) {
        let tail = self.tail.load(Ordering::Relaxed);
        self.bytes[tail].store(byte, Ordering::Relaxed);
        self.tail.store((tail + 1) % SIZE, Ordering::Release);
    }

    /// Only for the reader.
    pub(crate) fn pop(&self) -> Option<u8> {
        let head = self.head.load(Ordering::Relaxed);
        if head == self.tail.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.bytes[head].load(Ordering::Relaxed);
        self.head.store((head + 1) % SIZE, Ordering::Release);
        Some(byte)
    }
}
