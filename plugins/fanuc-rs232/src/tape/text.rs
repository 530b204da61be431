//! From one part of the program to the next, and what is sent of each.

use super::prefix::NO_NUMBER;
use super::{
    Encoder, Fault, Part, REFUSED, SPECIAL, SPECIAL_CLOSE, SPECIAL_CUT, SPECIAL_LF, SPECIAL_OPEN,
    SPECIAL_PERCENT, Setup,
};
use crate::{AfterEnd, BlockNumbers, Unsupported};
use softplug_plugin::Failure;

/// Block numbers have at most five digits; after the highest the first comes again.
const HIGHEST_NUMBER: u32 = 99_999;

impl Encoder {
    /// A character of the file, its line end as LF.
    pub(super) fn take(&mut self, settings: &Setup, character: u8) -> Result<(), Failure> {
        match self.place.part {
            Part::Leader => match character {
                _ if is_blank(character) => return Ok(()),
                SPECIAL_PERCENT => {
                    self.send(settings, character);
                    self.place.part = Part::Label;
                    return Ok(());
                }
                _ => {
                    self.open(settings);
                    return self.take(settings, character);
                }
            },
            Part::Label | Part::Block => {}
            Part::Prefix if self.place.prefix.take(character) => return Ok(()),
            Part::Prefix => return self.leave_prefix(settings, character),
            Part::Stripped if character == b' ' => return Ok(()),
            Part::Stripped => self.place.part = Part::Block,
            Part::Skipped => {
                if character == SPECIAL_PERCENT && !self.place.in_comment {
                    self.place.part = Part::End;
                }
                self.note_comment(settings, character);
                if character == SPECIAL_LF {
                    self.next_block(settings);
                }
                return Ok(());
            }
            Part::End if is_blank(character) => return Ok(()),
            // Without its first `%` the file has ended at what may be that one.
            Part::End if self.place.is_open => {
                self.place.fault = Fault::TextBefore;
                return Err(Failure::BadJob);
            }
            // Another program, or the rest of this one behind a `%` in the middle.
            Part::End if settings.after_end == AfterEnd::Refuse => {
                self.place.fault = Fault::TextBehind;
                return Err(Failure::BadJob);
            }
            Part::End => return Ok(()),
        }
        match character {
            SPECIAL_LF => {
                self.end_block(settings);
                self.next_block(settings);
                Ok(())
            }
            SPECIAL_PERCENT if self.place.in_comment => self.text(settings, character),
            SPECIAL_PERCENT | SPECIAL_CUT => self.end_program(settings, character),
            _ => self.text(settings, character),
        }
    }

    /// The closing `%`, or the end of a file without it.
    fn end_program(&mut self, settings: &Setup, character: u8) -> Result<(), Failure> {
        if self.restart.seeks && self.restart.has_preamble() {
            // Behind the O line alone it comes, too.
            self.end_block(settings);
            self.next_block(settings);
            return self.take(settings, character);
        }
        self.restart.seeks &= !self.place.is_head_wanted;
        if character == SPECIAL_PERCENT {
            self.send(settings, character);
            self.place.part = Part::End;
        }
        Ok(())
    }

    /// A file without its first `%`.
    #[inline(never)]
    pub(super) fn open(&mut self, settings: &Setup) {
        self.place.is_open = true;
        if settings.percent {
            self.send(settings, SPECIAL_PERCENT);
            self.end_block(settings);
        }
        self.next_block(settings);
    }

    #[inline(never)]
    fn next_block(&mut self, settings: &Setup) {
        let place = &mut self.place;
        place.block += 1;
        place.prefix.clear();
        self.restart.at_line(place.line);
        let has_prefix = self.restart.seeks || settings.block_numbers != BlockNumbers::Keep;
        place.part = if has_prefix { Part::Prefix } else { Part::Block };
    }

    /// A block's prefix has ended before `character`.
    fn leave_prefix(&mut self, settings: &Setup, character: u8) -> Result<(), Failure> {
        let place = &mut self.place;
        if self.restart.seeks {
            let is_empty = place.prefix.is_empty();
            let is_end = character == SPECIAL_PERCENT || character == SPECIAL_CUT;
            // Of no block; one that ends with its number is one.
            if is_end && is_empty && !place.is_head_wanted {
                place.part = Part::End;
                return Ok(());
            }
            // The O line comes before a preamble.
            if is_empty && place.block == 1 && matches!(character, b'O' | b':') {
                place.is_head_wanted = self.restart.is_found(1, NO_NUMBER);
                place.part = Part::Block;
                return self.take(settings, character);
            }
            if self.restart.has_preamble() {
                place.held = character;
                (place.held_block, place.held_prefix) = (place.block, place.prefix);
                // Its own blocks are encoded like any other, and none is sought in it.
                self.restart.seeks = false;
                place.prefix.clear();
                return Ok(());
            }
        }
        self.begin_block(settings, character)
    }

    /// Sends a block from its prefix on, or skips it.
    pub(super) fn begin_block(&mut self, settings: &Setup, character: u8) -> Result<(), Failure> {
        let prefix = self.place.prefix;
        self.place.prefix.clear();
        if self.restart.seeks {
            if !self.restart.is_found(self.place.block, prefix.number()) {
                self.place.part = Part::Skipped;
                return self.take(settings, character);
            }
            self.restart.seeks = false;
        }
        self.place.part = Part::Block;
        let numbers = settings.block_numbers;
        if prefix.number() == NO_NUMBER || numbers == BlockNumbers::Keep {
            self.send_all(settings, prefix.as_slice());
        } else {
            self.send_all(settings, prefix.before_number());
            if numbers == BlockNumbers::Strip {
                self.place.part = Part::Stripped;
            } else {
                self.send_number(settings);
            }
        }
        self.take(settings, character)
    }

    fn send_number(&mut self, settings: &Setup) {
        let step = settings.number_step as u32;
        let next = self.place.last_number + step;
        let number = if next > HIGHEST_NUMBER { step } else { next };
        self.place.last_number = number;
        self.send(settings, b'N');
        let mut divisor = 10_000;
        while divisor > 0 {
            if number >= divisor {
                self.send(settings, b'0' + (number / divisor % 10) as u8);
            }
            divisor /= 10;
        }
    }

    /// A character of the text of a block or preamble.
    pub(super) fn text(&mut self, settings: &Setup, character: u8) -> Result<(), Failure> {
        let character = match (character, settings.unsupported) {
            (REFUSED, _) | (SPECIAL_PERCENT, Unsupported::Refuse) => {
                return Err(Failure::UnsupportedCharacter);
            }
            (SPECIAL_PERCENT, Unsupported::Drop) => return Ok(()),
            // It would end the tape: the control knows no comments on that.
            (SPECIAL_PERCENT, Unsupported::Space) => b' ',
            _ => character,
        };
        if character == SPECIAL_CLOSE {
            self.note_comment(settings, character);
        }
        self.send(settings, character);
        self.note_comment(settings, character);
        Ok(())
    }

    /// The parentheses themselves are not of the comment, which ends with its block.
    fn note_comment(&mut self, settings: &Setup, character: u8) {
        match character {
            SPECIAL_OPEN => self.place.in_comment = true,
            SPECIAL_CLOSE | SPECIAL_LF => self.place.in_comment = false,
            _ => return,
        }
        self.place.counts = u8::from(settings.tv_comments || !self.place.in_comment);
    }

    /// Pads a block, if it is to be, and ends it. The label is not counted: TV
    /// begins behind the first EOB.
    pub(super) fn end_block(&mut self, settings: &Setup) {
        let cr = u8::from(settings.tv_cr);
        // CRs before the EOB count for this block, those behind it for the next.
        let (before, behind) = match settings.eob {
            b"\r\n" => (cr, 0),
            b"\n\r" => (0, cr),
            _ => (0, 0),
        };
        let is_odd = (self.place.count + before + 1) & 1 == 1;
        if settings.tv_pad && self.place.block > 0 && is_odd {
            self.send(settings, b' ');
        } else {
            self.end_waiting_block(settings);
        }
        self.place.eob_waits = true;
        self.place.count = behind;
        self.note_comment(settings, SPECIAL_LF);
    }

    pub(super) fn end_waiting_block(&mut self, settings: &Setup) {
        if self.place.eob_waits {
            self.place.eob_waits = false;
            for byte in settings.eob {
                self.output.push(settings.wire[usize::from(byte & !SPECIAL)]);
            }
        }
    }

    #[inline(never)]
    fn send_all(&mut self, settings: &Setup, characters: &[u8]) {
        for character in characters {
            self.send(settings, *character);
        }
    }

    fn send(&mut self, settings: &Setup, character: u8) {
        self.end_waiting_block(settings);
        self.place.count ^= self.place.counts;
        self.output.push(settings.wire[usize::from(character & !SPECIAL)]);
    }
}

/// Blank tape and blank lines.
fn is_blank(character: u8) -> bool {
    matches!(character, 0 | b' ' | b'\t' | 0x7F | SPECIAL_LF)
}
