//! Blocks: data with each DLE doubled, DLE ETX, and the check character.

use super::parameters::Parameters;

pub(super) const STX: u8 = 0x02;
pub(super) const ETX: u8 = 0x03;
pub(super) const DLE: u8 = 0x10;
pub(super) const NAK: u8 = 0x15;

/// A block as it is on the wire after its set-up.
pub(super) fn block(parameters: &Parameters, data: &[u8]) -> Vec<u8> {
    let mut block = Vec::new();
    for byte in data {
        block.push(*byte);
        if *byte == DLE && parameters.doubling {
            block.push(DLE);
        }
    }
    block.extend([DLE, ETX]);
    if parameters.bcc {
        block.push(check(&block));
    }
    block
}

/// The exclusive-or of all that follows the set-up.
pub(super) fn check(block: &[u8]) -> u8 {
    block.iter().fold(0, |check, byte| check ^ byte)
}

/// What a received character means for the block.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Read {
    /// The block goes on.
    More,
    /// Behind DLE came neither DLE nor ETX. The block goes on.
    DleError,
    /// It is longer than the largest.
    TooLong,
    /// It ends, and the check character is right, or there is none.
    Good,
    /// It ends with another check character.
    WrongCheck,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Place {
    Data,
    BehindDle,
    Check,
}

/// A block as it comes in.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Incoming {
    /// Data that have come and fit.
    pub(super) data: Vec<u8>,
    limit: usize,
    length: usize,
    has_check: bool,
    is_doubled: bool,
    check: u8,
    place: Place,
    characters: usize,
}

impl Incoming {
    /// Nothing has come yet.
    pub(super) fn new(parameters: &Parameters, limit: usize) -> Self {
        Self {
            data: Vec::new(),
            limit,
            length: 0,
            has_check: parameters.bcc,
            is_doubled: parameters.doubling,
            check: 0,
            place: Place::Data,
            characters: 0,
        }
    }

    /// Characters that have come.
    pub(super) fn characters(&self) -> usize {
        self.characters
    }

    /// A lone DLE has come and nothing else.
    pub(super) fn is_lone_dle(&self) -> bool {
        self.characters == 1 && self.place == Place::BehindDle
    }

    /// One more character.
    pub(super) fn read(&mut self, byte: u8) -> Read {
        self.characters += 1;
        if self.place == Place::Check {
            return if byte == self.check { Read::Good } else { Read::WrongCheck };
        }
        self.check ^= byte;
        match (self.place, byte) {
            (Place::Data, DLE) => {
                self.place = Place::BehindDle;
                Read::More
            }
            (Place::BehindDle, ETX) if self.has_check => {
                self.place = Place::Check;
                Read::More
            }
            (Place::BehindDle, ETX) => Read::Good,
            (Place::BehindDle, DLE) if self.is_doubled => {
                self.place = Place::Data;
                self.keep(DLE)
            }
            (Place::BehindDle, _) if self.is_doubled => {
                self.place = Place::Data;
                Read::DleError
            }
            // Without doubling the DLE before was data, and this one may be.
            (Place::BehindDle, DLE) => self.keep(DLE),
            (Place::BehindDle, _) => {
                self.place = Place::Data;
                match self.keep(DLE) {
                    Read::More => self.keep(byte),
                    other => other,
                }
            }
            (Place::Data | Place::Check, _) => self.keep(byte),
        }
    }

    fn keep(&mut self, byte: u8) -> Read {
        if self.length == self.limit {
            return Read::TooLong;
        }
        self.length += 1;
        self.data.push(byte);
        Read::More
    }
}
