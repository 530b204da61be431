//! CRC-32 as in Ethernet and zlib: polynomial 04C11DB7, reflected, all ones at both ends.
//!
//! Bit by bit: at most 188 bytes are summed at a time, and a table would be a kilobyte.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC).checksum(bytes)
}

#[cfg(test)]
mod tests {
    #[test]
    fn it_is_the_usual_one() {
        assert_eq!(super::crc32(b"123456789"), 0xCBF4_3926);
    }
}
