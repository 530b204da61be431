//! The bytes of the line, as `docs/protocols/pulse-lathe.md` lists them.

/// A pulse of x.
pub const X: u8 = 0x01;
/// The pulse of x is in the direction −.
pub const X_MINUS: u8 = 0x02;
/// A pulse of z.
pub const Z: u8 = 0x04;
/// The pulse of z is in the direction −.
pub const Z_MINUS: u8 = 0x08;
/// The byte of the next period follows without a gap.
pub const FOLLOWS: u8 = 0x40;

/// The speed step stands in the six lower bits.
pub const SPEED: u8 = 0x80;
/// The tool stands in the three lower bits.
pub const TOOL: u8 = 0xC0;
/// The auxiliary function stands in the four lower bits.
pub const FUNCTION: u8 = 0xD0;
/// The pulses stand still and go on later.
pub const HOLD: u8 = 0xE0;
/// Nothing more of the program follows.
pub const STOP: u8 = 0xE1;
/// The program is over.
pub const END: u8 = 0xE2;

/// From the machine: the index mark is at the end of these increments.
pub const INDEX: u8 = 0x40;
/// From the machine: the increments of a character.
pub const INCREMENTS: u8 = 0x3F;
/// From the machine: the operator's hold.
pub const KEY_HOLD: u8 = 0xF0;
/// From the machine: the operator's start.
pub const KEY_START: u8 = 0xF1;
/// From the machine: the operator's stop.
pub const KEY_STOP: u8 = 0xF2;
/// From the machine: the first and the last code of a limit switch.
pub const LIMITS: core::ops::RangeInclusive<u8> = 0xF5..=0xF7;

/// Pulses of x and z in one byte from us.
///
/// ```
/// assert_eq!(pulse_lathe::codes::pulses(0x47), (-1, 1));
/// assert_eq!(pulse_lathe::codes::pulses(0xC7), (0, 0));
/// ```
pub fn pulses(byte: u8) -> (i64, i64) {
    if byte & 0x80 != 0 {
        return (0, 0);
    }
    let pulse = |there: u8, minus: u8| match (byte & there != 0, byte & minus != 0) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => -1,
    };
    (pulse(X, X_MINUS), pulse(Z, Z_MINUS))
}

/// A pulse of x in a direction.
pub(crate) fn x(is_minus: bool) -> u8 {
    if is_minus { X | X_MINUS } else { X }
}

/// A pulse of z in a direction.
pub(crate) fn z(is_minus: bool) -> u8 {
    if is_minus { Z | Z_MINUS } else { Z }
}
