//! A plug-in that does as it is told and writes down what it was given, on a
//! line in virtual time.

#![allow(dead_code, unused_imports, reason = "each test file uses a part of it")]

mod rig;
mod script;

pub(crate) use rig::Rig;
pub(crate) use script::{Plugin, Refused, Script, setting_values};

use softplug_abi::{LineParameters, Micros};
use softplug_link::LinkOptions;

/// A line of 10,000 baud, 8N1: a character takes exactly 1,000 µs.
pub(crate) const CHARACTER: i64 = 1_000;

/// Options with that line and these rooms.
pub(crate) fn rooms(transmit_room: u32, delivery_room: u32) -> LinkOptions {
    let line = LineParameters::new(10_000);
    LinkOptions { line, transmit_room, delivery_room, ..LinkOptions::default() }
}

/// A line whose rate is unknown.
pub(crate) fn unknown_rate() -> LinkOptions {
    LinkOptions { line: LineParameters::new(0), ..rooms(64, 64) }
}

/// Times as numbers, for comparing.
pub(crate) fn micros(at: Micros) -> i64 {
    at.0
}
