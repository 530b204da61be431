//! The line: how its characters look, and the modem lines beside it.

use crate::Micros;

/// The parity of a character.
///
/// ```
/// use softplug_abi::{LineParameters, Parity};
///
/// let line = LineParameters { data_bits: 7, parity: Parity::Even, ..LineParameters::new(4_800) };
/// assert_eq!(line.half_bits(), 20);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Hash)]
pub enum Parity {
    /// No parity bit.
    #[default]
    None,
    /// The number of ones is odd.
    Odd,
    /// The number of ones is even.
    Even,
    /// The parity bit is 1.
    Mark,
    /// The parity bit is 0.
    Space,
}

/// How characters look on the line.
///
/// ```
/// use softplug_abi::{LineParameters, Micros, Parity};
///
/// let line = LineParameters { baud: 9_600, data_bits: 8, parity: Parity::Even, stop_half_bits: 2 };
/// assert_eq!(line.half_bits(), 22);
/// assert_eq!(line.characters(1), Micros(1_146));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Hash)]
pub struct LineParameters {
    /// Bits per second; 0 where the line's rate is unknown (TCP, pty).
    pub baud: u32,
    /// Data bits, 5 to 8.
    pub data_bits: u8,
    /// The parity bit.
    pub parity: Parity,
    /// Stop bits in halves: 2, 3 or 4.
    pub stop_half_bits: u8,
}

impl LineParameters {
    /// 8N1 at `baud`.
    pub const fn new(baud: u32) -> Self {
        Self { baud, data_bits: 8, parity: Parity::None, stop_half_bits: 2 }
    }

    /// Length of a character in half bits, start bit included.
    pub const fn half_bits(&self) -> u32 {
        let parity = !matches!(self.parity, Parity::None) as u32;
        2 + 2 * (self.data_bits as u32 + parity) + self.stop_half_bits as u32
    }

    /// Time that `count` characters take back to back, rounded up to a whole
    /// µs; zero where the rate is unknown.
    pub const fn characters(&self, count: u64) -> Micros {
        if self.baud == 0 {
            return Micros(0);
        }
        let half_bits = count as u128 * self.half_bits() as u128 * 1_000_000;
        Micros(half_bits.div_ceil(2 * self.baud as u128) as i64)
    }
}

/// A set of modem lines, named as on our own port.
///
/// ```
/// use softplug_abi::ModemLines;
///
/// let on = ModemLines::CTS.union(ModemLines::DSR);
/// assert!(on.contains(ModemLines::CTS));
/// assert!(!on.contains(ModemLines::CTS.union(ModemLines::DCD)));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Hash)]
pub struct ModemLines(pub u8);

impl ModemLines {
    /// Clear to send, an input.
    pub const CTS: Self = Self(1);
    /// Data set ready, an input.
    pub const DSR: Self = Self(2);
    /// Carrier detect, an input.
    pub const DCD: Self = Self(4);
    /// Ring, an input.
    pub const RI: Self = Self(8);
    /// Request to send, an output.
    pub const RTS: Self = Self(16);
    /// Data terminal ready, an output.
    pub const DTR: Self = Self(32);
    /// The lines that a plug-in can set.
    pub const OUTPUTS: Self = Self(16 | 32);
    /// Every line there is.
    pub const ALL: Self = Self(63);

    /// Whether all of `lines` are in the set.
    pub const fn contains(self, lines: Self) -> bool {
        self.0 & lines.0 == lines.0
    }

    /// Both sets together.
    pub const fn union(self, lines: Self) -> Self {
        Self(self.0 | lines.0)
    }
}
