//! Time as a plug-in knows it.

use core::fmt;
use core::ops::{Add, Sub};

/// Microseconds: an instant on a link's clock, which starts at the first open,
/// or a span between two.
///
/// ```
/// use softplug_abi::Micros;
///
/// let qvz = Micros::from_millis(2_000);
/// assert_eq!((Micros(1_146) + qvz).to_string(), "2.001146");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Micros(pub i64);

impl Micros {
    /// The instant at which the clock starts, or an empty span.
    pub const ZERO: Self = Self(0);
    /// An instant that never comes.
    pub const MAX: Self = Self(i64::MAX);

    /// A span of milliseconds; saturates.
    pub const fn from_millis(millis: i64) -> Self {
        // Not `saturating_mul`: on wasm32 it takes a multiplication to 128 bits.
        const MOST: i64 = i64::MAX / 1_000;
        if millis > MOST {
            return Self::MAX;
        }
        if millis < -MOST {
            return Self(i64::MIN);
        }
        Self(millis * 1_000)
    }

    /// A span of seconds; saturates.
    pub const fn from_secs(secs: i64) -> Self {
        Self(secs.saturating_mul(1_000_000))
    }

    /// Seconds as a floating-point number, for people and rates.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / 1e6
    }
}

impl Add for Micros {
    type Output = Self;

    #[inline]
    fn add(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl Sub for Micros {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl fmt::Display for Micros {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let micros = self.0.unsigned_abs();
        write!(f, "{sign}{}.{:06}", micros / 1_000_000, micros % 1_000_000)
    }
}
