//! A bus that feeds front-end units, as it is shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A bus: what it is planned to carry, what was measured, and the units that it feeds.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, ToSchema)]
pub struct BusView {
    /// Its name in `gateway.toml`.
    pub name: String,
    /// All bits per second, as planned.
    pub rate: f64,
    /// Data bits of all bits, as planned.
    pub efficiency: f64,
    /// Seconds to switch from one unit to the next, as planned.
    pub switch_seconds: f64,
    /// What was measured in about the last minute.
    pub measured: BusMeasuredView,
    /// The link whose turn it is.
    pub serves: Option<String>,
    /// The links of units that it feeds, in the order of their turns.
    pub units: Vec<BusUnitView>,
}

/// What was measured on a bus in about the last minute; `null`: there was nothing to measure.
#[derive(Copy, Clone, PartialEq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct BusMeasuredView {
    /// Data bits that were sent, as a part of those that the bus is planned to carry.
    pub load: Option<f64>,
    /// Data bits of all bits, both ways.
    pub efficiency: Option<f64>,
    /// Mean seconds from the last bit of a turn to the first one of the next.
    pub switch_seconds: Option<f64>,
}

/// A unit's link on a bus.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, ToSchema)]
pub struct BusUnitView {
    /// Name of the link.
    pub link: String,
    /// The unit's link: `unit://…`.
    pub port: String,
    /// Bytes in the unit's buffer.
    pub level: u64,
    /// Bytes of the unit's buffer; 0 before its first job.
    pub buffer: u64,
    /// The most data bits per second that the machine took; `null`: it was not fed for long enough.
    pub consumes: Option<f64>,
    /// Slots A and B for plug-ins.
    pub slots: Vec<UnitSlotView>,
}

/// A slot for a plug-in in a unit's memory.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct UnitSlotView {
    /// `A` or `B`.
    pub slot: String,
    /// What it holds: `empty`, `being written`, `written`, `on trial`, `confirmed` or `failed`.
    pub state: String,
    /// SHA-256 of the plug-in in it.
    pub digest: Option<String>,
    /// It is the one that runs.
    pub runs: bool,
}
