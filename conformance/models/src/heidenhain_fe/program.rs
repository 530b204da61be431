//! A program as the host gives it: its lines, or why it cannot be sent.

use softplug_abi::Failure;

/// Where a program cannot be sent, and why.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Fault {
    pub(super) failure: Failure,
    pub(super) line: u32,
    pub(super) column: u32,
}

/// The lines of a program. The end of each, LF or CR LF, is no part of it; what
/// stands behind the last end is a line too.
pub(super) fn lines(data: &[u8], longest: usize) -> Result<Vec<Vec<u8>>, Fault> {
    let mut rest: Vec<&[u8]> = data.split(|byte| *byte == b'\n').collect();
    let unended = rest.pop().filter(|line| !line.is_empty());
    let ended = rest.into_iter().map(|line| line.strip_suffix(b"\r").unwrap_or(line));
    let lines: Vec<&[u8]> = ended.chain(unended).collect();
    for (number, line) in (1..).zip(&lines) {
        if let Some((column, failure)) = fault(line, longest) {
            return Err(Fault { failure, line: number, column });
        }
    }
    Ok(lines.into_iter().map(<[u8]>::to_vec).collect())
}

fn fault(line: &[u8], longest: usize) -> Option<(u32, Failure)> {
    let mut columns = (1..).zip(line);
    columns.find_map(|(column, character)| match character {
        // Where both hold, the character is what is told.
        b' '..=b'~' if column as usize > longest => Some((column, Failure::TooLong)),
        b' '..=b'~' => None,
        _ => Some((column, Failure::UnsupportedCharacter)),
    })
}
