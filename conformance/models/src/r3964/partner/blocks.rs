//! What a partner does with a block of its own.

use super::{Next, bytes, damaged, damaged_before, line_break, nothing, overrun, soon};
use crate::r3964::frame::{DLE, ETX, NAK, STX, block, check};
use softplug_abi::Micros;

impl Next<'_> {
    pub(super) fn without_buffer(&mut self, until: Micros) {
        let soon = soon(self.dice);
        match self.dice.below(9) {
            0..=3 => self.host_drains(soon),
            4 => {
                let byte = *self.dice.pick(&[STX, DLE, NAK, b'A']);
                self.push(bytes(soon, &[byte]));
            }
            5 => {
                let proposal = overrun(soon, self.dice);
                self.push(proposal);
            }
            6 if self.station.job.is_none() => self.job(soon),
            _ => {
                let wait = self.around(until);
                self.push(nothing(wait + 10));
            }
        }
    }

    pub(super) fn set_up_again(&mut self) {
        let end = self.until_quiet();
        if !self.is_faulty() {
            let wait = self.after_our_characters();
            return self.block_comes(wait);
        }
        let wait = self.dice.between(1, end.max(1));
        match self.dice.below(6) {
            0 | 1 => self.push(bytes(wait, &[STX])),
            2 => self.block_comes(wait),
            3 => {
                let byte = *self.dice.pick(&[DLE, NAK, ETX, b'A']);
                self.push(bytes(wait, &[byte]));
            }
            4 => {
                let proposal = damaged(wait, STX, self.dice);
                self.push(proposal);
            }
            _ => {
                let proposal = overrun(wait, self.dice);
                self.push(proposal);
            }
        }
    }

    pub(super) fn in_block(&mut self, zvz: Micros) {
        let come = self.station.reception.as_ref().map_or(0, |known| known.incoming.characters());
        let soon = soon(self.dice);
        if come == 0 && !self.is_faulty() {
            return self.block_comes(soon);
        }
        match self.dice.below(8) {
            // The other of low priority answers too.
            0 if come == 0 => self.push(bytes(soon, &[DLE])),
            0..=3 => {
                let end = [DLE, ETX, self.dice.byte()];
                let count = if self.station.parameters.bcc { 3 } else { 2 };
                self.push(bytes(soon, &end[..count]));
            }
            4 => {
                let rest = self.partners_block();
                self.cut(soon, &rest);
            }
            5 => {
                let wait = self.around(zvz);
                let byte = self.dice.byte();
                self.push(bytes(wait, &[byte]));
            }
            _ => {
                let wait = self.around(zvz);
                self.push(nothing(wait + 10));
            }
        }
    }

    pub(super) fn repetition(&mut self, bwz: Option<Micros>) {
        let wait = self.after_our_characters();
        if !self.is_faulty() {
            return self.push(bytes(wait, &[STX]));
        }
        match self.dice.below(6) {
            0 => {
                let byte = *self.dice.pick(&[DLE, NAK, ETX, b'A']);
                self.push(bytes(wait, &[byte]));
            }
            1 => {
                let proposal = damaged(wait, STX, self.dice);
                self.push(proposal);
            }
            2 => {
                let wait = self.around(bwz.unwrap_or(self.now));
                self.push(bytes(wait, &[STX]));
            }
            3 => {
                let proposal = overrun(wait, self.dice);
                self.push(proposal);
            }
            4 => self.push(bytes(1, &[STX])),
            _ => {
                let wait = self.around(bwz.unwrap_or(self.now));
                self.push(nothing(wait + 10));
            }
        }
    }

    /// A block as the partner sends it: mostly right.
    pub(super) fn partners_block(&mut self) -> Vec<u8> {
        let is_faulty = self.is_faulty();
        let data = self.upper.block(self.station, is_faulty, self.dice);
        let mut all = block(&self.station.parameters, &data);
        if !self.is_faulty() {
            return all;
        }
        let at = self.dice.below(all.len() as u64) as usize;
        match self.dice.below(6) {
            0 => all[at] ^= 1 << self.dice.below(8),
            1 => drop(all.remove(at)),
            2 => all.insert(at, DLE),
            3 => all.truncate(at),
            4 => {
                // Seeded with STX.
                let last = all.len() - 1;
                all[last] ^= STX;
            }
            _ => {
                all.insert(at, self.dice.byte());
                let last = all.len() - 1;
                all[last] = check(&all[..last]);
            }
        }
        all
    }

    pub(super) fn block_comes(&mut self, wait: i64) {
        let block = self.partners_block();
        if self.is_faulty() {
            self.disturbed(wait, &block);
        } else {
            self.cut(wait, &block);
        }
        // The next set-up comes with it.
        if self.dice.one_in(20) {
            let soon = self.dice.between(1, 5_000);
            self.push(bytes(soon, &[STX]));
        }
    }

    /// With one error of the line in it, before it or behind it.
    fn disturbed(&mut self, wait: i64, block: &[u8]) {
        let at = self.dice.below(block.len() as u64 + 1) as usize;
        let (before, mut behind) = block.split_at(at);
        self.cut(wait, before);
        let soon = self.dice.between(1, 5_000) + if before.is_empty() { wait } else { 0 };
        let error = match (self.dice.below(7), behind) {
            (0, _) => overrun(soon, self.dice),
            (1, _) => line_break(soon, self.dice),
            (2 | 3, [byte, rest @ ..]) => {
                behind = rest;
                damaged(soon, *byte, self.dice)
            }
            (4, _) => {
                let byte = self.dice.byte();
                damaged(soon, byte, self.dice)
            }
            _ => damaged_before(soon, self.dice),
        };
        self.push(error);
        let soon = self.dice.between(1, 5_000);
        self.cut(soon, behind);
    }

    /// In one event, character by character, or in pieces with pauses.
    pub(super) fn cut(&mut self, wait: i64, all: &[u8]) {
        let character = self.character().max(1);
        let zvz = self.station.parameters.zvz.0;
        let mut rest = all;
        let mut wait = wait;
        let kind = self.dice.below(8);
        // No station has place for the answers to hundreds of set-ups at once.
        let are_many = all.split(|byte| *byte == STX).count() > 101;
        let largest = if are_many { 200 } else { usize::MAX };
        while !rest.is_empty() {
            let most = rest.len().min(largest) as u64;
            let count = match kind {
                0..=2 => most,
                3 if most < 20 => 1,
                _ => 1 + self.dice.below(most),
            } as usize;
            let (piece, later) = rest.split_at(count);
            self.push(bytes(wait, piece));
            rest = later;
            let time = character * later.len().min(count) as i64;
            wait = match self.dice.below(12) {
                0 if kind > 4 => zvz + self.dice.between(-1, 0),
                0 if kind == 4 => zvz + self.dice.between(-1, 1),
                1 if kind > 4 => self.dice.between(1, zvz),
                _ => time.min(zvz),
            }
            .max(1);
        }
    }
}
