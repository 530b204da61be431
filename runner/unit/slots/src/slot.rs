//! One of the two slots, and what fits into it.

/// The longest module that a slot takes, in bytes, however large the device: that of the ABI.
pub const LONGEST_MODULE: u32 = 256 * 1_024;
/// Bytes of a module that each slot must at least have room for, else the device is refused as too small.
pub const LEAST_ROOM: u32 = 1_024;

/// One of the two slots.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Slot {
    /// The first half of the device.
    A,
    /// The second half.
    B,
}

impl Slot {
    /// Both.
    pub const BOTH: [Self; 2] = [Self::A, Self::B];

    /// The other one.
    pub const fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }

    /// Its number: 0 for A, 1 for B.
    pub const fn number(self) -> u8 {
        match self {
            Self::A => 0,
            Self::B => 1,
        }
    }

    pub(crate) const fn index(self) -> usize {
        self.number() as usize
    }
}

impl core::fmt::Display for Slot {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        out.write_str(match self {
            Self::A => "A",
            Self::B => "B",
        })
    }
}
