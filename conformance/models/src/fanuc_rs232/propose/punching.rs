//! A control that punches.

use super::Guess;
use crate::dice::Dice;
use crate::fanuc_rs232::code::eia;
use crate::fanuc_rs232::rules::{Code, Parity};
use crate::model::{HostRequest, Proposal};
use crate::propose::{come, host};

impl Guess<'_> {
    pub(super) fn punching(&self, dice: &mut Dice) -> Proposal {
        let punch = &self.model.punch;
        if self.model.flow.is_stopped() && !dice.one_in(3) {
            // A control that obeys.
            return self.room(dice);
        }
        match dice.below(40) {
            0..=1 => {
                let byte = meaning(dice);
                return self.damaged(byte, dice);
            }
            2 => return host(self.pause(dice), HostRequest::Abort(0)),
            3..=4 => return self.nothing(dice),
            5 => {
                let code = *dice.pick(&[0x11, 0x12, 0x93, 0x14, 0x95, 0x96]);
                return come(self.pause(dice), vec![self.control(code, dice)]);
            }
            6 => return come(self.pause(dice), vec![meaning(dice)]),
            7 => return self.burst(dice),
            8 if dice.one_in(2) => return self.in_time(dice),
            _ => {}
        }
        let bytes = if punch.is_idle() {
            self.output(dice)
        } else if punch.is_punching() {
            self.begin(dice)
        } else if punch.is_receiving() {
            self.middle(dice)
        } else if punch.is_ended() {
            self.end(dice)
        } else {
            return self.leaving(dice);
        };
        let wait = if dice.one_in(10) { self.pause(dice) } else { self.characters(bytes.len()) };
        come(wait, bytes)
    }

    /// The code that the control punches: the one that is known, or any.
    fn code(&self, dice: &mut Dice) -> Code {
        let known = self.model.punch.code().or(self.model.rules.receive_code);
        known.unwrap_or(*dice.pick(&[Code::Iso, Code::Iso, Code::Eia]))
    }

    /// DC2 and what follows at once.
    fn output(&self, dice: &mut Dice) -> Vec<u8> {
        let code = self.code(dice);
        let mut bytes = Vec::new();
        if self.model.rules.need_dc2 || dice.one_in(2) {
            bytes.push(0x12);
        }
        if dice.one_in(3) {
            return bytes;
        }
        bytes.extend(vec![0; dice.below(4) as usize]);
        bytes.extend(self.encoded(&self.tape(dice), code, dice));
        if dice.one_in(3) {
            return bytes;
        }
        bytes.extend(vec![0; dice.below(4) as usize]);
        bytes.push(0x14);
        bytes
    }

    fn begin(&self, dice: &mut Dice) -> Vec<u8> {
        let code = self.code(dice);
        let texts: [&[u8]; 5] = [b"%\n", b"%\n", b"%\n", b"%", b"%HEAD 3\n"];
        let mut text = dice.pick(&texts).to_vec();
        if dice.one_in(10) {
            // No EOB tells the code for long.
            text = [b"%".as_slice(), &vec![b'A'; dice.below(160) as usize]].concat();
        }
        let mut bytes = vec![0; dice.below(4) as usize];
        if dice.one_in(8) {
            bytes.extend(b"\x1B&HE:");
        }
        bytes.extend(self.encoded(&text, code, dice));
        bytes
    }

    fn middle(&self, dice: &mut Dice) -> Vec<u8> {
        let code = self.code(dice);
        let mut text = Vec::new();
        for _ in 0..dice.between(1, 4) {
            text.extend(self.block(dice));
            text.push(b'\n');
        }
        match dice.below(6) {
            0 => text.truncate(dice.below(text.len() as u64) as usize),
            1..=2 => text.extend(b"%\n"),
            3 => text.push(b'%'),
            _ => {}
        }
        let mut bytes = self.encoded(&text, code, dice);
        if dice.one_in(8) {
            bytes.push(0x14);
        }
        bytes
    }

    fn end(&self, dice: &mut Dice) -> Vec<u8> {
        let code = self.code(dice);
        match dice.below(8) {
            0..=3 => vec![0x14],
            4 => self.encoded(&self.tape(dice), code, dice),
            5 => {
                let texts: [&[u8]; 6] = [b"\n", b" ", b"\n\n", b" \n", b"X", b"%"];
                let text = *dice.pick(&texts);
                self.encoded(text, code, dice)
            }
            6 => vec![0; dice.between(1, 5) as usize],
            _ => self.encoded(&self.block(dice), code, dice),
        }
    }

    fn leaving(&self, dice: &mut Dice) -> Proposal {
        match dice.below(6) {
            0 => come(self.pause(dice), vec![self.control(0x96, dice)]),
            1 => come(self.pause(dice), vec![self.control(0x95, dice)]),
            2 => come(self.pause(dice), vec![*dice.pick(&[0x11, 0x12])]),
            3 => come(self.pause(dice), self.output(dice)),
            _ => self.nothing(dice),
        }
    }

    /// Something, or blank tape, as silence is nearly too long.
    fn in_time(&self, dice: &mut Dice) -> Proposal {
        let (punch, is_stopped) = (&self.model.punch, self.model.flow.is_stopped());
        let Some(deadline) = punch.deadline(&self.model.rules, is_stopped) else {
            return self.nothing(dice);
        };
        let byte = if dice.one_in(3) { meaning(dice) } else { 0 };
        come((deadline - self.now).0 - dice.between(0, 2), vec![byte])
    }

    /// As many characters as just reach a mark, or all room.
    fn burst(&self, dice: &mut Dice) -> Proposal {
        let known = i64::from(self.model.room.known());
        let mark = *dice.pick(&[self.model.flow.low, self.model.flow.low, 0]);
        let count = known - i64::from(mark) + dice.between(-3, 3);
        let mut text = Vec::new();
        while (text.len() as i64) < count.clamp(1, 9_000) {
            text.extend(self.block(dice));
            text.push(b'\n');
        }
        text.truncate(count.clamp(1, 9_000) as usize);
        let code = self.code(dice);
        let bytes = self.encoded(&text, code, dice);
        come(self.characters(bytes.len()), bytes)
    }

    /// Text as the control punches it.
    pub(super) fn encoded(&self, text: &[u8], code: Code, dice: &mut Dice) -> Vec<u8> {
        let rules = &self.model.rules;
        let odd_ends = dice.one_in(12);
        let mut bytes = Vec::new();
        for character in text {
            match (code, character) {
                (Code::Eia, b'\n') => bytes.push(0x80),
                (Code::Eia, character) => {
                    bytes.push(eia(character.to_ascii_uppercase(), rules).unwrap_or(0x10));
                }
                (Code::Iso, b'\n') => {
                    let ends: [&[u8]; 5] = [b"\n", b"\r\n", b"\r", b"\n\r\r", b"\n\r"];
                    let end = if odd_ends { *dice.pick(&ends) } else { rules.eob };
                    bytes.extend(end.iter().map(|byte| self.iso(*byte, dice)));
                }
                (Code::Iso, character) => bytes.push(self.iso(*character, dice)),
            }
        }
        bytes
    }

    fn iso(&self, character: u8, dice: &mut Dice) -> u8 {
        let rules = &self.model.rules;
        let is_odd = character.count_ones() % 2 == 1;
        match rules.parity {
            Parity::Software if is_odd => character | 0x80,
            Parity::None if dice.one_in(30) => character | 0x80,
            Parity::Software | Parity::None | Parity::Uart => character,
        }
    }
}

/// One byte that means something.
fn meaning(dice: &mut Dice) -> u8 {
    match dice.below(4) {
        0 => *dice.pick(b"%%\r\n\x80\x0B\xA5 O(:"),
        1 => *dice.pick(crate::fanuc_rs232::values::SPECIAL),
        2 => dice.byte(),
        _ => *dice.pick(b"\0\x7F\x13\x15\x16\x93"),
    }
}
