//! What a partner and a host could do next.

use super::code::encode;
use super::packet::{CR, SOH, packet};
use super::send::{Sending, Stage};
use super::{Kermit, State};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use softplug_abi::{Failure, LineErrorKind, LinkDownReason, Micros};

pub(super) fn propose(own: &Kermit, now: Micros, dice: &mut Dice) -> Proposal {
    if !own.is_open {
        return after(dice.between(1, 3_000_000), host(HostRequest::Open));
    }
    if own.is_down && !dice.one_in(4) {
        return after(dice.between(1, 20_000_000), line(LineInput::Up));
    }
    if dice.one_in(30) {
        return own.rare(now, dice);
    }
    if own.hearing.is_some() && dice.one_in(2) {
        return own.in_packet(now, dice);
    }
    match &own.state {
        State::Sending(sending) => own.sending(now, sending, dice),
        State::Idle => own.idle(now, dice),
        State::AwaitFile => own.receiving(now, dice, false),
        State::AwaitData => own.receiving(now, dice, true),
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

/// A time that people or machines take.
fn pause(dice: &mut Dice) -> i64 {
    match dice.below(8) {
        0 => dice.between(1, 1_000),
        1 => dice.between(1, 900_000),
        2 => dice.between(1, 4_000_000),
        _ => dice.between(1, 60_000),
    }
}

/// Bytes of a file: programs, runs, bytes that need prefixes.
fn data(length: usize, dice: &mut Dice) -> Vec<u8> {
    const SPECIAL: &[u8] = b"\x00\x01\x0A\x0D\x0D\x0A#&~!\x7F\x80\x8D\xA3\xA6\xFE\xFFAAAA";
    match dice.below(5) {
        0 => (0..length).map(|_| dice.byte()).collect(),
        1 => (0..length).map(|_| *dice.pick(SPECIAL)).collect(),
        2 => {
            let mut bytes = Vec::new();
            while bytes.len() < length {
                let byte = *dice.pick(SPECIAL);
                bytes.extend(vec![byte; dice.between(1, 120) as usize]);
            }
            bytes.truncate(length);
            bytes
        }
        3 => b"N10 G1 X-20.5\r\nM3\r\r\n".iter().copied().cycle().take(length).collect(),
        _ => b"N10 G1 X-20.5\n".iter().copied().cycle().take(length).collect(),
    }
}

/// What the other side says of itself.
fn fields(dice: &mut Dice) -> Vec<u8> {
    let mut fields = vec![
        *dice.pick(b"~~~4 I"),
        b'%',
        *dice.pick(b"   !#\x7F"),
        *dice.pick(b"@@?A"),
        *dice.pick(b"----* >"),
        *dice.pick(b"####$P"),
        *dice.pick(b"YYN&&!#P "),
        *dice.pick(b"123333B"),
        *dice.pick(b"~~~ !&"),
        *dice.pick(b"\"\"\" *("),
        b' ',
    ];
    if dice.one_in(8) {
        fields.insert(9, *dice.pick(b"#!"));
    }
    fields.extend(dice.pick(&[*b"*R", *b"!9", *b" 1", *b"%0"]));
    if dice.one_in(4) {
        fields.truncate(dice.below(14) as usize);
    }
    fields
}

impl Kermit {
    /// A tick before, at, or after what is due; or, if nothing is, soon.
    fn about(&self, now: Micros, dice: &mut Dice) -> i64 {
        let wait = self.deadline().map_or(1_000, |deadline| (deadline - now).0);
        // S goes again all the while.
        let is_first = matches!(&self.state, State::Sending(sending) if sending.kind == b'S');
        wait.min(if is_first { 25_000_000 } else { i64::MAX - 1 }) + dice.between(-1, 1)
    }

    fn characters(&self, count: usize) -> i64 {
        self.rules.line.characters(count as u64).0
    }

    /// One event with all of it after the time it takes; now and then something happens to it.
    fn spoken(&self, wait: i64, mut all: Vec<u8>, dice: &mut Dice) -> Proposal {
        if !dice.one_in(12) {
            all.push(CR);
        }
        let place = dice.below(all.len() as u64) as usize;
        match dice.below(24) {
            0 => all.truncate(place + 1),
            1 => _ = all.remove(place),
            2 => all.insert(place, all[place]),
            3 => all[place] ^= 1 << dice.below(7),
            4 => all.insert(place, *dice.pick(&[SOH, CR, b' '])),
            5 => all.extend_from_within(..),
            _ => {}
        }
        if self.rules.is_narrow() {
            for byte in &mut all {
                *byte &= 127;
            }
        }
        let wait = wait + self.characters(all.len());
        if all.is_empty() {
            return after(wait, Given::Nothing);
        }
        after(wait, line(LineInput::Bytes(all)))
    }

    fn says_as_agreed(&self, kind: u8, number: u8, data: &[u8]) -> Vec<u8> {
        packet(kind, number, data, self.agreed.check, 94)
    }

    fn first(kind: u8, dice: &mut Dice) -> Vec<u8> {
        packet(kind, 0, &fields(dice), 1, 94)
    }

    fn data_packet(&self, number: u8, dice: &mut Dice) -> Vec<u8> {
        let bytes = data(dice.between(0, 200) as usize, dice);
        let long = if dice.one_in(3) { 300 } else { 80 };
        let (characters, _) = encode(&bytes, &self.agreed, long);
        let most = if dice.one_in(6) { 0 } else { 94 };
        packet(b'D', number, &characters, self.agreed.check, most)
    }

    fn receiving(&self, now: Micros, dice: &mut Dice, is_inside: bool) -> Proposal {
        let next = self.expected_number;
        let before = (next + 63) % 64;
        let wait = pause(dice);
        let spoken = match dice.below(32) {
            0..=17 if is_inside => self.data_packet(next, dice),
            18..=20 if is_inside => self.says_as_agreed(b'Z', next, b""),
            0..=12 => {
                const NAMES: &[&str] = &[
                    "O1.NC",
                    "C:/a\\O2",
                    "",
                    "~%x/~&y",
                    "a#Gb#",
                    "&A&#J~",
                    "_N_SHAFT_MPF",
                    "%O0015",
                ];
                self.says_as_agreed(b'F', next, dice.pick(NAMES).as_bytes())
            }
            13..=20 => self.says_as_agreed(b'B', next, b""),
            21 => self.says_as_agreed(self.latest, before, b""),
            22 => {
                self.says_as_agreed(*dice.pick(b"FADZBXI"), next, dice.pick(&["", "D"]).as_bytes())
            }
            23 => self.says_as_agreed(*dice.pick(b"FADZB"), dice.below(64) as u8, b"D"),
            24 => self.says_as_agreed(b'A', next, b"!5"),
            25 => self.says_as_agreed(*dice.pick(b"YN"), dice.below(64) as u8, b""),
            26 if dice.one_in(3) => Self::first(b'S', dice),
            27 if dice.one_in(3) => self.says_as_agreed(b'E', next, b"no"),
            28 => return self.job(dice),
            29 => self.says_as_agreed(b'D', next, dice.pick(&["A#", "~", "&", "~ A"]).as_bytes()),
            30 => return self.spoken(self.about(now, dice), vec![SOH], dice),
            _ => return after(self.about(now, dice), Given::Nothing),
        };
        self.spoken(wait, spoken, dice)
    }

    fn in_packet(&self, now: Micros, dice: &mut Dice) -> Proposal {
        match dice.below(4) {
            0 => after(self.about(now, dice), line(LineInput::Bytes(vec![CR]))),
            1 => after(self.about(now, dice), line(LineInput::Bytes(vec![b'x']))),
            2 => after(self.about(now, dice), Given::Nothing),
            _ => after(pause(dice), line(LineInput::Bytes(vec![*dice.pick(&[CR, SOH, b'A'])]))),
        }
    }

    fn idle(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        if let Some(id) = self.request
            && dice.one_in(2)
        {
            let refused = *dice.pick(&[Failure::NotFound, Failure::Denied]);
            let answer = if dice.one_in(2) { Ok(Vec::new()) } else { Err(refused) };
            return after(wait, host(HostRequest::Answer(id, answer)));
        }
        if self.granted.is_some() && dice.one_in(3) {
            return self.job(dice);
        }
        let ended = self.ended.as_ref().map_or(0, |(number, _)| *number);
        let check = self.ended.as_ref().map_or(1, |(_, agreed)| agreed.check);
        let spoken = match dice.below(20) {
            0..=6 => Self::first(b'S', dice),
            7 => Self::first(b'I', dice),
            8 | 9 => {
                const NAMES: &[&str] = &["O1.NC", "C:/a\\O2", "", "~%x", "&A"];
                packet(b'R', 0, dice.pick(NAMES).as_bytes(), 1, 94)
            }
            10 => packet(*dice.pick(b"GCK"), dice.below(64) as u8, b"F", 1, 94),
            11 => packet(b'B', ended, b"", check, 94),
            12 => self.says_as_agreed(*dice.pick(b"FADZBXYNE"), dice.below(64) as u8, b"x"),
            13 if dice.one_in(4) => return after(wait, host(HostRequest::Close)),
            13 | 14 => return after(self.about(now, dice), Given::Nothing),
            _ => return self.job(dice),
        };
        self.spoken(wait, spoken, dice)
    }

    fn job(&self, dice: &mut Dice) -> Proposal {
        let length = match dice.below(10) {
            0 => 0,
            1 => dice.between(1_025, 20_000) as usize,
            2 | 3 => dice.between(900, 1_100) as usize,
            _ => dice.between(1, 300) as usize,
        };
        let mut data = data(length, dice);
        if self.rules.is_narrow() && !dice.one_in(4) {
            for byte in &mut data {
                *byte &= 127;
            }
        }
        let long = "x".repeat(dice.between(60, 66) as usize);
        let names = [
            "O1.NC",
            "A#~&",
            "",
            "0123456789012345678",
            "Ä",
            "_N_SHAFT_MPF",
            "_N_DRILL_2_SPF",
            &long,
        ];
        let fields = match dice.below(3) {
            0 => vec![("name".to_owned(), (*dice.pick(&names)).to_owned())],
            _ => Vec::new(),
        };
        let kind = "send".to_owned();
        after(pause(dice), host(HostRequest::Job { id: self.jobs + 1, kind, fields, data }))
    }

    fn sending(&self, now: Micros, sending: &Sending, dice: &mut Dice) -> Proposal {
        let own = sending.number;
        let answer = if sending.kind == b'S' {
            Self::first(b'Y', dice)
        } else {
            self.says_as_agreed(b'Y', own, b"")
        };
        let wait = pause(dice);
        match sending.stage {
            Stage::Paused => match dice.below(4) {
                0 => self.spoken(wait, answer, dice),
                1 => after(wait, host(HostRequest::Abort(self.jobs))),
                _ => after(wait, host(HostRequest::Resume(self.jobs))),
            },
            Stage::Leaving(place) => {
                let rest = self.characters(self.out.remaining(place) as usize);
                let early = dice.between(1, rest.max(1));
                match dice.below(16) {
                    0 => after(early, line(LineInput::Bytes([&answer[..], &[CR]].concat()))),
                    1 => after(early, host(HostRequest::Abort(self.jobs))),
                    2 => after(early, host(HostRequest::Pause(self.jobs))),
                    3 => after(early, line(LineInput::Bytes(vec![SOH, b'#']))),
                    _ => self.spoken(rest + wait, answer, dice),
                }
            }
            Stage::Answer => {
                let next = (own + 1) % 64;
                let spoken = match dice.below(28) {
                    0 | 1 => packet(b'N', own, b"", dice.between(1, 3) as usize, 94),
                    2 => packet(b'N', next, b"", self.agreed.check, 94),
                    3 => self.says_as_agreed(b'Y', dice.below(64) as u8, b""),
                    4 => self.says_as_agreed(b'Y', own, dice.pick(&["X", "Z", "A"]).as_bytes()),
                    5 if dice.one_in(2) => self.says_as_agreed(b'E', own, b"no"),
                    6 => Self::first(b'S', dice),
                    7 => sending.packet.clone(),
                    8 => {
                        let ended = self.ended.as_ref();
                        let (number, check) = ended.map_or((0, 1), |(n, own)| (*n, own.check));
                        packet(b'B', number, b"", check, 94)
                    }
                    9 => return after(self.about(now, dice), Given::Nothing),
                    10 => return self.spoken(self.about(now, dice), answer, dice),
                    11 => return after(wait, host(HostRequest::Abort(self.jobs))),
                    _ => answer,
                };
                self.spoken(wait, spoken, dice)
            }
        }
    }

    /// What a host does now and then, and what happens to any line.
    fn rare(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        let damaged = |kind, byte| line(LineInput::Damaged { kind, byte, span: 0 });
        match dice.below(14) {
            0 => after(wait, damaged(LineErrorKind::Framing, Some(b'A'))),
            1 => after(wait, damaged(LineErrorKind::Overrun, None)),
            2 => after(wait, host(HostRequest::Keep)),
            3 => after(wait, host(HostRequest::PutAway(dice.below(600) as u32))),
            4 => after(wait, host(HostRequest::PutAllAway)),
            5 => after(wait, host(HostRequest::Pause(self.jobs))),
            6 => after(wait, host(HostRequest::Resume(self.jobs))),
            7 | 8 => after(wait, host(HostRequest::Abort(*dice.pick(&[self.jobs, 0, 0])))),
            9 => self.job(dice),
            10 => after(wait, line(LineInput::Down(LinkDownReason::Unplugged))),
            11 => after(wait, line(LineInput::Bytes(vec![dice.byte()]))),
            12 => after(wait, host(HostRequest::ForceResume)),
            _ => after(self.about(now, dice), Given::Nothing),
        }
    }
}
