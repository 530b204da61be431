//! What a run shows outside, as a number.

use std::fmt::{self, Debug, Write};
use std::hash::{DefaultHasher, Hasher};

/// A hash of all that a run shows outside: bytes, deliveries, ends of jobs, and when.
#[derive(Copy, Clone, PartialEq, Eq)]
pub(super) struct Effects(u64);

impl Effects {
    pub(super) fn of(seen: impl Debug) -> Self {
        struct Into(DefaultHasher);
        impl Write for Into {
            fn write_str(&mut self, text: &str) -> fmt::Result {
                self.0.write(text.as_bytes());
                Ok(())
            }
        }
        let mut hash = Into(DefaultHasher::new());
        // Hashing never fails.
        let _ = write!(hash, "{seen:?}");
        Self(hash.0.finish())
    }
}
