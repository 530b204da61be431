//! What a board has to be able to do.

use softplug_abi::{LineParameters, Micros};
use softplug_unit_slots::Device;

/// A board: a clock, two serial lines, and flash that can be read where it lies.
///
/// Nothing here waits: what cannot be done now is asked for again. `tests/unit/shop.rs` has a board in memory.
pub trait Board {
    /// The flash that holds the two slots.
    type Flash: Device;
    /// A plug-in's bytes in it.
    type Code: AsRef<[u8]>;

    /// The time since some moment; it never goes back.
    fn now(&mut self) -> Micros;

    /// Sets the line to the machine.
    fn set_line(&mut self, line: &LineParameters);

    /// What has come from the machine next.
    fn hear_machine(&mut self) -> Option<FromMachine>;

    /// Whether the line to the machine takes a character now.
    fn machine_takes(&mut self) -> bool;

    /// Gives it one, if it takes one.
    fn tell_machine(&mut self, byte: u8);

    /// Begins or ends a break on the line to the machine.
    fn set_break(&mut self, on: bool);

    /// The next byte of the uplink.
    fn hear_uplink_byte(&mut self) -> Option<u8>;

    /// Gives the uplink a byte. `false`: not now.
    fn tell_uplink_byte(&mut self, byte: u8) -> bool;

    /// The bytes at this place of the flash. They do not change as long as the plug-in in them runs.
    fn code(&self, at: u32, length: u32) -> Self::Code;
}

/// What comes from the machine.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum FromMachine {
    /// A character.
    Byte(u8),
    /// One or more characters were lost: nobody took them in time.
    Overrun,
}
