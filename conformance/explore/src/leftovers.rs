//! What an instance leaves in its stack and its mailbox.

use std::ops::Range;

/// Bytes of a line.
const LINE: usize = 64;

/// What an instance left where nothing is to be alive between two events: bytes that are not 0, in
/// lines.
#[derive(Debug, Default)]
pub(crate) struct Leftovers(Vec<(u32, [u8; LINE])>);

impl Leftovers {
    /// All of it in these ranges.
    pub(crate) fn of(memory: &[u8], dead: &[Range<usize>]) -> Self {
        let mut lines = Vec::new();
        for range in dead {
            for at in range.clone().step_by(LINE) {
                let bytes = &memory[at..range.end.min(at + LINE)];
                if bytes.iter().any(|byte| *byte != 0) {
                    let mut line = [0; LINE];
                    line[..bytes.len()].copy_from_slice(bytes);
                    lines.push((at as u32, line));
                }
            }
        }
        Self(lines)
    }

    /// Puts it into memory in which all of that is 0.
    pub(crate) fn write(&self, memory: &mut [u8]) {
        for (at, line) in &self.0 {
            for (byte, left) in memory[*at as usize..].iter_mut().zip(line) {
                // The end of a line can stand behind what is dead.
                *byte |= left;
            }
        }
    }

    /// Makes it 0 again.
    pub(crate) fn clear(&self, memory: &mut [u8]) {
        for (at, line) in &self.0 {
            for (byte, left) in memory[*at as usize..].iter_mut().zip(line) {
                if *left != 0 {
                    *byte = 0;
                }
            }
        }
    }
}
