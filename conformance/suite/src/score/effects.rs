//! What a run shows outside, as a number.

use std::hash::{DefaultHasher, Hash, Hasher};

/// A hash of all that a run shows outside: bytes, deliveries, ends of jobs, and when.
#[derive(Copy, Clone, PartialEq, Eq)]
pub(super) struct Effects(u64);

impl Effects {
    pub(super) fn of(seen: impl Hash) -> Self {
        let mut hash = DefaultHasher::new();
        seen.hash(&mut hash);
        Self(hash.finish())
    }
}
