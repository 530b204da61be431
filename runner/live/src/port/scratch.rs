//! The buffer that a thread reads into, one for all its ports.

use std::cell::Cell;

/// The kernel's own buffer of a terminal.
pub(crate) const READ_BYTES: usize = 4_096;

thread_local! {
    static BUFFER: Cell<Option<Box<[u8]>>> = const { Cell::new(None) };
}

/// Lends the thread's buffer. Whoever asks again inside gets another one.
pub(crate) fn with_scratch<R>(act: impl FnOnce(&mut [u8]) -> R) -> R {
    let kept = BUFFER.take();
    let mut buffer = kept.unwrap_or_else(|| vec![0; READ_BYTES].into_boxed_slice());
    let result = act(&mut buffer);
    BUFFER.set(Some(buffer));
    result
}
