//! What a program is on the wire.

use super::rules::{ControlInData, Rules};
use crate::line_ends::LineEnds;

/// The place of a byte that cannot be sent, both from 1.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Fault {
    pub(super) line: u32,
    pub(super) column: u32,
}

/// All that leaves for a program.
///
/// # Errors
/// The first byte of it that cannot be sent.
pub(super) fn on_the_wire(rules: &Rules, program: &[u8]) -> Result<Vec<u8>, Fault> {
    let mut wire = rules.feed_start.clone();
    let mut line_ends = LineEnds::default();
    for (at, byte) in program.iter().enumerate() {
        if rules.send_drop.contains(byte) {
            continue;
        }
        if rules.control(*byte).is_some() && !rules.transparent {
            match rules.control_in_data {
                ControlInData::Refuse => return Err(place(&program[..at])),
                ControlInData::Drop => continue,
                ControlInData::Send => {}
            }
        }
        for sent in line_ends.rewrite(*byte, rules.send_line_end) {
            if rules.transparent && rules.is_escaped(sent) {
                wire.extend([rules.escape, sent ^ rules.escape_xor]);
            } else {
                wire.push(sent);
            }
        }
    }
    wire.extend(&rules.feed_end);
    Ok(wire)
}

/// Where a byte stands of which this comes before.
fn place(before: &[u8]) -> Fault {
    let mut fault = Fault { line: 1, column: 1 };
    for byte in before {
        if *byte == b'\n' {
            fault = Fault { line: fault.line + 1, column: 1 };
        } else {
            fault.column += 1;
        }
    }
    fault
}
