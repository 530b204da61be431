//! What a partner and a host could do next.

use super::block::{ACK, C, CAN, EOT, NAK, SOH, STX, block};
use super::send::{Sending, Stage};
use super::{State, Xmodem};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros};

pub(super) fn propose(own: &Xmodem, now: Micros, dice: &mut Dice) -> Proposal {
    if !own.is_open {
        return after(dice.between(1, 3_000_000), host(HostRequest::Open));
    }
    if own.is_down && !dice.one_in(4) {
        return after(dice.between(1, 20_000_000), line(LineInput::Up));
    }
    if dice.one_in(30) {
        return own.rare(now, dice);
    }
    match &own.state {
        State::Sending(sending) => own.sending(now, sending, dice),
        State::Idle { .. } if own.job.is_some() => own.job_waits(dice),
        State::Idle { .. } => own.idle(now, dice),
        State::Calling { .. } | State::Between { .. } => own.receiving(now, dice),
        State::Block { characters, .. } => own.in_block(now, characters, dice),
        _ => own.waits_for_silence(now, dice),
    }
}

fn after(wait: i64, given: Given) -> Proposal {
    Proposal { wait: Micros(wait.max(1)), given }
}

fn host(request: HostRequest) -> Given {
    Given::Host(request)
}

fn line(input: LineInput) -> Given {
    Given::Line(input)
}

fn says(bytes: &[u8]) -> Given {
    line(LineInput::Bytes(bytes.to_vec()))
}

/// A time that people or machines take.
fn pause(dice: &mut Dice) -> i64 {
    match dice.below(8) {
        0 => dice.between(1, 1_000),
        1 => dice.between(1, 900_000),
        2 => dice.between(1, 4_000_000),
        _ => dice.between(1, 60_000),
    }
}

/// Data of a block: programs, bytes of the protocol, padding.
fn data(length: usize, pad: u8, dice: &mut Dice) -> Vec<u8> {
    const SPECIAL: &[u8] = &[SOH, STX, EOT, ACK, NAK, CAN, C, 0x1A, 0, 255];
    let mut data: Vec<u8> = match dice.below(4) {
        0 => (0..length).map(|_| dice.byte()).collect(),
        1 => (0..length).map(|_| *dice.pick(SPECIAL)).collect(),
        _ => b"N10 G1 X-20.5\n".iter().copied().cycle().take(length).collect(),
    };
    let padding = match dice.below(4) {
        0 => dice.below(length as u64 + 1) as usize,
        1 => length,
        _ => 0,
    };
    data[length - padding..].fill(pad);
    data
}

impl Xmodem {
    /// A tick before, at, or after what is due; or, if nothing is, soon.
    fn about(&self, now: Micros, dice: &mut Dice) -> i64 {
        self.deadline().map_or(1_000, |deadline| (deadline - now).0 + dice.between(-1, 1))
    }

    fn characters(&self, count: usize) -> i64 {
        self.rules.line.characters(count as u64).0
    }

    /// One event with all of it after the time it takes, or a part of it.
    fn spoken(&self, mut all: Vec<u8>, dice: &mut Dice) -> Proposal {
        if dice.one_in(6) {
            all.truncate(dice.between(1, all.len() as i64) as usize);
        }
        after(pause(dice) + self.characters(all.len()), says(&all))
    }

    fn block(&self, number: u8, dice: &mut Dice) -> Vec<u8> {
        let length = if dice.one_in(6) { 1_024 } else { 128 };
        block(number, &data(length, self.rules.pad, dice), self.file.is_crc)
    }

    fn bad_block(&self, number: u8, dice: &mut Dice) -> Vec<u8> {
        let mut block = self.block(number, dice);
        let place = match dice.below(4) {
            0 => dice.below(3),
            1 => block.len() as u64 - 1 - dice.below(2),
            _ => dice.below(block.len() as u64),
        } as usize;
        match dice.below(4) {
            0 => _ = block.remove(place),
            1 => block.insert(place, block[place]),
            _ => block[place] ^= 1 << dice.below(8),
        }
        block
    }

    fn receiving(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let next = self.file.next_number();
        match dice.below(32) {
            0..=15 => self.spoken(self.block(next, dice), dice),
            16..=18 => self.spoken(self.bad_block(next, dice), dice),
            19 | 20 => self.spoken(self.block(next.wrapping_sub(1), dice), dice),
            21 if dice.one_in(4) => self.spoken(self.block(dice.byte(), dice), dice),
            21..=24 => after(pause(dice), says(&[EOT])),
            25 => self.spoken(vec![CAN; dice.between(1, 4) as usize], dice),
            26 => {
                let length = *dice.pick(&[1, 2, 20, 63, 64, 65]);
                self.spoken((0..length).map(|_| dice.byte()).collect(), dice)
            }
            27 => self.spoken([&[EOT][..], &self.block(next, dice)].concat(), dice),
            28 => self.spoken([&self.block(next, dice)[..], &[EOT]].concat(), dice),
            29 => self.job(dice),
            30 => after(self.about(now, dice), says(&[*dice.pick(&[SOH, STX, EOT, CAN, C, NAK])])),
            _ => after(self.about(now, dice), Given::Nothing),
        }
    }

    fn in_block(&self, now: Micros, characters: &[u8], dice: &mut Dice) -> Proposal {
        let long = if characters[0] == STX { 1_024 } else { 128 };
        let whole = 3 + long + if self.file.is_crc { 2 } else { 1 };
        let mut rest = match characters.get(1) {
            Some(number) => block(*number, &vec![b'r'; long], self.file.is_crc),
            None => block(self.file.next_number(), &vec![b'r'; long], self.file.is_crc),
        };
        // What was there before keeps its check only by chance: the rest is made to fit.
        let mut all = characters.to_vec();
        all.extend(rest.drain(characters.len().min(whole)..));
        let end = 3 + long;
        let check = super::block::check(&all[3..end], self.file.is_crc);
        all[end..].copy_from_slice(&check);
        let rest = all.split_off(characters.len());
        match dice.below(12) {
            0 => after(self.about(now, dice), says(&rest)),
            1 => after(self.about(now, dice), Given::Nothing),
            2 => after(pause(dice), says(&[CAN, CAN])),
            3 => after(1 + self.characters(1), says(&[dice.byte()])),
            _ => after(1 + self.characters(rest.len()).min(5_000_000), says(&rest)),
        }
    }

    fn waits_for_silence(&self, now: Micros, dice: &mut Dice) -> Proposal {
        match dice.below(8) {
            0 => after(self.about(now, dice), says(&[*dice.pick(&[SOH, EOT, CAN, C, b'x'])])),
            1 => after(pause(dice), says(&[*dice.pick(&[SOH, EOT, CAN, CAN, C, b'x'])])),
            _ => after(self.about(now, dice), Given::Nothing),
        }
    }

    fn idle(&self, now: Micros, dice: &mut Dice) -> Proposal {
        match dice.below(12) {
            0 => after(pause(dice), says(&[EOT])),
            1 => after(pause(dice), says(&[*dice.pick(&[C, NAK, SOH, CAN])])),
            2 => self.spoken(self.block(1, dice), dice),
            3 => after(pause(dice), host(HostRequest::Close)),
            4 | 5 => after(self.about(now, dice), says(&[EOT])),
            6..=8 => after(self.about(now, dice), Given::Nothing),
            _ => self.job(dice),
        }
    }

    fn job(&self, dice: &mut Dice) -> Proposal {
        let length = match dice.below(10) {
            0 => 0,
            1 => 128 * dice.between(1, 4) as usize,
            2 => 1_024 * dice.between(1, 3) as usize,
            3 => dice.between(890, 1_030) as usize,
            4 => dice.between(1_025, 40_000) as usize,
            _ => dice.between(1, 400) as usize,
        };
        let data = if length == 0 { Vec::new() } else { data(length, self.rules.pad, dice) };
        let (kind, fields) = ("send".to_owned(), Vec::new());
        after(pause(dice), host(HostRequest::Job { id: self.jobs + 1, kind, fields, data }))
    }

    fn job_waits(&self, dice: &mut Dice) -> Proposal {
        match dice.below(16) {
            0 => self.job(dice),
            1 => after(pause(dice), host(HostRequest::Abort(self.jobs))),
            2 => after(pause(dice), host(HostRequest::Pause(self.jobs))),
            3 => after(pause(dice), host(HostRequest::Close)),
            4 => after(pause(dice), says(&[*dice.pick(&[ACK, EOT, SOH, CAN, b'x'])])),
            // Nothing in a block is a call.
            10 | 11 => self.spoken(self.block(1, dice), dice),
            5 => after(dice.between(1, 30_000_000), Given::Nothing),
            6..=8 => after(pause(dice), says(&[NAK])),
            9 => after(pause(dice), says(&[C, C])),
            _ => after(pause(dice), says(&[C])),
        }
    }

    fn sending(&self, now: Micros, sending: &Sending, dice: &mut Dice) -> Proposal {
        match sending.stage {
            Stage::Paused => match dice.below(4) {
                0 => after(pause(dice), says(&[*dice.pick(&[ACK, NAK, C, CAN])])),
                1 => after(pause(dice), host(HostRequest::Abort(self.jobs))),
                _ => after(pause(dice), host(HostRequest::Resume(self.jobs))),
            },
            Stage::Leaving(place) => {
                let rest = self.characters(self.out.remaining(place) as usize);
                match dice.below(16) {
                    0 => after(dice.between(1, rest.max(1)), says(&[*dice.pick(&[ACK, NAK, CAN])])),
                    1 => after(dice.between(1, rest.max(1)), host(HostRequest::Abort(self.jobs))),
                    2 => after(dice.between(1, rest.max(1)), host(HostRequest::Pause(self.jobs))),
                    3 => after(rest + dice.between(-1, 1), says(&[ACK])),
                    _ => after(rest + pause(dice), says(&[ACK])),
                }
            }
            Stage::Settling(_) => self.waits_for_silence(now, dice),
            Stage::Answer(_) => match dice.below(24) {
                0..=2 => after(pause(dice), says(&[NAK])),
                3 => after(pause(dice), says(&[C])),
                4 => after(pause(dice), says(&[CAN, CAN])),
                5 => after(pause(dice), says(&[CAN, ACK])),
                6 => after(pause(dice), says(&[dice.byte()])),
                7 => after(pause(dice), says(&[ACK, ACK])),
                8 => after(self.about(now, dice), says(&[*dice.pick(&[ACK, NAK])])),
                9 => after(self.about(now, dice), Given::Nothing),
                10 => after(pause(dice), host(HostRequest::Abort(self.jobs))),
                _ => after(pause(dice), says(&[ACK])),
            },
        }
    }

    /// What a host does now and then, and what happens to any line.
    fn rare(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        let damaged = |kind, byte| line(LineInput::Damaged { kind, byte, span: 0 });
        match dice.below(14) {
            0 => after(wait, damaged(LineErrorKind::Framing, Some(ACK))),
            1 => after(wait, damaged(LineErrorKind::Overrun, None)),
            2 => after(wait, host(HostRequest::Keep)),
            3 => after(wait, host(HostRequest::PutAway(dice.below(600) as u32))),
            4 => after(wait, host(HostRequest::PutAllAway)),
            5 => after(wait, host(HostRequest::Pause(self.jobs))),
            6 => after(wait, host(HostRequest::Resume(self.jobs))),
            7 | 8 => after(wait, host(HostRequest::Abort(*dice.pick(&[self.jobs, 0, 0])))),
            9 => self.job(dice),
            10 => after(wait, line(LineInput::Down(LinkDownReason::Unplugged))),
            11 => after(wait, says(&[dice.byte()])),
            12 => after(wait, host(HostRequest::ForceResume)),
            _ => after(self.about(now, dice), Given::Nothing),
        }
    }
}
