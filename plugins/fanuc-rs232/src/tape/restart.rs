//! Where a program begins that is not sent from its first block on.

use super::ends::Ends;
use super::prefix::NO_NUMBER;
use softplug_plugin::{Failure, Values, copy};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Longest preamble in bytes.
const LONGEST: usize = 400;

/// The block to begin with, and what is sent before it.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(super) struct Restart {
    block: u32,
    sequence: u32,
    length: u16,
    at: u16,
    /// Whether the block is still to be found.
    pub(super) seeks: bool,
    /// Line ends of the preamble.
    pub(super) ends: Ends,
    /// `block` is a line of the file.
    is_line: bool,
    /// That line has come.
    is_reached: bool,
    preamble: [u8; LONGEST],
}

impl Restart {
    /// From the fields of a job.
    pub(super) fn take(&mut self, fields: &Values<'_>) -> Result<(), Failure> {
        (self.seeks, self.block, self.sequence) = (false, 1, NO_NUMBER);
        (self.length, self.at, self.ends) = (0, 0, Ends::InLine);
        (self.is_line, self.is_reached) = (false, false);
        for field in fields.clone().raw() {
            let field = field.map_err(|_| Failure::BadJob)?;
            let text = field.text_bytes().unwrap_or_default();
            // An empty preamble is none.
            self.seeks |= field.index != 2 || !text.is_empty();
            let number = field.int().map_or(Some(0), |number| u32::try_from(number).ok());
            let number = number.filter(|number| *number != NO_NUMBER).ok_or(Failure::BadJob)?;
            match field.index {
                0 if number > 0 => self.block = number,
                1 => self.sequence = number,
                2 => self.set_preamble(text),
                3 if number > 0 => (self.block, self.is_line) = (number, true),
                _ => return Err(Failure::BadJob),
            }
        }
        Ok(())
    }

    fn set_preamble(&mut self, text: &[u8]) {
        self.length = text.len().min(LONGEST) as u16;
        copy(&mut self.preamble, text);
    }

    /// Whether there is a preamble that has not been sent.
    pub(super) fn has_preamble(&self) -> bool {
        self.length > 0
    }

    /// The next byte of the preamble; `None`: it has ended.
    pub(super) fn next(&mut self) -> Option<u8> {
        let text = self.preamble.get(..usize::from(self.length)).unwrap_or_default();
        let byte = text.get(usize::from(self.at)).copied();
        match byte {
            Some(_) => self.at += 1,
            None => self.length = 0,
        }
        byte
    }

    /// A block begins at this line of the file.
    pub(super) fn at_line(&mut self, line: u32) {
        self.is_reached |= self.seeks && line >= self.block;
    }

    /// Whether the block with this place and number is the one.
    pub(super) fn is_found(&self, block: u32, sequence: u32) -> bool {
        let is_reached = if self.is_line { self.is_reached } else { block >= self.block };
        is_reached && (self.sequence == NO_NUMBER || self.sequence == sequence)
    }
}
