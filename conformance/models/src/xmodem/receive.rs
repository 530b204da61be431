//! A file comes.

use super::block::{ACK, C, CAN, CANS, EOT, Heard, NAK, SOH, STX, heard};
use super::rules::Mode;
use super::{State, Xmodem};
use crate::model::Effect;
use softplug_abi::Failure;

/// So many characters in a row may have been a block.
const MAY_BE_BLOCK: usize = 64;

/// What is known of the file, and of what went wrong.
#[derive(Clone, Debug, Default)]
pub(super) struct File {
    /// Data of the good blocks; none: no delivery.
    pub(super) blocks: Vec<Vec<u8>>,
    /// The delivery is under way: a good block or the end of an empty file has come.
    pub(super) has_begun: bool,
    /// Calls since the last transfer.
    calls: u32,
    /// The latest call was C.
    pub(super) is_crc: bool,
    /// NAK in a row, and why the latest bad thing was bad.
    refusals: u32,
    why: Option<Failure>,
    /// Characters in a row that were no good block.
    run: usize,
    /// Such a run may have been a block, and no good one has followed.
    is_missing: bool,
    end_refused: bool,
}

impl File {
    /// The number of the next block.
    pub(super) fn next_number(&self) -> u8 {
        ((self.blocks.len() + 1) % 256) as u8
    }

    /// What is delivered of it: all, but for padding at its end.
    fn bytes(&self, pad: u8, strips: bool) -> Vec<u8> {
        let Some((last, before)) = self.blocks.split_last() else { return Vec::new() };
        let mut last = last.clone();
        while strips && last.last() == Some(&pad) {
            last.pop();
        }
        [before.concat(), last].concat()
    }
}

impl Xmodem {
    /// A character where no job is on the line; `None`: a damaged one.
    pub(super) fn hears(&mut self, character: Option<u8>) {
        let purge = self.now + self.rules.purge_time;
        match (&mut self.state, character) {
            (State::Idle { lingers: true, .. }, Some(EOT)) => {
                self.out.send(&[ACK], "xmodem.rx.end-again");
                let until = Some(self.now + self.rules.block_time);
                self.state = State::Idle { until, lingers: true };
            }
            (State::Idle { .. }, Some(byte @ (SOH | STX))) if self.file.calls > 0 => {
                self.begins_block(byte);
            }
            (State::Idle { .. }, Some(SOH | STX)) if self.job.is_some() => {
                self.state = State::Purging { until: purge, cancels: false };
            }
            (State::Idle { .. } | State::Sending(_), _)
            | (State::Calling { .. }, Some(C | NAK)) => {}
            (State::Block { characters, .. }, Some(byte)) => {
                characters.push(byte);
                let characters = characters.clone();
                self.goes_on_with(characters);
            }
            (State::Block { characters, .. }, None) => {
                let count = characters.len() + 1;
                self.is_noise(count, Failure::Checksum);
            }
            (State::Calling { .. } | State::Between { .. }, Some(byte @ (SOH | STX))) => {
                self.begins_block(byte);
            }
            (State::Calling { .. } | State::Between { .. } | State::EndHeard { .. }, Some(EOT)) => {
                self.state = State::EndHeard { until: purge };
            }
            (State::Calling { .. } | State::Between { .. }, Some(CAN)) => {
                self.state = State::CanHeard { until: purge };
            }
            (State::CanHeard { .. }, Some(CAN)) => {
                self.ends_file(Some(Failure::NoEndMark), "xmodem.rx.cancelled");
            }
            (State::Purging { until, .. }, _) => {
                *until = purge;
                self.file.run += 1;
                self.counts_run();
            }
            _ => self.is_noise(1, Failure::Protocol),
        }
    }

    fn begins_block(&mut self, first: u8) {
        let until = self.now + self.rules.character_time;
        self.state = State::Block { characters: vec![first], until };
    }

    fn counts_run(&mut self) {
        self.file.is_missing |= self.file.run >= MAY_BE_BLOCK;
    }

    /// So many characters were nothing good; the line has to become clear.
    fn is_noise(&mut self, count: usize, why: Failure) {
        self.bad(count, why);
        let until = self.now + self.rules.purge_time;
        self.state = State::Purging { until, cancels: false };
    }

    fn bad(&mut self, count: usize, why: Failure) {
        self.file.run = count;
        self.file.why = Some(why);
        self.counts_run();
    }

    fn goes_on_with(&mut self, characters: Vec<u8>) {
        match heard(&characters, self.file.is_crc) {
            Heard::Part => {
                let until = self.now + self.rules.character_time;
                self.state = State::Block { characters, until };
            }
            Heard::Bad => self.is_noise(characters.len(), Failure::Checksum),
            Heard::Good => self.is_good(&characters),
        }
    }

    fn is_good(&mut self, characters: &[u8]) {
        let number = characters[1];
        let length = if characters[0] == STX { 1_024 } else { 128 };
        if number == self.file.next_number() {
            let data = characters[3..3 + length].to_vec();
            self.file.has_begun = true;
            self.file.blocks.push(data);
            // How much of it finds room, and when, is the host's matter.
            if !self.takes_room() {
                self.is_blind = true;
            }
            self.acknowledges("xmodem.rx.block");
        } else if !self.file.blocks.is_empty() && number == self.file.next_number().wrapping_sub(1)
        {
            self.acknowledges("xmodem.rx.again");
        } else {
            self.ends_file(Some(Failure::Protocol), "xmodem.rx.wrong-number");
            self.out.send(&CANS, "xmodem.rx.wrong-number");
        }
    }

    fn acknowledges(&mut self, clause: &'static str) {
        self.file.refusals = 0;
        self.file.is_missing = false;
        self.file.end_refused = false;
        self.out.send(&[ACK], clause);
        self.state = State::Between { until: self.now + self.rules.block_time };
    }

    /// Time has run out.
    pub(super) fn silence(&mut self) {
        match &self.state {
            State::Idle { .. } => self.begins_calling(),
            State::Calling { .. } => self.calls(),
            State::Between { .. } => {
                self.bad(0, Failure::NoAnswer);
                self.refuses("xmodem.rx.silence");
            }
            State::Block { characters, .. } => {
                let count = characters.len();
                self.bad(count, Failure::Checksum);
                self.refuses("xmodem.rx.cut-off");
            }
            State::CanHeard { .. } => {
                self.bad(1, Failure::Protocol);
                self.refuses("xmodem.rx.noise");
            }
            State::Purging { cancels: true, .. } => {
                self.out.send(&CANS, "xmodem.rx.abort");
                self.rests(false);
            }
            State::Purging { .. } => self.refuses("xmodem.rx.bad-block"),
            State::EndHeard { .. } => self.is_at_end(),
            State::Sending(_) => {}
        }
    }

    /// NAK, or before the first good block the latest call, or it is over.
    fn refuses(&mut self, clause: &'static str) {
        if !self.file.has_begun && self.file.calls == 0 {
            // Nothing of it was asked for.
            return self.rests(false);
        }
        if !self.file.has_begun && self.job.is_some() {
            // No call while a job waits.
            self.state = State::Idle { until: None, lingers: false };
            return;
        }
        if self.file.has_begun {
            self.file.refusals += 1;
        }
        if self.file.refusals > self.rules.repeats {
            let why = self.file.why;
            self.ends_file(why, "xmodem.rx.repeats");
            self.out.send(&CANS, "xmodem.rx.repeats");
        } else {
            self.asks_again(clause);
        }
    }

    fn asks_again(&mut self, clause: &'static str) {
        if self.file.has_begun {
            self.out.send(&[NAK], clause);
            self.state = State::Between { until: self.now + self.rules.block_time };
        } else {
            self.out.send(&[if self.file.is_crc { C } else { NAK }], clause);
            self.state = State::Calling { until: self.now + self.rules.call_time };
        }
    }

    /// EOT, and nothing behind it.
    fn is_at_end(&mut self) {
        if !self.file.has_begun && self.job.is_some() {
            self.state = State::Idle { until: None, lingers: false };
        } else if self.file.is_missing {
            self.ends_file(Some(Failure::Protocol), "xmodem.rx.missing");
            self.out.send(&CANS, "xmodem.rx.missing");
        } else if self.rules.end_twice && !self.file.end_refused {
            self.file.end_refused = true;
            self.asks_again("xmodem.rx.end-twice");
        } else {
            self.file.has_begun = true;
            self.ends_file(None, "xmodem.rx.end");
            self.out.send(&[ACK], "xmodem.rx.end");
            self.rests(true);
        }
    }

    /// The file is over; its delivery ends, if there is one.
    pub(super) fn ends_file(&mut self, failure: Option<Failure>, clause: &'static str) {
        let file = std::mem::take(&mut self.file);
        if file.has_begun {
            self.deliveries += 1;
            let bytes = file.bytes(self.rules.pad, self.rules.strips);
            let id = self.deliveries;
            self.expected
                .expect(clause, Effect::Delivered { id, bytes, name: None, failure, status: 0 });
        }
        self.rests(false);
    }

    /// The host wants no more of the file.
    pub(super) fn aborts_file(&mut self) {
        if self.file.has_begun {
            self.ends_file(Some(Failure::Aborted), "xmodem.rx.abort");
            let until = self.now + self.rules.purge_time;
            self.state = State::Purging { until, cancels: true };
        }
    }

    /// Nothing is under way, and there is no call for a while.
    pub(super) fn rests(&mut self, lingers: bool) {
        let until = Some(self.now + self.rules.block_time);
        self.state = State::Idle { until, lingers };
    }

    /// Calls, if there is somebody to call for.
    pub(super) fn begins_calling(&mut self) {
        self.file = File::default();
        self.state = State::Idle { until: None, lingers: false };
        let may_call = self.rules.call && self.rules.is_wide() && self.has_place && !self.is_down;
        if may_call && self.job.is_none() {
            self.calls();
        }
    }

    fn calls(&mut self) {
        self.file.is_missing = false;
        self.file.end_refused = false;
        self.file.is_crc = match self.rules.mode {
            Mode::Checksum => false,
            Mode::Crc | Mode::Long => true,
            Mode::Auto => self.file.calls % 5 != 4,
        };
        self.file.calls += 1;
        self.out.send(&[if self.file.is_crc { C } else { NAK }], "xmodem.rx.call");
        self.state = State::Calling { until: self.now + self.rules.call_time };
    }
}
