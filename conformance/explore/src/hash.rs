//! A hash of 128 bits that std's `Hash` can write to.

use std::hash::Hasher;
use twox_hash::XxHash3_128;

/// Two states with one hash of this count as the same: of 10⁹ different ones, two share one
/// with a probability of 10⁻²¹.
pub(crate) struct Hash128(Vec<u8>);

impl Hash128 {
    pub(crate) fn new() -> Self {
        Self(Vec::with_capacity(1_024))
    }

    pub(crate) fn finish_128(&self) -> u128 {
        XxHash3_128::oneshot(&self.0)
    }
}

impl Hasher for Hash128 {
    fn write(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    fn finish(&self) -> u64 {
        self.finish_128() as u64
    }
}
