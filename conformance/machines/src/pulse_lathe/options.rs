//! What a simulated lathe is like.

use softplug_abi::Micros;
use std::fmt;

/// Options of a lathe. x is a radius in pulses of 0.005 mm, z in pulses of 0.01 mm; z 0 is the face
/// of the blank, which reaches to the left.
///
/// ```
/// use softplug_machines::pulse_lathe::LatheOptions;
///
/// assert!(LatheOptions { increments: 0, ..LatheOptions::default() }.check().is_err());
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LatheOptions {
    /// Radius of the blank.
    pub blank_radius: i64,
    /// Length of the blank.
    pub blank_length: u32,
    /// Where the tool stands at the beginning.
    pub start_x: i64,
    /// Where the tool stands at the beginning.
    pub start_z: i64,
    /// How far x can go from the start, in both directions.
    pub x_limits: (i64, i64),
    /// How far z can go from the start, in both directions.
    pub z_limits: (i64, i64),
    /// Increments of a turn of the spindle.
    pub increments: u64,
    /// Turns a minute of a speed step.
    pub turns_a_step: u64,
    /// How long S, T or M takes.
    pub work_time: Micros,
}

impl Default for LatheOptions {
    /// A blank of 40 mm across and 60 mm long, the tool 5 mm outside of its edge.
    fn default() -> Self {
        Self {
            blank_radius: 4_000,
            blank_length: 6_000,
            start_x: 5_000,
            start_z: 500,
            x_limits: (-6_000, 20_000),
            z_limits: (-20_000, 20_000),
            increments: 1_024,
            turns_a_step: 50,
            work_time: Micros::from_millis(5),
        }
    }
}

/// Options that cannot be.
///
/// ```
/// use softplug_machines::pulse_lathe::LatheOptionsError;
///
/// assert_eq!(LatheOptionsError::Spindle.to_string(), "a turn of the spindle has 1 to 65535 increments");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum LatheOptionsError {
    /// A turn without increments, or with too many.
    Spindle,
    /// The tool stands at a limit already.
    Limits,
    /// No blank.
    Blank,
}

impl fmt::Display for LatheOptionsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Spindle => "a turn of the spindle has 1 to 65535 increments",
            Self::Limits => "the limits of an axis are on both sides of where the tool begins",
            Self::Blank => "the blank has a diameter and a length, of at most 1000 mm",
        })
    }
}

impl std::error::Error for LatheOptionsError {}

impl LatheOptions {
    /// Whether they fit each other.
    ///
    /// # Errors
    /// They do not.
    pub fn check(&self) -> Result<(), LatheOptionsError> {
        if !(1..=65_535).contains(&self.increments) {
            return Err(LatheOptionsError::Spindle);
        }
        let encloses = |(low, high): (i64, i64)| low <= 0 && high >= 0;
        if !encloses(self.x_limits) || !encloses(self.z_limits) {
            return Err(LatheOptionsError::Limits);
        }
        let is_blank = (1..=100_000).contains(&self.blank_radius)
            && (1..=100_000).contains(&self.blank_length);
        if is_blank { Ok(()) } else { Err(LatheOptionsError::Blank) }
    }
}
