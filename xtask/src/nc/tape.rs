//! A program under construction: it knows how much room is left.

use std::fmt;

/// The end of every program.
const END: &str = "M30\n%\n";
/// The smallest comment that can fill up: `()` and its line end.
const LEAST_FILLER: usize = 3;
/// A comment block is at most so long, with its line end.
const MOST_FILLER: usize = 61;

/// The bytes of a program up to the size asked for.
pub(super) struct Tape {
    bytes: Vec<u8>,
    size: usize,
    /// Blocks that end what is open: they must always still fit.
    closing: String,
    full: bool,
}

impl Tape {
    pub(super) fn new(size: usize) -> Self {
        let mut bytes = Vec::with_capacity(size);
        bytes.extend(b"%\n");
        Self { bytes, size, closing: String::new(), full: false }
    }

    /// Adds whole lines, all or none; false once the program is full.
    pub(super) fn block(&mut self, block: impl fmt::Display) -> bool {
        let block = format!("{block}\n");
        let reserve = self.closing.len() + END.len() + LEAST_FILLER;
        if self.full || self.bytes.len() + block.len() + reserve > self.size {
            self.full = true;
            return false;
        }
        self.bytes.extend(block.as_bytes());
        true
    }

    /// Sets what must follow before the program can end, such as a retract.
    pub(super) fn closes_with(&mut self, lines: &str) {
        lines.clone_into(&mut self.closing);
    }

    /// The whole program, filled up to its size with comments.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.extend(self.closing.as_bytes());
        let mut room = self.size - self.bytes.len() - END.len();
        while room > 0 {
            // What remains must again hold a comment, or be nothing.
            let length =
                if room <= MOST_FILLER { room } else { MOST_FILLER.min(room - LEAST_FILLER) };
            self.bytes.push(b'(');
            self.bytes.extend(std::iter::repeat_n(b'-', length - LEAST_FILLER));
            self.bytes.extend(b")\n");
            room -= length;
        }
        self.bytes.extend(END.as_bytes());
        self.bytes
    }
}

/// A length in µm as an NC word's number: `12.5`, `-.25`, `3.`.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Length(pub(super) i64);

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let (whole, part) = (self.0.abs() / 1_000, self.0.abs() % 1_000);
        let part = format!("{part:03}");
        let part = part.trim_end_matches('0');
        if whole == 0 && !part.is_empty() {
            return write!(f, "{sign}.{part}");
        }
        write!(f, "{sign}{whole}.{part}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_written_as_controls_write_them() {
        let shown = [12_500, -250, 3_000, 0, -1_001, 40].map(|length| Length(length).to_string());
        assert_eq!(shown, ["12.5", "-.25", "3.", "0.", "-1.001", ".04"]);
    }

    #[test]
    fn a_tape_is_filled_to_the_byte() {
        for size in 40..300 {
            let mut tape = Tape::new(size);
            tape.closes_with("G0Z50.\n");
            while tape.block("G1X1.") {}
            assert!(!tape.block("X"), "full stays full");
            let bytes = tape.finish();
            assert_eq!(bytes.len(), size);
            assert!(bytes.ends_with(b")\nM30\n%\n"), "{}", String::from_utf8_lossy(&bytes));
        }
    }
}
