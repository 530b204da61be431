//! What happened at one end of the line, written down for a trace.

use softplug_abi::Micros;
use softplug_link::Observed;
use softplug_models::Step;

/// All that one plug-in was given on a way, and what it did.
///
/// The example of [`Exploration`](crate::Exploration) looks for a way.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Log {
    /// What it was given, in order; first of all, its link is opened.
    pub inputs: Vec<(Micros, Step)>,
    /// What it did, in order.
    pub observed: Vec<(Micros, Observed)>,
    /// The last instant at which something was due or given.
    pub end: Micros,
}
