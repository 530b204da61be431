//! Another plug-in in the place of a lane's running one.

use softplug_abi::Micros;
use softplug_link::Successor;

use super::fault::LaneFault;

/// A plug-in that is to take over. It was made elsewhere: nothing is compiled or
/// instantiated where links are served.
#[derive(Debug)]
pub struct Swap<I> {
    /// The plug-in. With a spare it is on probation.
    pub successor: Successor<I>,
    /// When.
    pub when: When,
    /// How long it is on probation, if it is.
    pub probation: Probation,
}

/// When to swap.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum When {
    /// At once, whatever is under way: refused if the state cannot be carried over. A plug-in
    /// that takes none of the running one's formats begins as new, and is refused unless
    /// nothing is under way.
    Now,
    /// At the next moment at which nothing is under way.
    Idle,
    /// At once if the state can be carried over, else when nothing is under way.
    NowOrIdle,
}

/// How long a probation lasts: until both have passed.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Probation {
    /// Events that the plug-in has mastered.
    pub events: u64,
    /// Time.
    pub span: Micros,
}

/// What came of a swap.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum SwapReport {
    /// It waits until nothing is under way.
    Waiting,
    /// The new plug-in runs.
    Done {
        /// For how long the link stood still.
        pause: Micros,
        /// It took over the state; otherwise it began as new.
        with_state: bool,
        /// It is on probation.
        on_probation: bool,
    },
    /// The old plug-in goes on.
    Refused {
        /// Why, in one sentence.
        sentence: String,
    },
    /// The probation is over, the new plug-in stays.
    Kept,
    /// The new plug-in failed on probation. The old one has taken the event that it
    /// failed on, and goes on.
    Reverted(Box<LaneFault>),
}
