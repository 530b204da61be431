//! A block on the line: data with DLEs doubled, DLE ETX, check character.

use super::options::Options;
use super::report::Error;

/// Begins a set-up.
pub(super) const STX: u8 = 0x02;
/// Ends a block, behind a DLE.
pub(super) const ETX: u8 = 0x03;
/// Yes; and the sign in front of ETX.
pub(super) const DLE: u8 = 0x10;
/// No.
pub(super) const NAK: u8 = 0x15;

/// A block's characters, from the first of the data to the last.
pub(super) fn encode(data: &[u8], options: &Options) -> Vec<u8> {
    let mut block = Vec::with_capacity(data.len() + 3);
    for byte in data {
        block.push(*byte);
        if *byte == DLE && options.doubling {
            block.push(DLE);
        }
    }
    block.extend([DLE, ETX]);
    if options.bcc {
        block.push(block.iter().fold(0, |check, byte| check ^ byte));
    }
    block
}

/// A block as it comes in.
#[derive(Debug)]
pub(super) struct Frame {
    data: Vec<u8>,
    check: u8,
    position: Position,
    error: Option<Error>,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Position {
    /// Among the data.
    Data,
    /// Behind a DLE that may be doubled or may begin the end.
    AfterDle,
    /// Behind DLE ETX: the check character is next.
    Check,
}

/// What a character made of a block.
#[derive(Debug)]
pub(super) enum Progress {
    /// It goes on.
    More,
    /// It is longer than it may be.
    TooLong,
    /// It is complete.
    End(Result<Vec<u8>, Error>),
}

impl Frame {
    pub(super) fn new() -> Self {
        Self { data: Vec::new(), check: 0, position: Position::Data, error: None }
    }

    /// Whether a single DLE is all that came.
    pub(super) fn is_only_dle(&self) -> bool {
        self.data.is_empty() && self.position == Position::AfterDle
    }

    /// Notes what makes the block bad; the first thing stays.
    pub(super) fn note(&mut self, error: Error) {
        self.error.get_or_insert(error);
    }

    pub(super) fn first_error(&self) -> Option<Error> {
        self.error
    }

    /// A damaged character takes its place in the block and means nothing,
    /// but the check character's place is the end.
    pub(super) fn damaged(&mut self, options: &Options) -> Progress {
        self.note(Error::Line);
        match self.position {
            Position::Check => self.end(),
            Position::Data | Position::AfterDle => {
                self.position = Position::Data;
                self.push(0, options)
            }
        }
    }

    pub(super) fn take(&mut self, byte: u8, options: &Options) -> Progress {
        if self.position == Position::Check {
            if byte != self.check {
                self.note(Error::Check);
            }
            return self.end();
        }
        self.check ^= byte;
        match (self.position, byte) {
            (Position::Data, DLE) => self.position = Position::AfterDle,
            (Position::AfterDle, ETX) if options.bcc => self.position = Position::Check,
            (Position::AfterDle, ETX) => return self.end(),
            (Position::AfterDle, DLE) if options.doubling => {
                self.position = Position::Data;
                return self.push(DLE, options);
            }
            // The first was data; this one may begin the end.
            (Position::AfterDle, DLE) => return self.push(DLE, options),
            (Position::AfterDle, _) => {
                self.position = Position::Data;
                if options.doubling {
                    self.note(Error::LoneDle);
                } else {
                    self.data.push(DLE);
                }
                return self.push(byte, options);
            }
            (Position::Data | Position::Check, _) => return self.push(byte, options),
        }
        Progress::More
    }

    fn push(&mut self, byte: u8, options: &Options) -> Progress {
        self.data.push(byte);
        if self.data.len() > options.block_size { Progress::TooLong } else { Progress::More }
    }

    fn end(&mut self) -> Progress {
        Progress::End(match self.error {
            None => Ok(std::mem::take(&mut self.data)),
            Some(error) => Err(error),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The vectors of section 10 of the protocol's page, without STX and DLE.
    const VECTORS: &[(&[u8], &[u8])] = &[
        (&[0x31, 0x32, 0x33], &[0x31, 0x32, 0x33, 0x10, 0x03, 0x23]),
        (&[], &[0x10, 0x03, 0x13]),
        (&[0x10], &[0x10, 0x10, 0x10, 0x03, 0x13]),
        (&[0x10, 0x41, 0x10], &[0x10, 0x10, 0x41, 0x10, 0x10, 0x10, 0x03, 0x52]),
        (&[0x10, 0x03], &[0x10, 0x10, 0x03, 0x10, 0x03, 0x10]),
        (&[0x02, 0x03, 0x10, 0x15], &[0x02, 0x03, 0x10, 0x10, 0x15, 0x10, 0x03, 0x07]),
        (&[0x41, 0x42], &[0x41, 0x42, 0x10, 0x03, 0x10]),
        (&[0x11], &[0x11, 0x10, 0x03, 0x02]),
        (&[0x06], &[0x06, 0x10, 0x03, 0x15]),
        (&[0x13], &[0x13, 0x10, 0x03, 0x00]),
        (
            &[0x04, 0x00, 0x07, 0x01, 0xC3, 0x2C, 0xC0, 0x79],
            &[0x04, 0x00, 0x07, 0x01, 0xC3, 0x2C, 0xC0, 0x79, 0x10, 0x03, 0x47],
        ),
    ];

    fn decode(block: &[u8], options: &Options) -> Result<Vec<u8>, Error> {
        let mut frame = Frame::new();
        let (last, all_but_last) = block.split_last().unwrap();
        for byte in all_but_last {
            assert!(matches!(frame.take(*byte, options), Progress::More), "{byte:02x} too early");
        }
        match frame.take(*last, options) {
            Progress::End(result) => result,
            progress => panic!("{progress:?} at the end"),
        }
    }

    #[test]
    fn the_vectors_hold_both_ways() {
        let options = Options::default();
        for (data, block) in VECTORS {
            assert_eq!(encode(data, &options), *block);
            assert_eq!(decode(block, &options).as_deref(), Ok(*data));
        }
    }

    #[test]
    fn without_a_check_character_the_block_ends_with_etx() {
        let options = Options::without_check();
        for (data, block) in VECTORS {
            let block = &block[..block.len() - 1];
            assert_eq!(encode(data, &options), block);
            assert_eq!(decode(block, &options).as_deref(), Ok(*data));
        }
    }

    #[test]
    fn without_doubling_a_dle_stands_alone() {
        let options = Options { doubling: false, ..Options::simplified() };
        for data in [&[0x10][..], &[0x10, 0x10], &[0x41, 0x10, 0x42], &[0x10, 0x10, 0x05]] {
            let block = encode(data, &options);
            assert_eq!(block.len(), data.len() + 3);
            assert_eq!(decode(&block, &options).as_deref(), Ok(data));
        }
    }

    #[test]
    fn bad_blocks_end_where_good_ones_would() {
        let options = Options::default();
        assert_eq!(decode(&[0x31, 0x10, 0x03, 0x23], &options), Err(Error::Check));
        let lone = [0x31, 0x10, 0x41, 0x10, 0x03, 0x31 ^ 0x10 ^ 0x41 ^ 0x13];
        assert_eq!(decode(&lone, &options), Err(Error::LoneDle));
        let mut frame = Frame::new();
        frame.take(0x31, &options);
        frame.damaged(&options);
        frame.take(DLE, &options);
        frame.take(ETX, &options);
        assert!(matches!(frame.damaged(&options), Progress::End(Err(Error::Line))));
    }

    #[test]
    fn a_byte_beyond_the_block_size_is_too_long() {
        let options = Options { block_size: 2, ..Options::default() };
        assert_eq!(decode(&encode(&[1, 2], &options), &options).as_deref(), Ok(&[1, 2][..]));
        let mut frame = Frame::new();
        assert!(matches!(frame.take(1, &options), Progress::More));
        assert!(matches!(frame.take(2, &options), Progress::More));
        assert!(matches!(frame.take(3, &options), Progress::TooLong));
    }
}
