//! What a machine and a host could do next.

use super::XonXoff;
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Model, Proposal};
use crate::propose::{Pace, come, give, host, line};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros, ModemLines};

/// The next step of a random session.
pub(super) fn next(model: &XonXoff, now: Micros, dice: &mut Dice) -> Proposal {
    let guess = Guess { model, now };
    if !model.is_open {
        return host(dice.between(1, 3_000_000), HostRequest::Open);
    }
    if model.is_down {
        return guess.while_down(dice);
    }
    match dice.below(100) {
        0..=1 => guess.rare(dice),
        2..=44 => guess.sending(dice),
        45..=89 => guess.receiving(dice),
        90..=96 => guess.room(dice),
        _ => guess.nothing(dice),
    }
}

/// What is known of the session.
struct Guess<'a> {
    model: &'a XonXoff,
    now: Micros,
}

impl Guess<'_> {
    /// A job, and what a machine does to whoever sends.
    fn sending(&self, dice: &mut Dice) -> Proposal {
        let sender = &self.model.sender;
        let Some(job) = sender.job() else {
            return match dice.below(10) {
                0 => come(self.pause(dice), vec![self.model.rules.xoff]),
                1..=2 => come(self.pause(dice), vec![self.model.rules.xon]),
                3 => host(self.pause(dice), HostRequest::ForceResume),
                _ => self.job(dice),
            };
        };
        let is_still = sender.is_held() || sender.is_waiting();
        if sender.is_paused() && !dice.one_in(3) {
            return host(self.pause(dice), HostRequest::Resume(job));
        }
        match dice.below(24) {
            0 => host(self.within(dice), HostRequest::Pause(job)),
            1 => host(self.within(dice), HostRequest::Resume(job)),
            2 => host(self.within(dice), HostRequest::Abort(job)),
            3 => host(self.within(dice), HostRequest::ForceResume),
            4 => self.job(dice),
            5..=7 => come(self.within(dice), self.controls(dice)),
            8..=17 if is_still => come(self.pause(dice), vec![self.control(true, dice)]),
            8..=14 => come(self.within(dice), vec![self.control(false, dice)]),
            _ => self.nothing(dice),
        }
    }

    /// Characters of a machine that sends.
    fn receiving(&self, dice: &mut Dice) -> Proposal {
        let receiver = &self.model.receiver;
        if receiver.speaker.is_stopped() && !dice.one_in(3) {
            // A machine that obeys.
            return self.room(dice);
        }
        let character = self.characters(1);
        match dice.below(30) {
            0..=1 => self.damaged(dice),
            2 => host(self.pause(dice), HostRequest::Abort(0)),
            3..=5 => self.nothing(dice),
            6..=9 => self.burst(dice),
            10..=14 => come(character, vec![self.byte(dice)]),
            15..=18 => come(dice.between(1, 2 * character), vec![self.byte(dice)]),
            _ => {
                let longest = if dice.one_in(20) { 8_000 } else { 200 };
                let bytes = self.sent(dice.length(longest), dice);
                come(self.characters(bytes.len()), bytes)
            }
        }
    }

    /// A damaged character, lost ones or a break.
    fn damaged(&self, dice: &mut Dice) -> Proposal {
        let read = [LineErrorKind::Parity, LineErrorKind::Framing, LineErrorKind::ParityOrFraming];
        let (kind, byte) = if dice.one_in(2) {
            (*dice.pick(&read), Some(self.byte(dice)))
        } else {
            (*dice.pick(&[LineErrorKind::Overrun, LineErrorKind::Break]), None)
        };
        line(self.characters(1), LineInput::Damaged { kind, byte })
    }

    /// As many characters as just reach a mark, or all room.
    fn burst(&self, dice: &mut Dice) -> Proposal {
        let known = i64::from(self.model.receiver.room.known());
        let mark = *dice.pick(&[self.model.receiver.low_mark, self.model.receiver.low_mark, 0]);
        let count = known - i64::from(mark) + dice.between(-2, 2);
        let bytes = self.sent(count.clamp(1, 9_000) as usize, dice);
        come(self.characters(bytes.len()), bytes)
    }

    /// The host keeps deliveries, or puts some away.
    fn room(&self, dice: &mut Dice) -> Proposal {
        let room = &self.model.receiver.room;
        let wait = self.pause(dice);
        if !room.keeps() {
            let request = if dice.one_in(3) { HostRequest::PutAllAway } else { HostRequest::Keep };
            return host(wait, request);
        }
        let to_mark = self.model.receiver.high_mark.saturating_sub(room.known());
        // Less would not be told.
        let step = room.step();
        let request = match dice.below(8) {
            0 => HostRequest::PutAllAway,
            1..=2 => HostRequest::PutAway(room.kept().max(step)),
            3..=5 => HostRequest::PutAway((to_mark + dice.below(3) as u32).max(step)),
            _ => HostRequest::PutAway(step + dice.length(1_000) as u32),
        };
        host(wait, request)
    }

    /// What may happen at any time, and seldom does.
    fn rare(&self, dice: &mut Dice) -> Proposal {
        let wait = self.within(dice);
        match dice.below(8) {
            0 => host(wait, HostRequest::Close),
            1 => {
                let reasons = [
                    LinkDownReason::Unplugged,
                    LinkDownReason::Disconnected,
                    LinkDownReason::Failed,
                ];
                line(wait, LineInput::Down(*dice.pick(&reasons)))
            }
            2 => line(wait, LineInput::ModemLines(ModemLines::CTS, ModemLines(0))),
            3 => line(wait, LineInput::ModemLines(ModemLines::CTS, ModemLines::CTS)),
            4 => give(3_600_000_000 * dice.between(1, 9), Given::Nothing),
            _ => give(dice.between(1, 100_000_000), Given::Nothing),
        }
    }

    fn while_down(&self, dice: &mut Dice) -> Proposal {
        match dice.below(5) {
            0 => self.room(dice),
            1 => host(self.pause(dice), HostRequest::Close),
            _ => line(self.pause(dice), LineInput::Up),
        }
    }

    fn job(&self, dice: &mut Dice) -> Proposal {
        let longest = if dice.one_in(40) { 65_536 } else { 1_500 };
        let data = self.program(dice.length(longest), dice);
        let (id, kind, fields) = (self.model.jobs + 1, "send".to_owned(), Vec::new());
        host(self.pause(dice), HostRequest::Job { id, kind, fields, data })
    }

    /// A program, mostly one that can be sent.
    fn program(&self, length: usize, dice: &mut Dice) -> Vec<u8> {
        let has_controls = self.model.rules.transparent || dice.one_in(6);
        let mut text = self.text(length, dice);
        if !has_controls {
            text.retain(|byte| self.model.rules.control(*byte).is_none());
        }
        text
    }

    /// Characters as machines and programs have them.
    fn text(&self, length: usize, dice: &mut Dice) -> Vec<u8> {
        let kind = dice.below(8);
        let ends: [&[u8]; 5] = [b"\n", b"\r\n", b"\r", b"\n\r\r", b"\n\r"];
        let end = *dice.pick(&ends);
        let mut text = Vec::new();
        while text.len() < length {
            match kind {
                0 => text.push(dice.byte()),
                1 => text.push(self.byte(dice)),
                2 => text.push(*dice.pick(b"\r\n\n\rA%")),
                3 => text.push(b' ' + dice.below(95) as u8),
                _ => {
                    match dice.below(6) {
                        0 => text.extend(b"%"),
                        1 => text.extend(&self.model.rules.end_mark),
                        2 => text.push(self.byte(dice)),
                        _ => text
                            .extend(format!("N{} G1 X{}", dice.below(999), dice.below(99)).bytes()),
                    }
                    text.extend(end);
                }
            }
        }
        text.truncate(length);
        text
    }

    /// What a machine sends; one that escapes does it right most of the time.
    fn sent(&self, length: usize, dice: &mut Dice) -> Vec<u8> {
        let rules = &self.model.rules;
        let text = self.text(length, dice);
        if !rules.transparent || dice.one_in(4) {
            return text;
        }
        let escaped = |byte| {
            if rules.is_escaped(byte) {
                vec![rules.escape, byte ^ rules.escape_xor]
            } else {
                vec![byte]
            }
        };
        let mut sent: Vec<u8> = text.into_iter().flat_map(escaped).collect();
        // It may be cut anywhere.
        sent.truncate(length);
        sent
    }

    /// One byte, often one that means something.
    fn byte(&self, dice: &mut Dice) -> u8 {
        let rules = &self.model.rules;
        match dice.below(8) {
            0 => rules.escape,
            1 => *dice.pick(&[rules.xon, rules.xoff]) ^ rules.escape_xor,
            2 => *rules.end_mark.first().unwrap_or(&b'%'),
            3 => *rules.receive_drop.first().unwrap_or(&0),
            4 => *dice.pick(b"\r\n"),
            5 => *dice.pick(super::values::SPECIAL),
            6 => dice.byte(),
            _ => b'A' + dice.below(26) as u8,
        }
    }

    /// XON or XOFF, now and then the other one.
    fn control(&self, is_xon: bool, dice: &mut Dice) -> u8 {
        let rules = &self.model.rules;
        let byte = if is_xon == dice.one_in(8) { rules.xoff } else { rules.xon };
        if rules.parity_mask == 0x7F && dice.one_in(2) { byte ^ 0x80 } else { byte }
    }

    /// Several control bytes of one time, maybe with data between.
    fn controls(&self, dice: &mut Dice) -> Vec<u8> {
        let count = dice.between(1, 6);
        let next = |_| {
            let is_xon = dice.one_in(2);
            if dice.one_in(5) { b'A' } else { self.control(is_xon, dice) }
        };
        (0..count).map(next).collect()
    }

    /// Time goes by, often until something is due.
    fn nothing(&self, dice: &mut Dice) -> Proposal {
        let wait = match self.model.next() {
            Some(deadline) if !dice.one_in(3) => (deadline - self.now).0,
            _ => self.pause(dice),
        };
        give(wait, Given::Nothing)
    }

    fn within(&self, dice: &mut Dice) -> i64 {
        self.pace().within(dice)
    }

    fn pause(&self, dice: &mut Dice) -> i64 {
        self.pace().pause(dice)
    }

    fn characters(&self, count: usize) -> i64 {
        self.pace().characters(count)
    }

    fn pace(&self) -> Pace {
        Pace { line: self.model.line, began: self.model.began, now: self.now }
    }
}
