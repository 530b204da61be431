//! Reading the parts of a module, before any of it runs.

use crate::invalid::{Invalid, InvalidReason};
use core::ops::Range;

/// A place in a module, and where the part that is read ends.
#[derive(Clone)]
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    end: usize,
}

impl<'a> Reader<'a> {
    /// `range` lies inside `bytes`.
    pub(crate) fn new(bytes: &'a [u8], range: Range<usize>) -> Self {
        Self { bytes, at: range.start, end: range.end }
    }

    pub(crate) fn at(&self) -> usize {
        self.at
    }

    pub(crate) fn is_at_end(&self) -> bool {
        self.at == self.end
    }

    pub(crate) fn invalid(&self, reason: InvalidReason) -> Invalid {
        Invalid { at: self.at, reason }
    }

    pub(crate) fn byte(&mut self) -> Result<u8, Invalid> {
        if self.at == self.end {
            return Err(self.invalid(InvalidReason::CutOff));
        }
        let byte = self.bytes[self.at];
        self.at += 1;
        Ok(byte)
    }

    /// A byte anywhere in the module: of a part that was read before.
    pub(crate) fn byte_at(&self, at: usize) -> u8 {
        self.bytes[at]
    }

    pub(crate) fn skip(&mut self, bytes: usize) -> Result<Range<usize>, Invalid> {
        if bytes > self.end - self.at {
            return Err(self.invalid(InvalidReason::CutOff));
        }
        let range = self.at..self.at + bytes;
        self.at = range.end;
        Ok(range)
    }

    /// The next bytes, as a part of their own.
    pub(crate) fn part(&mut self, bytes: usize) -> Result<Reader<'a>, Invalid> {
        let range = self.skip(bytes)?;
        Ok(Self::new(self.bytes, range))
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Invalid> {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            if shift == 28 && byte > 0x0F {
                return Err(self.invalid(InvalidReason::Number));
            }
            value |= u32::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(self.invalid(InvalidReason::Number))
    }

    /// A signed number of so many bits, 32 or 64.
    pub(crate) fn signed(&mut self, bits: u32) -> Result<i64, Invalid> {
        let (mut value, mut shift) = (0_i64, 0);
        loop {
            let byte = self.byte()?;
            value |= i64::from(byte & 0x7F) << shift;
            let left = bits - shift;
            if left < 7 {
                // The last byte: nothing follows, and its spare bits repeat the sign.
                let spare = (byte << 1).cast_signed() >> left;
                if byte >= 0x80 || (spare != 0 && spare != -1) {
                    return Err(self.invalid(InvalidReason::Number));
                }
            }
            shift += 7;
            if byte < 0x80 {
                let unused = 64_u32.saturating_sub(shift);
                return Ok((value << unused) >> unused);
            }
        }
    }

    pub(crate) fn name(&mut self) -> Result<&'a str, Invalid> {
        let length = self.u32()? as usize;
        let at = self.at;
        let range = self.skip(length)?;
        core::str::from_utf8(&self.bytes[range])
            .map_err(|_| Invalid { at, reason: InvalidReason::Name })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signed(bytes: &[u8], bits: u32) -> Option<i64> {
        let mut reader = Reader::new(bytes, 0..bytes.len());
        reader.signed(bits).ok().filter(|_| reader.is_at_end())
    }

    #[test]
    fn signed_numbers_end_where_their_type_does() {
        assert_eq!(signed(&[0x7F], 32), Some(-1));
        assert_eq!(signed(&[0x3F], 32), Some(63));
        assert_eq!(signed(&[0x40], 32), Some(-64));
        assert_eq!(signed(&[0x80, 0x80, 0x80, 0x80, 0x78], 32), Some(i64::from(i32::MIN)));
        assert_eq!(signed(&[0xFF, 0xFF, 0xFF, 0xFF, 0x07], 32), Some(i64::from(i32::MAX)));
        assert_eq!(signed(&[0xFF, 0xFF, 0xFF, 0xFF, 0x7F], 32), Some(-1));
        // A sign that the bits beyond do not repeat; a sixth byte.
        assert_eq!(signed(&[0xFF, 0xFF, 0xFF, 0xFF, 0x0F], 32), None);
        assert_eq!(signed(&[0x80, 0x80, 0x80, 0x80, 0x70], 32), None);
        assert_eq!(signed(&[0x80, 0x80, 0x80, 0x80, 0x80, 0], 32), None);
        let mut smallest = [0x80; 10];
        smallest[9] = 0x7F;
        assert_eq!(signed(&smallest, 64), Some(i64::MIN));
        smallest[9] = 0x01;
        assert_eq!(signed(&smallest, 64), None);
    }

    #[test]
    fn unsigned_numbers_have_five_bytes_at_most() {
        let number = |bytes: &[u8]| Reader::new(bytes, 0..bytes.len()).u32().ok();
        assert_eq!(number(&[0xE5, 0x8E, 0x26]), Some(624_485));
        assert_eq!(number(&[0xFF, 0xFF, 0xFF, 0xFF, 0x0F]), Some(u32::MAX));
        assert_eq!(number(&[0xFF, 0xFF, 0xFF, 0xFF, 0x1F]), None);
        assert_eq!(number(&[0x80, 0x80, 0x80, 0x80, 0x80, 0]), None);
        assert_eq!(number(&[0x80]), None);
    }
}
