//! What a control says.

use super::Guess;
use crate::dice::Dice;
use crate::fanuc_rs232_remote::message::compose;
use crate::model::{Given, HostRequest, LineInput, Model, Proposal};
use crate::propose::{come, give, host, line};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros};
use std::collections::VecDeque;

impl Guess<'_> {
    /// A control that mostly does what it should, and a host that has a job for it.
    pub(super) fn control(&self, pieces: &mut VecDeque<Proposal>, dice: &mut Dice) -> Proposal {
        let Some(job) = &self.model.job else {
            return if dice.one_in(3) { self.control_speaks(dice) } else { self.job(dice) };
        };
        let message = match dice.below(40) {
            0..=4 => return self.control_speaks(dice),
            5 | 6 => return self.nothing(dice),
            8 if !self.model.wire.is_empty() => {
                // As what we say leaves.
                return host(dice.between(1, self.until_left()), HostRequest::Abort(job.id));
            }
            9 if self.model.dialogue.bad > 0 || self.model.dialogue.repeats > 0 => {
                return line(self.pause(dice), LineInput::Down(LinkDownReason::Unplugged));
            }
            7 => return self.burst(dice),
            _ if self.model.dialogue.awaits_rdy => self.usual("RDY", "SYN", dice),
            _ if job.is_paused => self.usual("GTD", "SAT", dice),
            _ if job.is_ended => self.usual("GTD", "SAT", dice),
            _ => self.usual("GTD", "RTY", dice),
        };
        let wait = self.pause(dice);
        if dice.one_in(5) {
            return self.in_pieces(wait, message, pieces, dice);
        }
        come(wait, message)
    }

    /// A control that does what it should, and a host that has a small job for it.
    pub(super) fn good(&self, dice: &mut Dice) -> Proposal {
        let wait = self.until_left() + dice.between(1, 2_000);
        let Some(job) = &self.model.job else {
            let (id, kind, fields) = (self.model.jobs + 1, "send".to_owned(), Vec::new());
            return host(wait, HostRequest::Job { id, kind, fields, data: b"%\nM30\n%".to_vec() });
        };
        if job.is_paused {
            return host(wait, HostRequest::Resume(job.id));
        }
        let command = if self.model.dialogue.awaits_rdy { "RDY" } else { "GTD" };
        come(wait, self.on_the_line(&compose(command, b"", self.model.rules.end)))
    }

    /// Anything that a control could say, good or bad.
    pub(super) fn control_speaks(&self, dice: &mut Dice) -> Proposal {
        // Polite ones wait until we have spoken.
        let wait = if dice.one_in(6) { self.within(dice) } else { self.pause(dice) };
        if self.is_short_of_room() && wait <= self.until_left() {
            return give(self.until_left() + 1, Given::Nothing);
        }
        match dice.below(20) {
            0..=11 => come(wait, self.any(dice)),
            12..=15 => come(wait, self.bad(dice)),
            16 | 17 => self.damaged(wait, dice),
            18 => come(wait, vec![*dice.pick(crate::fanuc_rs232::SPECIAL)]),
            _ => come(wait, (0..dice.length(600)).map(|_| dice.byte()).collect()),
        }
    }

    /// Whether an answer could find no room, as we have not said all.
    fn is_short_of_room(&self) -> bool {
        !self.model.wire.is_empty() && self.model.wire.capacity() < 4_000
    }

    fn usual(&self, command: &str, other: &str, dice: &mut Dice) -> Vec<u8> {
        let command = if dice.one_in(8) { other } else { command };
        self.on_the_line(&compose(command, b"", self.model.rules.end))
    }

    fn any(&self, dice: &mut Dice) -> Vec<u8> {
        let all = ["SYN", "RDY", "GTD", "GTD", "SAT", "RST", "ALM", "RTY", "RTY", "RTY"];
        let command = *dice.pick(&all);
        let long = "8".repeat(dice.between(200, 300) as usize);
        let data: &[&str] = match command {
            "RTY" => &["1", "", "2", "77"],
            "SAT" => &["", "00", "A\0\x11\n B", "0123456789", long.as_str()],
            _ => &["", "", "", "X"],
        };
        let data = dice.pick(data).as_bytes();
        let mut message = self.on_the_line(&compose(command, data, self.model.rules.end));
        if dice.one_in(10) {
            // Control characters before a message.
            let before = *dice.pick(&["\n", "\0\0", "\x11", "\r", "\x03"]);
            message.splice(0..0, self.on_the_line(before.as_bytes()));
        }
        message
    }

    /// What is no message, or one that does not exist.
    fn bad(&self, dice: &mut Dice) -> Vec<u8> {
        let end = self.model.rules.end;
        let message = match dice.below(8) {
            0 => {
                let all = ["XYZ", "DAT", "WAT", "EOD", "SET", "gtd", "CLB", "SDI", "G\0T"];
                let command = *dice.pick(&all);
                compose(command, b"", end)
            }
            1 => {
                let short = *dice.pick(&["", "G", "GT", "G\0"]);
                compose(short, b"", end)
            }
            2 => vec![*dice.pick(b"X0 \x7F"), end],
            3 => {
                let mut message = compose("GTD", b"", end);
                message.make_ascii_lowercase();
                message
            }
            _ => {
                let command = *dice.pick(&["GTD", "SAT", "RTY", "RST"]);
                let mut message = compose(command, b"", end);
                let last = message.len() - 1;
                let at = dice.below(last as u64) as usize;
                match dice.below(4) {
                    0 => drop(message.remove(at)),
                    1 => message.insert(at, message[at]),
                    2 => message[at] ^= 1 << dice.below(4),
                    _ => message.insert(at, dice.below(128) as u8),
                }
                message
            }
        };
        self.on_the_line(&message)
    }

    fn damaged(&self, wait: i64, dice: &mut Dice) -> Proposal {
        let read = [LineErrorKind::Parity, LineErrorKind::Framing, LineErrorKind::ParityOrFraming];
        let (kind, byte) = if dice.one_in(3) {
            (*dice.pick(&[LineErrorKind::Overrun, LineErrorKind::Break]), None)
        } else {
            (*dice.pick(&read), Some(*dice.pick(&[self.model.rules.end, b'G', 0, b'\n', 0x8D])))
        };
        line(wait, LineInput::Damaged { kind, byte, span: 0 })
    }

    /// Several messages at one time.
    fn burst(&self, dice: &mut Dice) -> Proposal {
        let mut messages = Vec::new();
        for _ in 0..dice.between(1, 2) {
            let message = if dice.one_in(5) { self.bad(dice) } else { self.any(dice) };
            // What comes behind a GTD is not judged.
            if self.model.job.is_none() || !message.contains(&b'G') {
                messages.extend(message);
            }
        }
        messages.extend(self.any(dice));
        let room = self.model.wire.capacity() >= 4_000 || self.model.wire.is_empty();
        let wait = if room && dice.one_in(2) { self.within(dice) } else { self.pause(dice) };
        come(wait, messages)
    }

    /// A message that takes its time.
    fn in_pieces(
        &self,
        wait: i64,
        message: Vec<u8>,
        pieces: &mut VecDeque<Proposal>,
        dice: &mut Dice,
    ) -> Proposal {
        let mut rest = message;
        while rest.len() > 1 {
            let behind = rest.split_off(dice.between(1, rest.len() as i64) as usize);
            let wait = if dice.one_in(12) {
                self.model.rules.poll_time.0 + dice.between(-1, 1)
            } else {
                dice.between(1, self.model.line.characters(4).0)
            };
            pieces.push_back(come(wait, std::mem::replace(&mut rest, behind)));
        }
        if !rest.is_empty() {
            pieces.push_back(come(dice.between(1, 9_000), rest));
        }
        let first = pieces.pop_front().unwrap_or(give(wait, Given::Nothing));
        Proposal { wait: Micros(wait.max(1)), ..first }
    }

    /// Time goes by, often until something is due.
    fn nothing(&self, dice: &mut Dice) -> Proposal {
        let wait = match self.model.next() {
            Some(deadline) if dice.one_in(4) => (deadline - self.now).0,
            _ => self.pause(dice),
        };
        give(wait, Given::Nothing)
    }
}
