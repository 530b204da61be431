//! Checks of blocks: by exclusive or, by sum, by CRC.
//!
//! The bytes may stand in several places: each function takes a list of slices. The CRCs are those of the
//! crate `crc`, each with a table of 512 bytes: the first one is 0.9 KB of a module, a further one 0.7 KB, BCC and
//! sum 0.1 KB each.

use crc::{CRC_16_ARC, CRC_16_IBM_3740, CRC_16_KERMIT, CRC_16_MODBUS, CRC_16_XMODEM, Crc, Table};

/// All bytes by exclusive or: the BCC, or longitudinal parity, of 3964R and many others.
///
/// ```
/// assert_eq!(softplug_plugin::parts::checks::bcc(&[b"G1", &[0x03]]), b'G' ^ b'1' ^ 0x03);
/// ```
pub fn bcc(pieces: &[&[u8]]) -> u8 {
    each(pieces, 0, |check, byte| check ^ byte)
}

/// The sum of all bytes, of which the lowest eight bits count: XMODEM has it as it is, DF1 and Modbus
/// ASCII its two's complement (`sum.wrapping_neg()`).
///
/// ```
/// assert_eq!(softplug_plugin::parts::checks::sum(&[&[0xFF, 0x03]]), 0x02);
/// ```
pub fn sum(pieces: &[&[u8]]) -> u8 {
    each(pieces, 0, u8::wrapping_add)
}

fn each(pieces: &[&[u8]], first: u8, next: impl Fn(u8, u8) -> u8) -> u8 {
    pieces.iter().copied().flatten().fold(first, |check, byte| next(check, *byte))
}

macro_rules! crcs {
    ($($(#[$about:meta])* $name:ident: $algorithm:ident, $of_digits:literal;)*) => {
        $(
            $(#[$about])*
            ///
            /// ```
            #[doc = concat!("use softplug_plugin::parts::checks::", stringify!($name), ";")]
            #[doc = concat!("assert_eq!(", stringify!($name), "(&[b\"1234\", b\"56789\"]), ", stringify!($of_digits), ");")]
            /// ```
            pub fn $name(pieces: &[&[u8]]) -> u16 {
                static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&$algorithm);
                let mut digest = CRC.digest();
                for piece in pieces {
                    digest.update(piece);
                }
                digest.finalize()
            }
        )*
    };
}

crcs! {
    /// CRC-16 of Modbus RTU; its low byte goes first.
    crc16_modbus: CRC_16_MODBUS, 0x4B37;
    /// CRC-16 of ARC, as DF1 has it; its low byte goes first.
    crc16_arc: CRC_16_ARC, 0xBB3D;
    /// CRC-16 of XMODEM, the CCITT polynomial from 0 on; its high byte goes first.
    crc16_xmodem: CRC_16_XMODEM, 0x31C3;
    /// CRC-16 that is mostly called CCITT, or CCITT-FALSE: from 0xFFFF on; its high byte goes first.
    crc16_ccitt: CRC_16_IBM_3740, 0x29B1;
    /// CRC-16 of Kermit, and of ISO-HDLC's relatives: the CCITT polynomial, lowest bit first.
    crc16_kermit: CRC_16_KERMIT, 0x2189;
}
