//! Blocks as they stand on the line: what begins them, their numbers, their checks.

use softplug_plugin::State;
use softplug_plugin::parts::{Block, checks};

pub(crate) const SOH: u8 = 0x01;
pub(crate) const STX: u8 = 0x02;
pub(crate) const EOT: u8 = 0x04;
pub(crate) const ACK: u8 = 0x06;
pub(crate) const NAK: u8 = 0x15;
pub(crate) const CAN: u8 = 0x18;
/// Calls for a file with CRC.
pub(crate) const CALL: u8 = b'C';

/// Bytes of data in a block that begins with SOH.
pub(crate) const SHORT: usize = 128;
/// Bytes of data in a block that begins with STX.
pub(crate) const LONG: usize = 1_024;
/// What stands before the data: SOH or STX, number, complement.
pub(crate) const HEADER: usize = 3;

/// The check behind a block's data, and its length.
pub(crate) fn check(data: &[u8], is_crc: bool) -> ([u8; 2], usize) {
    if is_crc {
        return (checks::crc16_xmodem(&[data]).to_be_bytes(), 2);
    }
    let sum = checks::sum(&[data]);
    ([sum, 0], 1)
}

/// Bytes of one block, of which the first ones are there.
pub(crate) type Data = Block<LONG>;

/// What a character made of the block.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Heard {
    /// There is more to come.
    Part,
    /// The last one: the block is good.
    Good,
    /// It can be no block any more.
    Bad,
}

/// The block that is being heard.
#[derive(Copy, Clone, Debug, State)]
pub(crate) struct Reader {
    is_long: bool,
    is_crc: bool,
    pub(crate) number: u8,
    /// Characters so far, with SOH or STX.
    pub(crate) count: u16,
    pub(crate) data: Data,
    /// The first byte of a CRC.
    high: u8,
}

impl Reader {
    pub(crate) const fn new() -> Self {
        Self { is_long: false, is_crc: false, number: 0, count: 0, data: Data::new(), high: 0 }
    }

    pub(crate) fn begin(&mut self, first: u8, is_crc: bool) {
        self.is_long = first == STX;
        self.is_crc = is_crc;
        self.count = 1;
        self.data.clear();
    }

    /// One character behind SOH or STX.
    pub(crate) fn take(&mut self, byte: u8) -> Heard {
        self.count += 1;
        let length = if self.is_long { LONG } else { SHORT };
        match usize::from(self.count) - 1 {
            1 => self.number = byte,
            2 if self.number != !byte => return Heard::Bad,
            2 => {}
            place if place < HEADER + length => _ = self.data.push(byte),
            place => return self.take_check(byte, place == HEADER + length),
        }
        Heard::Part
    }

    fn take_check(&mut self, byte: u8, is_first: bool) -> Heard {
        if is_first && self.is_crc {
            self.high = byte;
            return Heard::Part;
        }
        let heard = if self.is_crc { [self.high, byte] } else { [byte, 0] };
        let (expected, _) = check(self.data.as_slice(), self.is_crc);
        if heard == expected { Heard::Good } else { Heard::Bad }
    }
}
