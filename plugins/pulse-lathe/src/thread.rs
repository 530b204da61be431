//! Threads: z follows the spindle.

use crate::codes;
use softplug_plugin::{StateReader, StateWriter};

/// A pulse of z in the unit of a pitch, 0.1 µm.
pub(crate) const Z_PULSE: u64 = 100;

/// A thread: of increments times pitch, whole pulses leave, and the rest is kept. So nothing adds
/// up however long it is.
///
/// ```
/// use pulse_lathe::Thread;
///
/// // Ten pulses in the direction +, 0.025 mm a turn, four increments a turn.
/// let mut thread = Thread::new(false, 10, 250, 4);
/// assert_eq!((thread.turned(4), thread.turned(4), thread.turned(63)), (2, 3, 5));
/// assert!(thread.is_over());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Thread {
    is_minus: bool,
    /// Pulses to go.
    left: u32,
    /// In 0.1 µm a turn.
    pitch: u32,
    increments: u32,
    /// What is left over of increments times pitch.
    rest: u64,
}

impl Thread {
    /// So many pulses of z, at a pitch in 0.1 µm a turn of so many increments. Neither is 0.
    pub fn new(is_minus: bool, pulses: u32, pitch: u32, increments: u32) -> Self {
        Self { is_minus, left: pulses, pitch, increments, rest: 0 }
    }

    /// The spindle has turned by so many increments. Returns how many pulses follow.
    pub fn turned(&mut self, increments: u32) -> u32 {
        let turn = u64::from(self.increments.max(1)) * Z_PULSE;
        let sum = self.rest + u64::from(increments) * u64::from(self.pitch);
        self.rest = sum % turn;
        let pulses = (sum / turn).min(u64::from(self.left)) as u32;
        self.left -= pulses;
        pulses
    }

    /// The byte of one of its pulses.
    pub(crate) fn pulse(&self) -> u8 {
        codes::z(self.is_minus)
    }

    /// Whether all pulses are done.
    pub fn is_over(&self) -> bool {
        self.left == 0
    }

    /// Pulses of z to go, with their sign.
    pub(crate) fn rest(&self) -> i64 {
        let left = i64::from(self.left);
        if self.is_minus { -left } else { left }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.bool(self.is_minus);
        for value in [self.left, self.pitch, self.increments] {
            state.u32(value);
        }
        state.u64(self.rest);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        Self {
            is_minus: state.bool(),
            left: state.u32(),
            pitch: state.u32(),
            increments: state.u32(),
            rest: state.u64(),
        }
    }
}
