//! How large what a shop says may be, and how small.

/// Lowest rate of bus, lines and controls, in bit/s. What is below is refused as a slip.
pub const LEAST_RATE: f64 = 1.0;
/// Highest rate of bus and lines, in bit/s. What is above is refused as a slip.
pub const MOST_RATE: f64 = 1e12;
/// Longest time to switch the bus, in seconds. What is above is refused as a slip.
pub const MOST_SWITCH: f64 = 60.0;
/// Largest buffer of a control, in bytes. What is above is refused as a slip.
pub const MOST_BUFFER: u64 = 1 << 30;
/// Most machines on one bus, all counts together. More are refused.
pub const MOST_MACHINES: u64 = 1_000;
/// Most characters of a name. Longer ones are refused.
pub const MOST_NAME: usize = 64;
/// The margin of a shop that gives none: enough to make strict what must be strict.
pub const DEFAULT_MARGIN: f64 = 1e-6;
/// Largest margin: machines are planned as if they took ten times as much.
pub const MOST_MARGIN: f64 = 0.9;
