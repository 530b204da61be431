//! When characters begin and end that follow each other at the line rate.

use softplug_abi::Parity;

use crate::model::LineSettings;

/// The time that characters take on a line.
#[derive(Copy, Clone)]
pub(crate) struct Pace {
    /// µs that a character takes, as a fraction.
    micros: u64,
    parts: u64,
}

impl Pace {
    pub(crate) fn of(line: &LineSettings) -> Self {
        let parity = u64::from(line.parity != Parity::None);
        let half_bits =
            2 * (1 + u64::from(line.data_bits) + parity) + u64::from(line.stop_half_bits);
        if line.baud == 0 {
            return Self { micros: 0, parts: 1 };
        }
        let (micros, parts) = (half_bits * 1_000_000, 2 * u64::from(line.baud));
        let common = common_divisor(micros, parts);
        Self { micros: micros / common, parts: parts / common }
    }

    /// µs that `count` characters take, rounded up.
    pub(crate) fn of_characters(self, count: usize) -> i64 {
        (count as u128 * u128::from(self.micros)).div_ceil(u128::from(self.parts)) as i64
    }

    /// The largest number of characters, `most` at most, after which a run can be cut
    /// without a change of the times behind the cut.
    pub(super) fn cut(self, most: usize) -> usize {
        // After so many characters the sum is a whole number of µs.
        let whole = self.parts as usize;
        if whole > most { 1 } else { most - most % whole }
    }

    /// Whether a run of `more` characters that begins `after` µs behind one of
    /// `count` goes on as if both were one.
    pub(super) fn goes_on(self, count: usize, after: i64, more: usize) -> bool {
        (0..more).all(|n| self.of_characters(count + n) == after + self.of_characters(n))
    }
}

fn common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(baud: u32, stop_half_bits: u8) -> LineSettings {
        let parity = Parity::None;
        LineSettings { baud, data_bits: 8, parity, stop_half_bits, depth: 1, reaction: 0 }
    }

    #[test]
    fn characters_take_their_bits() {
        let pace = Pace::of(&line(9_600, 2));
        let times = [0, 1, 2, 3, 24].map(|count| pace.of_characters(count));
        assert_eq!(times, [0, 1_042, 2_084, 3_125, 25_000]);
        assert_eq!(Pace::of(&line(9_600, 3)).of_characters(2), 2_188);
        assert_eq!(Pace::of(&line(0, 2)).of_characters(1_000), 0);
    }

    #[test]
    fn cuts_keep_all_times() {
        let pace = Pace::of(&line(9_600, 2));
        assert_eq!(pace.cut(64), 63);
        assert!(pace.goes_on(63, pace.of_characters(63), 1_000));
        assert!(pace.goes_on(1, 1_042, 2) && !pace.goes_on(1, 1_042, 3));
        assert!(!pace.goes_on(1, 1_041, 1) && !pace.goes_on(1, 1_043, 1));
        // A rate at which no number of characters of this size gives whole µs.
        assert_eq!(Pace::of(&line(9_601, 2)).cut(64), 1);
    }
}
