//! A computer's memory, by areas.

use std::collections::BTreeMap;

/// An area of memory.
///
/// ```
/// use softplug_machines::r3964::rk512::Area;
///
/// assert_eq!((Area::Db(5).letter(), Area::Db(5).unit()), (b'D', 2));
/// assert_eq!((Area::Flags.letter(), Area::Flags.unit()), (b'M', 1));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Area {
    /// A data block, in words.
    Db(u8),
    /// An extended data block, in words.
    Dx(u8),
    /// Inputs, in bytes.
    Inputs,
    /// Outputs, in bytes.
    Outputs,
    /// Flags, in bytes.
    Flags,
    /// Timers, in words.
    Timers,
    /// Counters, in words.
    Counters,
}

impl Area {
    /// Its letter in a telegram.
    pub fn letter(self) -> u8 {
        match self {
            Self::Db(_) => 0x44,
            Self::Dx(_) => 0x58,
            Self::Inputs => 0x45,
            Self::Outputs => 0x41,
            Self::Flags => 0x4D,
            Self::Timers => 0x54,
            Self::Counters => 0x5A,
        }
    }

    /// Bytes of what is counted in it.
    pub fn unit(self) -> usize {
        match self {
            Self::Db(_) | Self::Dx(_) | Self::Timers | Self::Counters => 2,
            Self::Inputs | Self::Outputs | Self::Flags => 1,
        }
    }

    pub(super) fn block(self) -> u8 {
        match self {
            Self::Db(block) | Self::Dx(block) => block,
            _ => 0,
        }
    }

    pub(super) fn from_telegram(letter: u8, block: u8) -> Option<Self> {
        Some(match letter {
            0x44 => Self::Db(block),
            0x58 => Self::Dx(block),
            0x45 => Self::Inputs,
            0x41 => Self::Outputs,
            0x4D => Self::Flags,
            0x54 => Self::Timers,
            0x5A => Self::Counters,
            _ => return None,
        })
    }
}

/// The areas that there are, as bytes.
///
/// ```
/// use softplug_machines::r3964::rk512::{Area, Memory};
///
/// let mut memory = Memory::default();
/// memory.set(Area::Db(5), vec![0; 64]);
/// assert_eq!(memory.area(Area::Db(5)).map(<[u8]>::len), Some(64));
/// assert_eq!(memory.area(Area::Db(6)), None);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Memory {
    areas: BTreeMap<Area, Vec<u8>>,
}

impl Memory {
    /// Makes an area, or makes it anew.
    pub fn set(&mut self, area: Area, bytes: Vec<u8>) {
        self.areas.insert(area, bytes);
    }

    /// An area's bytes.
    pub fn area(&self, area: Area) -> Option<&[u8]> {
        self.areas.get(&area).map(Vec::as_slice)
    }

    pub(super) fn range(&mut self, area: Area, at: usize, bytes: usize) -> Option<&mut [u8]> {
        self.areas.get_mut(&area)?.get_mut(at..at + bytes)
    }
}
