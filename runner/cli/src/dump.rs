//! Bytes as hex and ASCII, for people.

use std::fmt;

const PER_LINE: usize = 16;

/// A dump: offset, 16 bytes in hex, the same as ASCII.
pub(crate) struct Dump<'a>(pub(crate) &'a [u8]);

impl fmt::Display for Dump<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, line) in self.0.chunks(PER_LINE).enumerate() {
            if number > 0 {
                writeln!(f)?;
            }
            write!(f, "{:08x} ", number * PER_LINE)?;
            for at in 0..PER_LINE {
                if at == PER_LINE / 2 {
                    f.write_str(" ")?;
                }
                match line.get(at) {
                    Some(byte) => write!(f, " {byte:02x}")?,
                    None => f.write_str("   ")?,
                }
            }
            f.write_str("  |")?;
            for byte in line {
                let shown = if (0x20..0x7F).contains(byte) { char::from(*byte) } else { '.' };
                write!(f, "{shown}")?;
            }
            f.write_str("|")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dumps_are_aligned() {
        let text = Dump(b"%\nO0001 (PART A)\nG1").to_string();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            lines,
            [
                "00000000  25 0a 4f 30 30 30 31 20  28 50 41 52 54 20 41 29  |%.O0001 (PART A)|",
                "00000010  0a 47 31                                          |.G1|",
            ]
        );
        assert_eq!(Dump(b"").to_string(), "");
    }
}
