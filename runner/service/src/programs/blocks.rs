//! Blocks of a program: where one begins, and which one a byte belongs to.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

use serde::{Deserialize, Serialize};

/// Of a block's text no more than this is shown.
const SHOWN_BYTES: usize = 60;
/// By so much of a program is told how its blocks end.
const HEAD_BYTES: usize = 64 * 1024;
/// A job gets on by less than this from one look to the next.
const NEAR_BYTES: usize = 4 * 1024;

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

/// Where a look at a program ended: the next one goes on from there, and reads little.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct BlockCursor {
    ends: Option<Ends>,
    /// Blocks before it.
    number: u64,
    /// Its first byte.
    start: u64,
}

impl BlockCursor {
    /// One that begins at this byte, which is the first of the block of this number.
    pub fn beginning(number: u64, start: u64) -> Self {
        match (number, start) {
            (0, _) | (_, 0) => Self::default(),
            (number, start) => Self { ends: None, number: number - 1, start },
        }
    }

    /// The block in which this byte is, or the last one; `None` if the program has none.
    ///
    /// ```
    /// use softplug_service::jobs::blocks::BlockCursor;
    ///
    /// let mut program = std::io::Cursor::new("N1 G0 X0\nN2 G1 X5\nM30\n");
    /// let mut cursor = BlockCursor::default();
    /// let block = cursor.block_at(&mut program, 9)?.expect("there is one");
    /// assert_eq!((block.number, &*block.text), (2, "N2 G1 X5"));
    /// # Ok::<(), std::io::Error>(())
    /// ```
    ///
    /// # Errors
    /// The program cannot be read.
    pub fn block_at(
        &mut self,
        program: &mut (impl Read + Seek),
        byte: u64,
    ) -> io::Result<Option<Block>> {
        let ends = if let Some(ends) = self.ends {
            ends
        } else {
            program.rewind()?;
            *self.ends.insert(Ends::of(&mut head_of(&mut *program))?)
        };
        if byte < self.start {
            (self.number, self.start) = (0, 0);
        }
        program.seek(SeekFrom::Start(self.start))?;
        let mut program = BufReader::with_capacity(NEAR_BYTES, program);
        let mut found = None;
        walk_on(&mut program, ends, (self.number, self.start), |block| {
            let is_before = block.end <= byte;
            found = Some(block);
            is_before
        })?;
        if let Some(block) = &found {
            (self.number, self.start) = (block.number - 1, block.start);
        }
        Ok(found)
    }
}

/// The beginning of a program, from which is told how its blocks end.
fn head_of<R: Read>(program: R) -> BufReader<R> {
    BufReader::with_capacity(HEAD_BYTES, program)
}

/// How the blocks of a program end.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Ends {
    /// Behind a line feed: LF, CR LF.
    LineFeed,
    /// Behind a line feed and all carriage returns that follow it: LF CR, LF CR CR.
    Returns,
    /// Behind a carriage return: no line feed is there.
    Return,
}

impl Ends {
    fn of(program: &mut impl BufRead) -> io::Result<Self> {
        let head = program.fill_buf()?;
        let is_return = |at: Option<usize>| at.and_then(|at| head.get(at)) == Some(&b'\r');
        Ok(match head.iter().position(|byte| *byte == b'\n') {
            Some(at) if is_return(at.checked_add(1)) && !is_return(at.checked_sub(1)) => {
                Self::Returns
            }
            None if head.contains(&b'\r') => Self::Return,
            _ => Self::LineFeed,
        })
    }

    fn mark(self) -> u8 {
        match self {
            Self::LineFeed | Self::Returns => b'\n',
            Self::Return => b'\r',
        }
    }
}

/// Shows each block until `go_on` says no.
fn walk(program: impl Read, go_on: impl FnMut(Block) -> bool) -> io::Result<()> {
    let mut program = head_of(program);
    let ends = Ends::of(&mut program)?;
    walk_on(&mut program, ends, (0, 0), go_on)
}

/// Shows the blocks behind so many, which end before this byte.
fn walk_on(
    program: &mut impl BufRead,
    ends: Ends,
    (mut number, mut start): (u64, u64),
    mut go_on: impl FnMut(Block) -> bool,
) -> io::Result<()> {
    loop {
        let Some((length, text)) = line(program, ends)? else { return Ok(()) };
        number += 1;
        let end = start + length;
        if !go_on(Block { number, start, end, text }) {
            return Ok(());
        }
        start = end;
    }
}

/// The length of the next line, however long, and how it begins.
fn line(program: &mut impl BufRead, ends: Ends) -> io::Result<Option<(u64, String)>> {
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
        let end = bytes.iter().position(|byte| *byte == ends.mark());
        let count = end.map_or(bytes.len(), |end| end + 1);
        let room = SHOWN_BYTES - shown.len();
        shown.extend_from_slice(&bytes[..count.min(room)]);
        length += count as u64;
        program.consume(count);
        if end.is_some() {
            if ends == Ends::Returns {
                length += returns(program)?;
            }
            break;
        }
    }
    Ok((length > 0).then(|| (length, plain(&shown))))
}

/// How many carriage returns come next; they are taken.
fn returns(program: &mut impl BufRead) -> io::Result<u64> {
    let mut length = 0;
    loop {
        let bytes = match program.fill_buf() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            bytes => bytes?,
        };
        let end = bytes.iter().position(|byte| *byte != b'\r');
        let count = end.unwrap_or(bytes.len());
        length += count as u64;
        program.consume(count);
        if end.is_some() || count == 0 {
            return Ok(length);
        }
    }
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

    #[test]
    fn a_line_end_of_lf_cr_or_lf_cr_cr_is_one() {
        for end in ["\n\r", "\n\r\r"] {
            let program = ["L1", "L2", "", "L4"].map(|text| format!("{text}{end}")).concat();
            let blocks = [1, 2, 3, 4].map(|number| {
                let block = block(program.as_bytes(), number).unwrap().unwrap();
                &program[block.start as usize..block.end as usize]
            });
            let expected = ["L1", "L2", "", "L4"].map(|text| format!("{text}{end}"));
            assert_eq!(blocks, expected.each_ref().map(|text| &**text));
            assert_eq!(block(program.as_bytes(), 5).unwrap(), None);
        }
        let crlf = b"L1\r\n\r\nL3";
        assert_eq!(
            block(&crlf[..], 2).unwrap().map(|block| (block.start, block.end)),
            Some((4, 6))
        );
    }

    proptest! {
        #[test]
        fn a_cursor_finds_what_a_look_from_the_beginning_finds(
            program in proptest::collection::vec(proptest::sample::select(&b"N1\n\r\0\xff"[..]), 1..200),
            bytes in proptest::collection::vec(0..220_u64, 1..8),
        ) {
            let mut blocks = Vec::new();
            walk(&program[..], |block| {
                blocks.push(block);
                true
            }).unwrap();
            let mut cursor = BlockCursor::default();
            let mut file = io::Cursor::new(&program);
            for byte in bytes {
                let found = cursor.block_at(&mut file, byte).unwrap();
                let expected = blocks.iter().find(|block| block.end > byte).or(blocks.last());
                prop_assert_eq!(found.as_ref(), expected);
            }
            let second = blocks.get(1).cloned();
            if let Some(second) = second {
                let mut cursor = BlockCursor::beginning(second.number, second.start);
                prop_assert_eq!(cursor.block_at(&mut file, second.start).unwrap(), Some(second));
            }
        }

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
