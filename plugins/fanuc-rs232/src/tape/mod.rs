//! What a program file becomes on the wire.
//!
//! The encoder reads the file byte by byte: the leader up to the first `%`, the
//! label behind it, blocks, and the closing `%`, behind which nothing is sent.
//! An EOB goes out with the byte behind it, so that the closing `%` is glued to the
//! last block.

mod ends;
mod output;
mod prefix;
mod restart;
mod setup;
#[cfg(test)]
mod tests;
mod text;

use ends::Ends;
use output::Output;
use prefix::Prefix;
use restart::Restart;
pub(crate) use setup::Setup;
use softplug_plugin::{Failure, Values};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Most bytes that one call of [`Encoder::push`], [`Encoder::next`] or
/// [`Encoder::finish`] puts into the output: a delayed EOB (3), a prefix with a new
/// number (19), a padding space and the byte itself, with some to spare.
/// Many calls give at most [`Setup::growth`] bytes each, and this once.
pub(crate) const MOST_PER_BYTE: usize = 32;

/// In the table of characters: it means something besides itself, or the like.
const SPECIAL: u8 = 0x80;
/// A character that cannot be sent.
const REFUSED: u8 = 0xFF;
/// A character that is left out.
const DROPPED: u8 = 0xFE;
/// Before and behind a program of old editors: the end of the file.
const END_OF_FILE: u8 = 0x1A;

/// What is wrong with a job that is a [`Failure::BadJob`]: the statuses of the manifest.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
pub(crate) enum Fault {
    None,
    /// A field of the job is out of its range.
    Field,
    /// The preamble cannot be sent.
    Preamble,
    /// There is text before the first `%`.
    TextBefore,
    /// There is text behind the closing `%`.
    TextBehind,
}

/// Part of the program that the next byte belongs to.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
enum Part {
    /// Before the first character that says something.
    Leader,
    /// From the first `%` up to its EOB.
    Label,
    /// At the beginning of a block whose number matters.
    Prefix,
    /// Behind a number that was left out, as are the spaces here.
    Stripped,
    /// In a block that is sent.
    Block,
    /// In a block before the one to begin with.
    Skipped,
    /// Behind the closing `%`.
    End,
}

/// Turns a program into bytes on the wire, in its output; also without sending them,
/// as a check.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Encoder {
    place: Place,
    restart: Restart,
    pub(crate) output: Output,
    spare: [u8; 2],
}

/// Where the encoder is in a program.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
struct Place {
    line: u32,
    column: u32,
    /// Blocks so far, this one included; the label is none.
    block: u32,
    last_number: u32,
    /// The number of the block that waits until the preamble is out.
    held_block: u32,
    part: Part,
    /// The next byte needs no look at anything but itself.
    is_plain: bool,
    ends: Ends,
    /// The file has no first `%`.
    is_open: bool,
    /// The first block is an O line and the one to begin with.
    is_head_wanted: bool,
    /// A character that waits until the preamble is out; [`DROPPED`]: none.
    held: u8,
    /// An EOB that goes out with the next character.
    eob_waits: bool,
    in_comment: bool,
    /// Whether characters count for TV here: 1 or 0.
    counts: u8,
    /// The lowest bit tells whether the block's characters are odd so far.
    count: u8,
    /// What was wrong.
    fault: Fault,
    /// Line ends of the file, before anything is replaced.
    file_ends: Ends,
    prefix: Prefix,
    /// The prefix of the block that waits.
    held_prefix: Prefix,
}

impl Encoder {
    /// A program begins; the fields of its job say with which block.
    ///
    /// # Errors
    /// [`Failure::BadJob`] if a field is out of its range.
    pub(crate) fn begin(&mut self, fields: &Values<'_>) -> Result<(), Failure> {
        self.place = Place::new_zeroed();
        self.place.line = 1;
        self.place.held = DROPPED;
        self.place.counts = 1;
        self.place.prefix.clear();
        self.output.clear();
        self.place.fault = Fault::Field;
        self.restart.take(fields)?;
        self.place.fault = Fault::None;
        Ok(())
    }

    /// The status of what was wrong, beside a [`Failure::BadJob`]; else 0.
    pub(crate) fn status(&self, failure: Failure) -> u16 {
        if failure == Failure::BadJob { self.place.fault as u16 } else { 0 }
    }

    /// The next byte of the program file. Not to be called while the encoder
    /// [waits](Self::is_waiting).
    ///
    /// # Errors
    /// At [`position`](Self::position): [`Failure::UnsupportedCharacter`], or
    /// [`Failure::BadJob`] for text behind the closing `%`, which may have been meant as the first.
    pub(crate) fn push(&mut self, settings: &Setup, byte: u8) -> Result<(), Failure> {
        self.place.column += 1;
        let character = settings.characters[usize::from(byte)];
        // CR and LF are counted as the file's, whatever replaces them.
        if self.place.is_plain && character < SPECIAL && byte > b'\r' {
            self.place.count ^= self.place.counts;
            self.output.push(settings.wire[usize::from(character & !SPECIAL)]);
            return Ok(());
        }
        self.push_special(settings, byte, character)
    }

    /// Whether the preamble goes out now: [`next`](Self::next) is to be called until
    /// this is over.
    pub(crate) fn is_waiting(&self) -> bool {
        self.place.held != DROPPED
    }

    /// Whether the encoder will [wait](Self::is_waiting) at some byte to come. Who
    /// cannot put bytes by gives it one at a time so long.
    pub(crate) fn will_wait(&self) -> bool {
        self.restart.has_preamble() && self.place.part != Part::End
    }

    /// The next character of the preamble.
    ///
    /// # Errors
    /// [`Failure::BadJob`]: the preamble cannot be sent.
    pub(crate) fn next(&mut self, settings: &Setup) -> Result<(), Failure> {
        let sent = self.next_of_preamble(settings);
        if sent.is_err() && self.place.fault == Fault::None {
            self.place.fault = Fault::Preamble;
        }
        sent
    }

    fn next_of_preamble(&mut self, settings: &Setup) -> Result<(), Failure> {
        if let Some(byte) = self.restart.next() {
            let character = settings.characters[usize::from(byte)];
            let character = match self.restart.ends.line_end(character) {
                Some(false) => return Ok(()),
                Some(true) => SPECIAL_LF,
                None => character,
            };
            return match character {
                DROPPED => Ok(()),
                SPECIAL_PERCENT => Err(Failure::BadJob),
                _ => self.take(settings, character).map_err(|_| Failure::BadJob),
            };
        }
        if self.is_block_open() {
            return self.take(settings, SPECIAL_LF);
        }
        let place = &mut self.place;
        (place.block, place.prefix) = (place.held_block, place.held_prefix);
        self.restart.seeks = true;
        let character = core::mem::replace(&mut place.held, DROPPED);
        self.begin_block(settings, character)
    }

    /// All of the program was given. If the encoder [waits](Self::is_waiting)
    /// afterwards, this is to be called once more when that is over.
    ///
    /// # Errors
    /// [`Failure::NotFound`]: the block to begin with is not there.
    pub(crate) fn finish(&mut self, settings: &Setup) -> Result<(), Failure> {
        let is_block_open = self.is_block_open();
        if self.place.part == Part::Leader {
            self.open(settings);
        }
        if self.place.part != Part::End {
            if settings.percent && is_block_open {
                self.take(settings, SPECIAL_LF)?;
            }
            if !self.is_waiting() {
                let end = if settings.percent { SPECIAL_PERCENT } else { SPECIAL_CUT };
                self.take(settings, end)?;
            }
            if self.is_waiting() {
                return Ok(());
            }
            self.end_waiting_block(settings);
            self.place.part = Part::End;
        }
        if self.restart.seeks { Err(Failure::NotFound) } else { Ok(()) }
    }

    /// Whether something of a block has come whose EOB has not.
    fn is_block_open(&self) -> bool {
        match self.place.part {
            Part::Leader => false,
            Part::Prefix => !self.place.prefix.is_empty(),
            Part::Stripped => true,
            _ => !self.place.eob_waits,
        }
    }

    /// Whether the block to begin with is still to be found.
    pub(crate) fn seeks(&self) -> bool {
        self.restart.seeks
    }

    /// Whether the closing `%` is out: nothing that follows it in the file is sent.
    pub(crate) fn is_ended(&self) -> bool {
        self.place.part == Part::End
    }

    /// Line and column of the last byte that was given, from 1.
    pub(crate) fn position(&self) -> (u32, u32) {
        (self.place.line, self.place.column)
    }

    #[inline(never)]
    fn push_special(&mut self, settings: &Setup, byte: u8, character: u8) -> Result<(), Failure> {
        // A character that is replaced by an EOB ends no line of the file.
        let of_file = if matches!(byte, b'\n' | b'\r') { byte | SPECIAL } else { b' ' };
        if let Some(ends) = self.place.file_ends.line_end(of_file) {
            self.place.line += u32::from(ends);
            self.place.column = 0;
        }
        if self.place.ends.line_end(character) == Some(false) {
            return Ok(());
        }
        let character = if character == SPECIAL_CR { SPECIAL_LF } else { character };
        // Around a program stands what the code need not have, as a NUL in EIA.
        let is_around = match self.place.part {
            Part::Leader => byte == 0,
            Part::End => matches!(byte, 0 | END_OF_FILE),
            _ => false,
        };
        if is_around {
            return Ok(());
        }
        let taken = match character {
            DROPPED => Ok(()),
            _ => self.take(settings, character),
        };
        self.place.is_plain = self.place.part == Part::Block
            && !self.place.eob_waits
            && !self.is_waiting()
            && !matches!(byte, b'\n' | b'\r');
        taken
    }
}

/// The end of a file whose last block stays without EOB.
const SPECIAL_CUT: u8 = SPECIAL;
const SPECIAL_LF: u8 = SPECIAL | b'\n';
const SPECIAL_CR: u8 = SPECIAL | b'\r';
const SPECIAL_PERCENT: u8 = SPECIAL | b'%';
const SPECIAL_OPEN: u8 = SPECIAL | b'(';
const SPECIAL_CLOSE: u8 = SPECIAL | b')';
