//! What a run of a trace or a recording showed.

use super::fault::Fault;
use super::seen::Seen;
use super::subject::Fuel;
use softplug_abi::Micros;

/// What a run showed.
///
/// The example of [`replay`](crate::replay) shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outcome {
    /// All that could be seen from outside, in the order of time, up to the
    /// trace's end.
    pub seen: Vec<Seen>,
    /// Why the run ended before that.
    pub fault: Option<Fault>,
    /// On the link's clock, where the trace's clock began: later than 0 if it is
    /// the second of two runs.
    pub began: Micros,
    /// At how many places the plug-in could have been swapped.
    pub swap_places: u32,
    /// A delivery is under way at the end.
    pub is_delivering: bool,
    /// What the plug-in's computing cost.
    pub fuel: Fuel,
    /// Bytes that came, left, and were delivered.
    pub bytes: u64,
}

impl Outcome {
    pub(crate) fn unstarted(fault: Fault) -> Self {
        let (seen, fuel) = (Vec::new(), Fuel::default());
        let began = Micros::ZERO;
        let fault = Some(fault);
        Self { seen, fault, began, swap_places: 0, is_delivering: false, fuel, bytes: 0 }
    }
}
