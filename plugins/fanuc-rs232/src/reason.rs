//! Why something fails, as part of the state.

use softplug_plugin::Failure;
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The code of a failure; 0: none.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(transparent)]
pub(crate) struct Reason(u16);

impl Reason {
    pub(crate) fn new(failure: Option<Failure>) -> Self {
        Self(failure.map_or(0, Failure::code))
    }

    /// Keeps a failure; the first one stays.
    pub(crate) fn keep(&mut self, failure: Failure) {
        if self.0 == 0 {
            self.0 = failure.code();
        }
    }

    pub(crate) fn is(self, failure: Failure) -> bool {
        self.0 == failure.code()
    }

    pub(crate) fn failure(self) -> Option<Failure> {
        Failure::from_code(self.0)
    }
}
