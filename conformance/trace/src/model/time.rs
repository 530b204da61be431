//! Virtual time: µs since the case began.

use std::fmt;

/// A moment, in µs since the case began.
///
/// ```
/// use softplug_trace::Time;
///
/// assert_eq!(Time(2_001_146).to_string(), "2.001146");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Time(pub u64);

/// A moment or an inclusive window of moments.
///
/// ```
/// use softplug_trace::{Time, When};
///
/// let window = When { from: Time(2_000_000), to: Time(2_010_000) };
/// assert!(window.is_window() && window.contains(Time(2_005_000)));
/// assert_eq!(window.to_string(), "2.000000~2.010000");
/// assert_eq!(When::at(Time(0)).to_string(), "0.000000");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub struct When {
    /// The first moment.
    pub from: Time,
    /// The last moment; the same as `from` without a window.
    pub to: Time,
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:06}", self.0 / 1_000_000, self.0 % 1_000_000)
    }
}

impl When {
    /// At exactly this moment.
    pub const fn at(time: Time) -> Self {
        Self { from: time, to: time }
    }

    /// Whether it is a window of more than one moment.
    pub fn is_window(self) -> bool {
        self.from != self.to
    }

    /// Whether `time` is one of its moments.
    pub fn contains(self, time: Time) -> bool {
        self.from <= time && time <= self.to
    }
}

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_window() { write!(f, "{}~{}", self.from, self.to) } else { self.from.fmt(f) }
    }
}
