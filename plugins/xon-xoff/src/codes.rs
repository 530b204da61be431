//! The control bytes and the escape of the transparent mode.

use crate::Settings;

/// Bytes that are looked at together.
const PIECE: usize = 64;
/// The lowest bit of each byte of a word.
const ONES: u64 = u64::from_ne_bytes([0x01; 8]);
/// The top bit of each byte of a word.
const TOPS: u64 = u64::from_ne_bytes([0x80; 8]);

/// A control byte from the partner.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Control {
    Xon,
    Xoff,
}

/// The bytes that mean something on this link.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Codes {
    pub(crate) xon: u8,
    pub(crate) xoff: u8,
    mask: u8,
    /// XOFF eight times over.
    pattern: u64,
    /// The bits in which XON and XOFF agree, eight times over.
    agreeing: u64,
    escape: u8,
    escape_xor: u8,
}

impl Codes {
    pub(crate) fn new(settings: &Settings) -> Self {
        let (xon, xoff) = (settings.xon as u8, settings.xoff as u8);
        let mask = settings.parity_mask as u8;
        Self {
            xon,
            xoff,
            mask,
            pattern: ONES * u64::from(xoff),
            agreeing: ONES * u64::from(mask & !(xon ^ xoff)),
            escape: settings.escape as u8,
            escape_xor: settings.escape_xor as u8,
        }
    }

    /// The control that a byte on the line stands for, its parity bit masked.
    pub(crate) fn control(&self, byte: u8) -> Option<Control> {
        if (byte ^ self.xoff) & self.mask == 0 {
            return Some(Control::Xoff);
        }
        ((byte ^ self.xon) & self.mask == 0).then_some(Control::Xon)
    }

    /// The bytes before the first control byte, and it with what follows.
    #[inline(always)]
    pub(crate) fn split<'a>(&self, bytes: &'a [u8]) -> (&'a [u8], Option<(Control, &'a [u8])>) {
        let mut rest = bytes;
        while let Some((piece, after)) = rest.split_first_chunk()
            && self.is_clear(piece)
        {
            rest = after;
        }
        while let Some((word, after)) = rest.split_first_chunk()
            && self.borrow(*word) & TOPS == 0
        {
            rest = after;
        }
        while let Some((byte, after)) = rest.split_first() {
            if let Some(control) = self.control(*byte) {
                let data = bytes.get(..bytes.len() - rest.len()).unwrap_or_default();
                return (data, Some((control, after)));
            }
            rest = after;
        }
        (bytes, None)
    }

    /// Whether surely none of the bytes is a control byte, found out for eight at
    /// once: most bytes of a program are none.
    #[inline]
    #[expect(clippy::many_single_char_names, reason = "the words of a piece")]
    fn is_clear(&self, piece: &[u8; PIECE]) -> bool {
        let &[a, b, c, d, e, f, g, h] = piece.as_chunks().0 else { return false };
        let first = self.borrow(a) | self.borrow(b) | self.borrow(c) | self.borrow(d);
        let second = self.borrow(e) | self.borrow(f) | self.borrow(g) | self.borrow(h);
        (first | second) & TOPS == 0
    }

    /// A top bit is set wherever there may be a control byte: taking 1 from a 0 gives one.
    /// So does a top bit that was there: such bytes, which no text has, are looked at one
    /// by one.
    #[inline]
    fn borrow(&self, word: [u8; 8]) -> u64 {
        ((u64::from_ne_bytes(word) ^ self.pattern) & self.agreeing).wrapping_sub(ONES)
    }

    /// Whether a data byte must be escaped: control bytes with either parity
    /// bit, and the escape itself.
    pub(crate) fn must_escape(&self, byte: u8) -> bool {
        let is = |control: u8| (byte ^ control) << 1 == 0;
        byte == self.escape || is(self.xon) || is(self.xoff)
    }

    /// The two bytes that stand for a data byte in transparent mode, if it
    /// must be escaped.
    pub(crate) fn escaped(&self, byte: u8) -> Option<[u8; 2]> {
        self.must_escape(byte).then_some([self.escape, byte ^ self.escape_xor])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_plugin::SettingSet;

    fn split_slowly(codes: Codes, bytes: &[u8]) -> (usize, Option<(Control, usize)>) {
        let found = bytes.iter().position(|byte| codes.control(*byte).is_some());
        match found {
            Some(at) => (at, codes.control(bytes[at]).map(|control| (control, at + 1))),
            None => (bytes.len(), None),
        }
    }

    #[test]
    fn every_byte_is_found_at_every_place_with_every_mask() {
        const LENGTH: usize = 2 * PIECE + 3;
        for mask in [0xFF, 0x7F, 0x0F, 0x80, 1] {
            let settings = Settings { xon: 0x11, xoff: 0x93, parity_mask: mask, ..Settings::UNSET };
            let codes = Codes::new(&settings);
            for byte in 0..=u8::MAX {
                for filler in [b'N', 0x12, 0xFF] {
                    for place in 0..LENGTH {
                        let mut bytes = [filler; LENGTH];
                        bytes[place] = byte;
                        let (data, control) = codes.split(&bytes);
                        let control =
                            control.map(|(control, after)| (control, LENGTH - after.len()));
                        assert_eq!((data.len(), control), split_slowly(codes, &bytes));
                    }
                }
            }
        }
    }
}
