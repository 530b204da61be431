//! Characters of a capture.

use super::raw::{Raw, guess, is_blank, may_be_first, told};
use super::{Line, Punch, Stage, With};
use crate::fanuc_rs232::code::{decoded, has_wrong_parity};
use crate::fanuc_rs232::delivery::Delivery;
use crate::fanuc_rs232::rules::{Code, Rules};
use softplug_abi::{Failure, Micros};

/// So many wait for the EOB that tells the code.
const MOST_UNKNOWN: usize = 128;

/// LF CR CR is one line end.
const MOST_OF_LF: u8 = 2;

/// A character of a tape.
#[derive(Copy, Clone, Debug)]
struct Heard {
    byte: u8,
    is_damaged: bool,
    /// A NUL or DEL, which is dropped.
    is_blank: bool,
}

impl Punch {
    pub(super) fn take(&mut self, at: Micros, raw: Raw, with: &mut With<'_>) {
        self.was_heard(at);
        let Some(capture) = &mut self.capture else { return };
        match (&mut capture.stage, capture.code) {
            (Stage::Punching, None) => {
                if let Raw::Whole(byte) | Raw::Damaged(byte) = raw
                    && may_be_first(byte, with.rules)
                {
                    capture.stage = Stage::Unknown(vec![raw]);
                }
            }
            // Blank tape.
            (Stage::Unknown(_), _) if matches!(raw, Raw::Whole(0)) => {}
            (Stage::Unknown(raws), _) => {
                raws.push(raw);
                let is_full = raws.len() == MOST_UNKNOWN;
                let guessed = is_full.then(|| guess(raws, with.rules));
                let told = match raw {
                    Raw::Whole(byte) | Raw::Damaged(byte) => told(byte),
                    Raw::Break | Raw::Overrun => None,
                };
                if let Some(code) = told.or(guessed) {
                    self.decode(at, code, with);
                }
            }
            (_, Some(code)) => self.put(at, raw, code, with),
            (_, None) => {}
        }
    }

    /// The code is known: what was kept is decoded.
    pub(super) fn decode(&mut self, at: Micros, code: Code, with: &mut With<'_>) {
        let Some(capture) = &mut self.capture else { return };
        if let Stage::Unknown(raws) = std::mem::replace(&mut capture.stage, Stage::Punching) {
            capture.code = Some(code);
            for raw in raws {
                self.put(at, raw, code, with);
            }
        }
    }

    /// Something of a capture whose code is known.
    fn put(&mut self, at: Micros, raw: Raw, code: Code, with: &mut With<'_>) {
        // Where we check the parity, a NUL or DEL with a wrong one keeps its place. Of
        // others that are damaged the page does not say so.
        let is_blank = match raw {
            Raw::Whole(byte) | Raw::Damaged(byte) => is_blank(byte, code, with.rules),
            Raw::Break | Raw::Overrun => false,
        };
        let (byte, is_damaged) = match raw {
            Raw::Whole(byte) if code == Code::Iso => {
                (byte & 0x7F, has_wrong_parity(byte, with.rules))
            }
            Raw::Whole(byte) => match decoded(byte, code, with.rules) {
                Some(character) => (character, false),
                None => return self.unknown(byte, with),
            },
            Raw::Damaged(byte) => match decoded(byte, code, with.rules) {
                Some(character) => (character, true),
                None => return self.unknown(byte, with),
            },
            Raw::Break => return self.wrong(Failure::LineError, with.rules),
            Raw::Overrun => return self.wrong(Failure::Overrun, with.rules),
        };
        let Some(capture) = &mut self.capture else { return };
        match capture.stage {
            Stage::Punching if byte == b'%' => {
                capture.stage = Stage::Receiving;
                capture.delivery = Some(Delivery::new(with.rules, with.room));
                if is_damaged {
                    self.wrong(Failure::LineError, with.rules);
                }
            }
            Stage::Receiving => self.receive(at, Heard { byte, is_damaged, is_blank }, code, with),
            Stage::Ended if !is_damaged => self.behind(at, byte, with),
            Stage::Punching | Stage::Unknown(_) | Stage::Ended | Stage::Leaving(_) => {}
        }
    }

    /// A character that EIA does not have: damaged. It is kept as it came; the page does
    /// not say so.
    fn unknown(&mut self, byte: u8, with: &mut With<'_>) {
        self.wrong(Failure::LineError, with.rules);
        if self.is_receiving()
            && let Some(capture) = &mut self.capture
            && let Some(delivery) = &mut capture.delivery
        {
            delivery.put(&[byte], with.room);
        }
    }

    fn wrong(&mut self, failure: Failure, rules: &Rules) {
        let Some(capture) = &mut self.capture else { return };
        let Stage::Receiving = capture.stage else { return };
        let Some(delivery) = &mut capture.delivery else { return };
        match failure {
            Failure::Overrun => delivery.lost = true,
            _ if rules.fails_on_line_error => delivery.fails(failure),
            _ => {}
        }
    }

    /// A character of a tape.
    fn receive(&mut self, at: Micros, heard: Heard, code: Code, with: &mut With<'_>) {
        let Heard { byte, is_damaged, is_blank } = heard;
        let Some(capture) = &mut self.capture else { return };
        let line = capture.line;
        if !is_blank && let Some(delivery) = &mut capture.delivery {
            capture.line = Line::default();
            // A CR waits for what follows: an LF is one line end with it.
            match (line.is_behind_cr, byte) {
                (true, b'\n') => delivery.carriage_return(with.rules),
                (true, _) => delivery.eob(with.rules, with.room),
                (false, _) => {}
            }
        }
        let splits = with.rules.splits_programs
            && self.delivery().is_some_and(|delivery| delivery.begins_another(byte));
        if splits {
            self.split(at, with);
        }
        let Some(capture) = &mut self.capture else { return };
        let Some(delivery) = &mut capture.delivery else { return };
        // In EIA a NUL has an even number of holes, as a damaged character has.
        let is_bad_nul = code == Code::Eia && byte == 0 && capture.has_eob;
        capture.has_eob |= byte == b'\n';
        let fails = (is_damaged || is_bad_nul) && with.rules.fails_on_line_error;
        match byte {
            _ if is_blank => {}
            b'%' => {
                capture.stage = Stage::Ended;
                (capture.is_closed, capture.is_behind_eob) = (true, false);
                delivery.close(with.rules, with.room);
            }
            b'\n' => {
                capture.line.of_lf = if line.is_behind_cr { 0 } else { MOST_OF_LF };
                delivery.eob(with.rules, with.room);
            }
            b'\r' if code == Code::Iso && line.of_lf > 0 => {
                capture.line.of_lf = line.of_lf - 1;
                delivery.carriage_return(with.rules);
            }
            b'\r' if code == Code::Iso => capture.line.is_behind_cr = true,
            byte => delivery.character(byte, with.rules, with.room),
        }
        // Of a damaged EOB behind an odd block the block counts; the page does not say so.
        if fails {
            delivery.fails(Failure::LineError);
        }
    }

    /// A whole character behind the closing `%`.
    fn behind(&mut self, at: Micros, byte: u8, with: &mut With<'_>) {
        let Some(capture) = &mut self.capture else { return };
        match byte {
            0 | 0x7F | b' ' | b'\t' => {}
            b'\n' | b'\r' => capture.is_behind_eob = true,
            byte => {
                let is_behind_eob = capture.is_behind_eob;
                let code = capture.code;
                self.finish(at, None, "fanuc-rs232.punch.after-end", with);
                let Some(capture) = &mut self.capture else { return };
                capture.stage = Stage::Receiving;
                capture.has_eob = is_behind_eob && byte != b'%';
                let mut delivery = Delivery::new(with.rules, with.room);
                if byte == b'%' {
                    capture.delivery = Some(delivery);
                    return;
                }
                if is_behind_eob {
                    delivery.first_line_ends(with.rules, with.room);
                }
                capture.delivery = Some(delivery);
                let heard = Heard { byte, is_damaged: false, is_blank: false };
                self.receive(at, heard, code.unwrap_or(Code::Iso), with);
            }
        }
    }

    /// The next program of a tape begins.
    fn split(&mut self, at: Micros, with: &mut With<'_>) {
        let Some(capture) = &mut self.capture else { return };
        // Spaces before the O or `:` are of its block.
        let count = capture.delivery.as_ref().map_or(0, Delivery::count);
        if let Some(delivery) = &mut capture.delivery {
            delivery.close(with.rules, with.room);
        }
        (capture.is_closed, capture.is_behind_eob) = (true, false);
        self.finish(at, None, "fanuc-rs232.punch.programs", with);
        let Some(capture) = &mut self.capture else { return };
        let mut delivery = Delivery::new(with.rules, with.room);
        delivery.first_line_ends(with.rules, with.room);
        delivery.has_counted(count);
        capture.delivery = Some(delivery);
    }
}
