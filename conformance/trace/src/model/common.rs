//! What front matter and entries both say: settings, rooms and modem lines.

use std::collections::BTreeMap;

/// `name=value`, the value as text.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Assignment {
    /// Lower-case letters, digits, `_` and `-`, a letter first.
    pub name: String,
    /// Any text; what it means is up to who reads it.
    pub value: String,
}

/// Room in bytes; `None` leaves it to whoever runs the case.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Room {
    /// Room to transmit.
    pub transmit: Option<u32>,
    /// Room to deliver.
    pub delivery: Option<u32>,
}

/// A modem line, named as on our own port.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum ModemLine {
    /// Clear to send, an input.
    Cts,
    /// Data set ready, an input.
    Dsr,
    /// Carrier detect, an input.
    Dcd,
    /// Ring, an input.
    Ri,
    /// Request to send, an output.
    Rts,
    /// Data terminal ready, an output.
    Dtr,
}

impl ModemLine {
    /// The lines that the partner sets.
    pub const INPUTS: &'static [Self] = &[Self::Cts, Self::Dsr, Self::Dcd, Self::Ri];
    /// The lines that we set.
    pub const OUTPUTS: &'static [Self] = &[Self::Rts, Self::Dtr];

    /// The name in a trace.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cts => "cts",
            Self::Dsr => "dsr",
            Self::Dcd => "dcd",
            Self::Ri => "ri",
            Self::Rts => "rts",
            Self::Dtr => "dtr",
        }
    }
}

/// Modem lines and whether each is on. Lines that are not in it keep their state.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ModemLevels(pub BTreeMap<ModemLine, bool>);
