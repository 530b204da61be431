//! Looking at what passes on a line.

use std::time::Duration;

use crate::view::Seen;

/// What passes on a link's line. Dropping it ends the watch.
#[derive(Debug)]
pub struct Watching {
    _private: (),
}

/// What a wait for the next thing seen brought.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Next {
    /// Something was seen.
    Seen(Seen),
    /// Nothing in the time given.
    Nothing,
    /// The link is gone.
    End,
}

impl Watching {
    /// The next that is seen; waits for it at most so long.
    pub fn next(&mut self, patience: Duration) -> Next {
        let _ = patience;
        Next::End
    }
}
