//! What was queued last: where the axes will stand, and where they stand when a part of it is
//! dropped.

use crate::codes;
use softplug_plugin::{StateReader, StateWriter, copy};

/// Bytes that are remembered: more than ever wait in the queue.
const KEPT: usize = 1_024;

/// The bytes that were queued last, and the position behind them.
#[derive(Clone, Debug)]
pub(crate) struct Queued {
    bytes: [u8; KEPT],
    /// Of the job.
    pub(crate) count: u64,
    /// Pulses since the link opened.
    pub(crate) x: i64,
    pub(crate) z: i64,
}

impl Queued {
    pub(crate) fn new() -> Self {
        Self { bytes: [0; KEPT], count: 0, x: 0, z: 0 }
    }

    fn place(count: u64) -> usize {
        (count % KEPT as u64) as usize
    }

    pub(crate) fn put(&mut self, byte: u8) {
        if let Some(kept) = self.bytes.get_mut(Self::place(self.count)) {
            *kept = byte;
        }
        self.count += 1;
        let (x, z) = codes::pulses(byte);
        self.x += x;
        self.z += z;
    }

    /// So many of the bytes that were queued last never left.
    pub(crate) fn drop_last(&mut self, bytes: u32) {
        for _ in 0..u64::from(bytes).min(self.count) {
            self.count -= 1;
            let dropped = self.bytes.get(Self::place(self.count)).copied().unwrap_or_default();
            let (x, z) = codes::pulses(dropped);
            self.x -= x;
            self.z -= z;
        }
    }

    /// Whether the last of the first `count` bytes says that another one follows.
    pub(crate) fn follows(&self, count: u64) -> bool {
        let last = count.checked_sub(1).map(Self::place);
        last.and_then(|place| self.bytes.get(place))
            .is_some_and(|byte| byte & 0x80 == 0 && byte & codes::FOLLOWS != 0)
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u64(self.count);
        state.u64(self.x.cast_unsigned());
        state.u64(self.z.cast_unsigned());
        state.bytes(self.bytes.get(..self.kept()).unwrap_or_default());
    }

    fn kept(&self) -> usize {
        self.count.min(KEPT as u64) as usize
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) {
        self.count = state.u64();
        self.x = state.u64().cast_signed();
        self.z = state.u64().cast_signed();
        let kept = self.kept();
        copy(&mut self.bytes, state.bytes(kept));
    }
}
