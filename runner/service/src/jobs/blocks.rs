//! Blocks of a program: where one begins, and which one a byte belongs to.

use std::io::{self, BufRead, BufReader, Read};

use serde::{Deserialize, Serialize};

/// Of a block's text no more than this is shown.
const SHOWN_BYTES: usize = 60;

/// A block of a program: a line.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Block {
    /// Its number, from 1.
    pub number: u64,
    /// Its first byte.
    pub start: u64,
    /// The byte behind its end.
    pub end: u64,
    /// How it begins, for people.
    pub text: String,
}

/// Where a run stopped, in blocks.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Between {
    /// The last block that has surely left as a whole.
    pub last_whole: Option<Block>,
    /// The last block of which anything can have left.
    pub last_begun: Option<Block>,
}

/// The block of this number, from 1; `None` if there are fewer.
///
/// # Errors
/// The program cannot be read.
pub fn block(program: impl Read, number: u64) -> io::Result<Option<Block>> {
    let mut found = None;
    walk(program, |block| {
        let is_it = block.number == number;
        if is_it {
            found = Some(block);
        }
        !is_it
    })?;
    Ok(found)
}

/// The blocks between which a run stopped: all before `surely` have left, none from
/// `maybe` on has.
///
/// # Errors
/// The program cannot be read.
pub fn between(program: impl Read, surely: u64, maybe: u64) -> io::Result<Between> {
    let mut between = Between::default();
    walk(program, |block| {
        if block.end <= surely {
            between.last_whole = Some(block.clone());
        }
        if block.start < maybe {
            between.last_begun = Some(block);
            true
        } else {
            false
        }
    })?;
    Ok(between)
}

/// Shows each block until `go_on` says no. A block ends behind its line feed, or, in a
/// program without any, behind its carriage return.
fn walk(program: impl Read, mut go_on: impl FnMut(Block) -> bool) -> io::Result<()> {
    let mut program = BufReader::with_capacity(64 * 1024, program);
    let first = program.fill_buf()?;
    let end_mark = if first.contains(&b'\n') || !first.contains(&b'\r') { b'\n' } else { b'\r' };
    let (mut number, mut start) = (0, 0);
    loop {
        let Some((length, text)) = line(&mut program, end_mark)? else { return Ok(()) };
        number += 1;
        let end = start + length;
        if !go_on(Block { number, start, end, text }) {
            return Ok(());
        }
        start = end;
    }
}

/// The length of the next line, however long, and how it begins.
fn line(program: &mut impl BufRead, end_mark: u8) -> io::Result<Option<(u64, String)>> {
    let mut shown = Vec::new();
    let mut length = 0;
    loop {
        let bytes = match program.fill_buf() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            bytes => bytes?,
        };
        if bytes.is_empty() {
            break;
        }
        let end = bytes.iter().position(|byte| *byte == end_mark);
        let count = end.map_or(bytes.len(), |end| end + 1);
        let room = SHOWN_BYTES - shown.len();
        shown.extend_from_slice(&bytes[..count.min(room)]);
        length += count as u64;
        program.consume(count);
        if end.is_some() {
            break;
        }
    }
    Ok((length > 0).then(|| (length, plain(&shown))))
}

fn plain(bytes: &[u8]) -> String {
    let is_plain = |byte: &u8| byte.is_ascii_graphic() || *byte == b' ';
    let text: String =
        bytes.iter().filter(|byte| is_plain(byte)).map(|byte| *byte as char).collect();
    text.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PROGRAM: &[u8] = b"%\nO0001\nN10 G0 X0\r\nN20 G1 X10\nM30\n%";

    #[test]
    fn blocks_are_found_by_number_and_by_byte() {
        let second = block(PROGRAM, 3).unwrap().unwrap();
        assert_eq!((second.start, second.end, &*second.text), (8, 19, "N10 G0 X0"));
        assert_eq!(block(PROGRAM, 6).unwrap().unwrap().text, "%");
        assert_eq!(block(PROGRAM, 7).unwrap(), None);
        assert_eq!(block(PROGRAM, 0).unwrap(), None);

        let found = between(PROGRAM, 18, 25).unwrap();
        assert_eq!(found.last_whole.unwrap().text, "O0001");
        assert_eq!(found.last_begun.unwrap().text, "N20 G1 X10");
        assert_eq!(between(PROGRAM, 0, 0).unwrap(), Between::default());
        let all = between(PROGRAM, 1_000, 1_000).unwrap();
        assert_eq!(all.last_whole, all.last_begun);
    }

    #[test]
    fn a_program_may_end_its_blocks_with_carriage_returns() {
        let found = block(&b"N1\rN2\rN3"[..], 2).unwrap().unwrap();
        assert_eq!((found.start, found.end, &*found.text), (3, 6, "N2"));
    }

    proptest! {
        #[test]
        fn every_byte_is_in_one_block(
            program in proptest::collection::vec(proptest::sample::select(&b"N1\n\r\0\xff"[..]), 0..300),
        ) {
            let mut end = 0;
            let mut numbers = 0;
            walk(&program[..], |block| {
                assert_eq!((block.number, block.start), (numbers + 1, end));
                assert!(block.end > block.start);
                numbers += 1;
                end = block.end;
                true
            }).unwrap();
            prop_assert_eq!(end, program.len() as u64);
        }
    }
}
