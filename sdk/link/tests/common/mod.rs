//! A plug-in that does as it is told and writes down what it was given, on a
//! line in virtual time.

mod rig;
mod script;

pub(crate) use rig::Rig;
pub(crate) use script::{Plugin, Refused, Script, setting_values};

use softplug_abi::LineParameters;
use softplug_link::LinkOptions;

/// Options with a line of 10,000 baud, 8N1, on which a character takes exactly 1,000 µs, and these rooms.
pub(crate) fn rooms(transmit_room: u32, delivery_room: u32) -> LinkOptions {
    let line = LineParameters::new(10_000);
    LinkOptions { line, transmit_room, delivery_room, ..LinkOptions::default() }
}

/// A line whose rate is unknown.
pub(crate) fn unknown_rate() -> LinkOptions {
    LinkOptions { line: LineParameters::new(0), ..rooms(64, 64) }
}
