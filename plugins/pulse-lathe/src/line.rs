//! Lines: one axis, or a main axis that carries a minor one along.

use crate::codes;
use softplug_plugin::{StateReader, StateWriter};

/// A line, pulse by pulse of its main axis.
///
/// ```
/// use pulse_lathe::Line;
///
/// // Three pulses of z, two of them with one of x.
/// let mut line = Line::between(2, 3);
/// let pulses: Vec<u8> = std::iter::from_fn(|| line.step()).collect();
/// assert_eq!(pulses, [0x05, 0x04, 0x05]);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Line {
    main: u8,
    minor: u8,
    /// Pulses of the main axis to go.
    left: u32,
    sum: u32,
    add: u32,
    modulus: u32,
}

/// The modulus of an α of 12 bits.
const ALPHA: u32 = 0o10000;

impl Line {
    /// So many pulses of x and of z, with a sign. At each of the main axis the minor
    /// one's are in proportion, rounded half up. Each at most 2³⁰.
    pub fn between(x: i32, z: i32) -> Self {
        let (x_bits, z_bits) = (codes::x(x < 0), codes::z(z < 0));
        let (x, z) = (x.unsigned_abs(), z.unsigned_abs());
        let (main, minor, left, add) =
            if z >= x { (z_bits, x_bits, z, x) } else { (x_bits, z_bits, x, z) };
        Self { main, minor, left, sum: left / 2, add, modulus: left.max(1) }
    }

    /// `left` pulses of the main axis; at each the fraction α of 12 bits is added to a sum, and
    /// at a carry the minor axis pulses too. The sum is a half at the beginning, α 0 stands for one.
    pub fn taper(z_is_main: bool, x_minus: bool, z_minus: bool, left: u32, alpha: u16) -> Self {
        let (x, z) = (codes::x(x_minus), codes::z(z_minus));
        let (main, minor) = if z_is_main { (z, x) } else { (x, z) };
        let add = if alpha == 0 { ALPHA } else { u32::from(alpha) };
        Self { main, minor, left, sum: ALPHA / 2, add, modulus: ALPHA }
    }

    /// The bits of the next pulse of the main axis; `None`: all are done.
    pub fn step(&mut self) -> Option<u8> {
        self.left = self.left.checked_sub(1)?;
        self.sum += self.add;
        if self.sum < self.modulus {
            return Some(self.main);
        }
        self.sum -= self.modulus;
        Some(self.main | self.minor)
    }

    /// Whether all pulses are done.
    pub fn is_over(&self) -> bool {
        self.left == 0
    }

    /// Pulses of the main axis to go.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// Pulses of x and z to go, with their signs.
    pub fn rest(&self) -> (i64, i64) {
        let sum = u64::from(self.sum) + u64::from(self.left) * u64::from(self.add);
        let minor = (sum / u64::from(self.modulus.max(1))) as i64;
        let (main_x, main_z) = codes::pulses(self.main);
        let (minor_x, minor_z) = codes::pulses(self.minor);
        let main = i64::from(self.left);
        (main * main_x + minor * minor_x, main * main_z + minor * minor_z)
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.main);
        state.u8(self.minor);
        for value in [self.left, self.sum, self.add, self.modulus] {
            state.u32(value);
        }
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        Self {
            main: state.u8(),
            minor: state.u8(),
            left: state.u32(),
            sum: state.u32(),
            add: state.u32(),
            modulus: state.u32(),
        }
    }
}
