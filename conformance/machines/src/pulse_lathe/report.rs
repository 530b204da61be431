//! What a simulated lathe has to tell.

use softplug_abi::Micros;

/// What has happened at a lathe.
///
/// ```
/// use softplug_machines::pulse_lathe::LatheReport;
///
/// let report = LatheReport { x: -200, ..LatheReport::default() };
/// assert_eq!(report.x_millimetres(), -1.0);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct LatheReport {
    /// Bytes that came.
    pub bytes: u64,
    /// Pulses of x that came, in both directions.
    pub x_pulses: u64,
    /// Pulses of z that came, in both directions.
    pub z_pulses: u64,
    /// Where x stands, in pulses from where it began.
    pub x: i64,
    /// Where z stands, in pulses from where it began.
    pub z: i64,
    /// How often a byte that had to follow came late.
    pub gaps: u64,
    /// Periods that were missing in these gaps.
    pub missing_periods: u64,
    /// How late a byte was at worst; zero without a gap.
    pub longest_gap: Micros,
    /// Pulses at a limit switch: they moved nothing.
    pub lost_pulses: u64,
    /// Pulses that cut while the spindle stood still.
    pub cut_while_still: u64,
    /// Holds that came.
    pub holds: u32,
    /// Stops that came.
    pub stops: u32,
    /// Programs that have ended.
    pub programs: u32,
    /// Every command, in order.
    pub commands: Vec<u8>,
}

impl LatheReport {
    /// Where x stands, in mm from where it began.
    pub fn x_millimetres(&self) -> f64 {
        self.x as f64 / 200.0
    }

    /// Where z stands, in mm from where it began.
    pub fn z_millimetres(&self) -> f64 {
        self.z as f64 / 100.0
    }
}
