//! A block on the wire: doubled DLE, the end `DLE ETX`, the block check.

use crate::Options;
use crate::block::Block;
use softplug_plugin::{StateError, StateReader, StateWriter};

pub(crate) const STX: u8 = 0x02;
pub(crate) const ETX: u8 = 0x03;
pub(crate) const DLE: u8 = 0x10;
pub(crate) const NAK: u8 = 0x15;

/// Where in a block the encoder or the decoder stands.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
enum Part {
    /// Data.
    #[default]
    Data,
    /// A DLE has gone; the encoder doubles it, the decoder waits for its partner.
    AfterDle,
    /// The DLE of the end has gone.
    Etx,
    /// The block check is next.
    Bcc,
    /// All has gone.
    End,
}

impl Part {
    fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        match state.u8() {
            0 => Ok(Self::Data),
            1 => Ok(Self::AfterDle),
            2 => Ok(Self::Etx),
            3 => Ok(Self::Bcc),
            4 => Ok(Self::End),
            _ => Err(StateError),
        }
    }
}

/// From data to what follows STX on the wire, byte by byte.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Encoder {
    part: Part,
    /// How many data bytes have gone.
    at: u16,
    bcc: u8,
}

impl Encoder {
    /// The next byte of the block; `None` behind its last one.
    pub(crate) fn next(&mut self, options: &Options, data: &[u8]) -> Option<u8> {
        let byte = match self.part {
            Part::Data => match data.get(usize::from(self.at)) {
                Some(byte) => {
                    self.at += 1;
                    if *byte == DLE && options.doubling {
                        self.part = Part::AfterDle;
                    }
                    *byte
                }
                None => {
                    self.part = Part::Etx;
                    DLE
                }
            },
            Part::AfterDle => {
                self.part = Part::Data;
                DLE
            }
            Part::Etx => {
                self.part = if options.bcc { Part::Bcc } else { Part::End };
                ETX
            }
            // Raw: it is not doubled even if it is a DLE.
            Part::Bcc => {
                self.part = Part::End;
                self.bcc
            }
            Part::End => return None,
        };
        self.bcc ^= byte;
        Some(byte)
    }

    /// Whether the whole block was given out.
    pub(crate) fn is_at_end(self) -> bool {
        self.part == Part::End
    }

    pub(crate) fn save(self, state: &mut StateWriter<'_>) {
        state.u8(self.part as u8);
        state.u16(self.at);
        state.u8(self.bcc);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        Ok(Self { part: Part::restore(state)?, at: state.u16(), bcc: state.u8() })
    }
}

/// What a received byte was.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Step {
    /// Part of the block.
    Inside,
    /// Data beyond the limit.
    TooLong,
    /// A DLE before it that means nothing.
    LoneDle,
    /// The last byte, and whether the block check was right.
    End(bool),
}

/// From what follows STX on the wire to data, byte by byte.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Decoder {
    part: Part,
    bcc: u8,
}

impl Decoder {
    /// Takes a byte; data goes into `block`, up to `limit` bytes.
    pub(crate) fn take<const N: usize>(
        &mut self,
        options: &Options,
        block: &mut Block<N>,
        limit: u16,
        byte: u8,
    ) -> Step {
        let bcc = self.bcc;
        self.bcc ^= byte;
        let mut data = |byte| {
            if block.len() < limit && block.push(byte) { Step::Inside } else { Step::TooLong }
        };
        match (self.part, byte) {
            (Part::Bcc, _) => return Step::End(byte == bcc),
            (Part::End, _) => return Step::Inside,
            (Part::AfterDle, ETX) if options.bcc => {
                self.part = Part::Bcc;
                return Step::Inside;
            }
            (Part::AfterDle, ETX) => return Step::End(true),
            (Part::AfterDle, _) if options.doubling => {
                self.part = Part::Data;
                if byte != DLE {
                    return Step::LoneDle;
                }
            }
            // Not doubled: a DLE is data unless ETX follows, and the next one may
            // begin the end.
            (Part::AfterDle, DLE) => {}
            (Part::AfterDle, _) => {
                self.part = Part::Data;
                if data(DLE) == Step::TooLong {
                    return Step::TooLong;
                }
            }
            (_, DLE) => {
                self.part = Part::AfterDle;
                return Step::Inside;
            }
            _ => {}
        }
        data(byte)
    }

    /// Passes over all that still comes.
    pub(crate) fn close(&mut self) {
        self.part = Part::End;
    }

    /// Whether the last byte was a DLE whose partner has not come.
    pub(crate) fn is_after_dle(self) -> bool {
        self.part == Part::AfterDle
    }

    pub(crate) fn save(self, state: &mut StateWriter<'_>) {
        state.u8(self.part as u8);
        state.u8(self.bcc);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        Ok(Self { part: Part::restore(state)?, bcc: state.u8() })
    }
}
