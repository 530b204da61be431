//! What a partner does with our block.

use super::{Next, bytes, damaged, line_break, nothing, overrun, soon};
use crate::r3964::frame::{DLE, NAK, STX};
use softplug_abi::Micros;

impl Next<'_> {
    pub(super) fn answer_to_stx(&mut self, qvz: Option<Micros>) {
        let Some(deadline) = qvz else { return self.before_stx_has_left() };
        let soon = soon(self.dice);
        if !self.is_faulty() {
            if self.dice.one_in(10) {
                // Both at a time.
                return self.push(bytes(soon, &[STX]));
            }
            return self.push(bytes(soon, &[DLE]));
        }
        match self.dice.below(12) {
            0 => self.push(bytes(soon, &[NAK])),
            1 => self.push(bytes(soon, &[STX])),
            2 => {
                let byte = self.dice.byte();
                self.push(bytes(soon, &[byte]));
            }
            3 => {
                let proposal = damaged(soon, DLE, self.dice);
                self.push(proposal);
            }
            4 => {
                let proposal = overrun(soon, self.dice);
                self.push(proposal);
            }
            5 => {
                let proposal = line_break(soon, self.dice);
                self.push(proposal);
            }
            6 | 7 => {
                let wait = self.around(deadline);
                self.push(bytes(wait, &[DLE]));
            }
            8 => {
                let other = *self.dice.pick(&[STX, DLE, NAK, b'A']);
                self.push(bytes(soon, &[DLE, other]));
            }
            9 => {
                // High priority goes on waiting.
                let mut wait = soon;
                for _ in 0..self.dice.below(4) {
                    self.push(bytes(wait, &[STX]));
                    wait = 3_000;
                }
            }
            _ => {
                let wait = self.around(deadline);
                self.push(nothing(wait + 10));
            }
        }
    }

    pub(super) fn while_the_block_leaves(&mut self) {
        let end = self.until_quiet();
        if !self.is_faulty() {
            if self.dice.one_in(3) {
                return self.push(nothing(end.max(1)));
            }
            let wait = end + soon(self.dice);
            return self.push(bytes(wait, &[DLE]));
        }
        let wait = self.dice.between(1, end.max(1));
        match self.dice.below(8) {
            0 | 1 => self.push(bytes(wait, &[NAK])),
            2 => {
                let byte = self.dice.byte();
                self.push(bytes(wait, &[byte]));
            }
            3 => {
                let proposal = damaged(wait, NAK, self.dice);
                self.push(proposal);
            }
            4 => {
                let proposal = overrun(wait, self.dice);
                self.push(proposal);
            }
            5 => {
                let byte = *self.dice.pick(&[DLE, DLE, NAK]);
                let edge = (end + self.dice.between(-1, 1)).max(1);
                self.push(bytes(edge, &[byte]));
            }
            6 => self.push(bytes(wait, &[DLE])),
            _ => self.push(bytes(wait, &[STX])),
        }
    }

    pub(super) fn acknowledgement(&mut self, qvz: Micros) {
        let soon = soon(self.dice);
        if !self.is_faulty() {
            let glued: &[u8] = if self.dice.one_in(8) { &[DLE, STX] } else { &[DLE] };
            return self.push(bytes(soon, glued));
        }
        match self.dice.below(9) {
            0 | 1 => self.push(bytes(soon, &[NAK])),
            2 => self.push(bytes(soon, &[STX])),
            3 => {
                let byte = self.dice.byte();
                self.push(bytes(soon, &[byte]));
            }
            4 => {
                let proposal = damaged(soon, DLE, self.dice);
                self.push(proposal);
            }
            5 => {
                let wait = self.around(qvz);
                self.push(bytes(wait, &[DLE]));
            }
            6 => {
                let proposal = overrun(soon, self.dice);
                self.push(proposal);
            }
            7 => {
                let other = self.dice.byte();
                self.push(bytes(soon, &[DLE, other]));
            }
            _ => {
                let wait = self.around(qvz);
                self.push(nothing(wait + 10));
            }
        }
    }

    fn before_stx_has_left(&mut self) {
        let end = self.until_quiet();
        if !self.is_faulty() {
            return self.push(nothing(end.max(1)));
        }
        let wait = self.dice.between(1, end.max(1));
        let byte = *self.dice.pick(&[STX, STX, DLE, NAK, b'A']);
        match self.dice.below(4) {
            0 => {
                let proposal = damaged(wait, byte, self.dice);
                self.push(proposal);
            }
            1 => {
                let edge = (end + self.dice.between(-1, 1)).max(1);
                self.push(bytes(edge, &[byte]));
            }
            _ => self.push(bytes(wait, &[byte])),
        }
    }
}
