//! Another plug-in in the place of a lane's running one.

use softplug_abi::Micros;
use softplug_link::Successor;

/// A plug-in that is to take over.
#[derive(Debug)]
pub struct Swap<I> {
    /// The plug-in, and what goes on if it fails on probation.
    pub successor: Successor<I>,
}

/// What came of a swap.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum SwapReport {
    /// The new plug-in runs.
    Done {
        /// For how long the link stood still.
        pause: Micros,
    },
    /// The old plug-in goes on.
    Refused {
        /// Why, in one sentence.
        sentence: String,
    },
}
