//! Arcs by point comparison, in steps of both axes.

use crate::codes;
use softplug_plugin::{StateReader, StateWriter};

/// A step on an arc, 0.01 mm, in the unit of an arc's coordinates, 0.05 µm.
pub(crate) const STEP: i64 = 200;

/// Where an arc ends.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum End {
    /// After so many steps of both axes.
    Steps(u32),
    /// After so many changes of quadrant, at these coordinates of the axis that goes inward
    /// there and of the other one.
    Place { changes: u8, inner: i64, outer: i64 },
}

/// An arc, step by step. Coordinates are seen from the centre and turned so that the axis that goes
/// inward in this quadrant, `inner`, comes down to 0, and the other one, `outer`, grows from 0.
///
/// ```
/// use pulse_lathe::Arc;
///
/// // A quarter about the centre, counter-clockwise, from z = 0.02 mm to x = 0.02 mm.
/// let mut arc = Arc::steps(false, 0, 2, 0, 4);
/// let steps: Vec<u8> = std::iter::from_fn(|| arc.step()).collect();
/// assert_eq!(steps, [0x0C, 0x01, 0x01, 0x0C]);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Arc {
    clockwise: bool,
    /// 0 to 3: I to IV.
    quadrant: u8,
    inner: i64,
    outer: i64,
    /// The squared distance from the centre less the squared radius.
    f: i64,
    end: End,
}

impl Arc {
    /// An arc from a place in a quadrant (0: I), which is `z` and `x` steps away from the centre's
    /// axes, over so many steps. Each at most 2²⁴.
    pub fn steps(clockwise: bool, quadrant: u8, z: u32, x: u32, steps: u32) -> Self {
        let (z, x) = (i64::from(z) * STEP, i64::from(x) * STEP);
        let (inner, outer) = if inward_is_z(clockwise, quadrant) { (z, x) } else { (x, z) };
        let mut arc = Self { clockwise, quadrant, inner, outer, f: 0, end: End::Steps(steps) };
        arc.change();
        arc
    }

    /// An arc in 0.05 µm, from the centre: where the axes stand, the radius squared, and where
    /// they stand at the end of so many changes of quadrant.
    pub(crate) fn to(
        clockwise: bool,
        quadrant: u8,
        (z, x): (i64, i64),
        radius_squared: i64,
        changes: u8,
        (z_end, x_end): (i64, i64),
    ) -> Self {
        let (inner, outer) = turned(clockwise, quadrant, z, x);
        let last = after(clockwise, quadrant, changes);
        let (inner_end, outer_end) = turned(clockwise, last, z_end, x_end);
        let f = z * z + x * x - radius_squared;
        let end = End::Place { changes, inner: inner_end, outer: outer_end };
        let mut arc = Self { clockwise, quadrant, inner, outer, f, end };
        arc.change();
        arc
    }

    /// The pulses of the next step; one of x stands for two. `None`: the arc is over.
    pub fn step(&mut self) -> Option<u8> {
        if self.is_over() {
            return None;
        }
        let is_inward = self.goes_inward();
        if is_inward {
            self.f += STEP * STEP - 2 * STEP * self.inner;
            self.inner -= STEP;
        } else {
            self.f += STEP * STEP + 2 * STEP * self.outer;
            self.outer += STEP;
        }
        if let End::Steps(left) = &mut self.end {
            *left -= 1;
        }
        let pulse = self.pulse(is_inward);
        self.change();
        Some(pulse)
    }

    /// Where the axis that goes inward is at 0, or nearer to it than half a step, the next
    /// quadrant begins.
    fn change(&mut self) {
        let may_change = !matches!(self.end, End::Place { changes: 0, .. });
        if may_change && 2 * self.inner < STEP {
            self.next_quadrant();
        }
    }

    /// Whether all steps are done.
    pub fn is_over(&self) -> bool {
        match self.end {
            End::Steps(left) => left == 0,
            End::Place { changes, inner, outer } => {
                changes == 0 && self.inner <= inner && self.outer >= outer
            }
        }
    }

    fn goes_inward(&self) -> bool {
        match self.end {
            End::Place { changes: 0, outer, .. } if self.outer >= outer => true,
            End::Place { changes: 0, inner, .. } if self.inner <= inner => false,
            // Ahead of the axis a step outward comes nearer to the centre before it leaves it.
            _ => self.f >= self.outer.min(0).pow(2),
        }
    }

    fn next_quadrant(&mut self) {
        self.quadrant = after(self.clockwise, self.quadrant, 1);
        (self.inner, self.outer) = (self.outer, -self.inner);
        if let End::Place { changes, .. } = &mut self.end {
            *changes -= 1;
        }
    }

    fn pulse(&self, is_inward: bool) -> u8 {
        let x_is_minus = matches!(self.quadrant, 1 | 2) != self.clockwise;
        let z_is_minus = matches!(self.quadrant, 0 | 1) != self.clockwise;
        if inward_is_z(self.clockwise, self.quadrant) == is_inward {
            codes::z(z_is_minus)
        } else {
            codes::x(x_is_minus)
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.bool(self.clockwise);
        state.u8(self.quadrant);
        for value in [self.inner, self.outer, self.f] {
            state.u64(value.cast_unsigned());
        }
        let (steps, changes, inner, outer) = match self.end {
            End::Steps(left) => (left, u8::MAX, 0, 0),
            End::Place { changes, inner, outer } => (0, changes, inner, outer),
        };
        state.u32(steps);
        state.u8(changes);
        state.u64(inner.cast_unsigned());
        state.u64(outer.cast_unsigned());
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        let mut arc = Self {
            clockwise: state.bool(),
            quadrant: state.u8() & 3,
            inner: state.u64().cast_signed(),
            outer: state.u64().cast_signed(),
            f: state.u64().cast_signed(),
            end: End::Steps(state.u32()),
        };
        let (changes, inner, outer) = (state.u8(), state.u64(), state.u64());
        if changes != u8::MAX {
            let (inner, outer) = (inner.cast_signed(), outer.cast_signed());
            arc.end = End::Place { changes, inner, outer };
        }
        arc
    }
}

/// Counter-clockwise in I and III, and clockwise in II and IV, z goes inward and x outward.
pub(crate) fn inward_is_z(clockwise: bool, quadrant: u8) -> bool {
    quadrant.is_multiple_of(2) != clockwise
}

/// The quadrant behind so many changes.
pub(crate) fn after(clockwise: bool, quadrant: u8, changes: u8) -> u8 {
    if clockwise { quadrant.wrapping_sub(changes) & 3 } else { quadrant.wrapping_add(changes) & 3 }
}

/// Coordinates as they are seen in a quadrant: of the axis that goes inward, and of the other.
pub(crate) fn turned(clockwise: bool, quadrant: u8, z: i64, x: i64) -> (i64, i64) {
    let z = if matches!(quadrant, 1 | 2) { -z } else { z };
    let x = if matches!(quadrant, 2 | 3) { -x } else { x };
    if inward_is_z(clockwise, quadrant) { (z, x) } else { (x, z) }
}
