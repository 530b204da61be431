//! What came of a simulation.

use serde::Serialize;

/// What came of a simulation.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Outcome {
    /// Seconds of virtual time that were simulated.
    pub seconds: f64,
    /// Whether that is all that was asked for; else there were too many services.
    pub is_complete: bool,
    /// How often the bus served a unit, or rested.
    pub services: u64,
    /// Each machine, as the shop has them.
    pub machines: Vec<MachineOutcome>,
}

impl Outcome {
    /// Most levels that are kept of each machine; those after it are not.
    pub const MOST_SAMPLES: usize = 4_096;
    /// Most dry spells that are kept of each machine; those after it are counted.
    pub const MOST_DRY: usize = 64;

    /// Whether it was simulated to the end, no machine ran dry, and no bit was lost.
    pub fn holds(&self) -> bool {
        self.is_complete && self.holds_so_far()
    }

    /// Whether no machine ran dry and no bit was lost as far as it was simulated.
    pub fn holds_so_far(&self) -> bool {
        !self.ran_dry() && self.machines.iter().all(|machine| machine.overflow_bits == 0.0)
    }

    /// Whether some machine ran dry.
    pub fn ran_dry(&self) -> bool {
        self.machines.iter().any(|machine| machine.times_dry > 0)
    }

    /// Whether each control was full whenever its unit's next fill began. From
    /// [`Start::Worst`](crate::Start::Worst) on this is what the model promises: a control that was
    /// empty at the end of a fill has recovered by the next.
    pub fn recovers(&self) -> bool {
        self.machines.iter().all(|machine| machine.short_fills == 0)
    }
}

/// What came of one machine. A spell, an overflow or a lack of less than a ten-millionth of the
/// buffer that it concerns is rounding, and none.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MachineOutcome {
    /// Its name.
    pub name: String,
    /// How often it had less than it takes.
    pub times_dry: u64,
    /// For how long in all, in seconds.
    pub seconds_dry: f64,
    /// The first of these times.
    pub dry: Vec<Dry>,
    /// Bits that came to a full unit and were lost.
    pub overflow_bits: f64,
    /// Fills that began while the control was not full.
    pub short_fills: u64,
    /// Lowest level of the control's own buffer, in bits.
    pub lowest_control_bits: f64,
    /// Buffer of the unit, in bits.
    pub unit_size_bits: f64,
    /// Buffer of the control, in bits.
    pub control_size_bits: f64,
    /// Levels over time, if they were to be kept; straight lines join them.
    pub levels: Vec<Sample>,
}

/// A time in which a machine had less than it takes.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Dry {
    /// Seconds from the start.
    pub from: f64,
    /// Seconds that it lasted.
    pub seconds: f64,
}

/// Levels at a moment.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Sample {
    /// Seconds from the start.
    pub at: f64,
    /// Bits in the unit.
    pub unit: f64,
    /// Bits in the control.
    pub control: f64,
}
