//! What a machine and a host could do next.

use super::XonXoff;
use super::rules::ControlInData;
use crate::dice::Dice;
use crate::model::{Conditions, Given, HostRequest, LineInput, Model, Proposal};
use crate::propose::{Pace, come, give, host, line};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros, ModemLines};

/// What a session is about.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Plan {
    /// Nothing has been proposed yet.
    Open,
    /// All that a line brings.
    Usual,
    /// One job of so many bytes, at first.
    LargeJob(u32),
    /// It has this id.
    Waits(u32),
    /// So many jobs on one link.
    ManyJobs(u32),
    /// So many deliveries on one link.
    ManyDeliveries(u32),
    /// A large delivery: so many bytes are to come.
    LargeDelivery(u32),
    /// A machine that sends so many bytes, whatever it is told.
    Deaf(u32),
}

impl Plan {
    pub(super) fn new(conditions: &Conditions) -> Self {
        match conditions.long.map(|number| number % 4) {
            None if conditions.is_usual => Self::Usual,
            None => Self::Open,
            Some(0) => Self::ManyJobs(20_000),
            Some(1) => Self::LargeDelivery(5_000_000),
            Some(2) => Self::ManyDeliveries(20_000),
            Some(_) => Self::LargeJob(2_500_000),
        }
    }

    /// Whatever counts in a byte or two comes to its end.
    fn draw(xoff_repeat: usize, dice: &mut Dice) -> Self {
        if xoff_repeat > 300 && dice.one_in(16) {
            return Self::Deaf(2 * xoff_repeat as u32 + 10_000);
        }
        match dice.below(120) {
            0..=1 => Self::LargeJob(dice.between(66_000, 140_000) as u32),
            2..=5 => Self::ManyJobs(300),
            6..=9 => Self::ManyDeliveries(300),
            10..=12 => Self::LargeDelivery(dice.between(66_000, 140_000) as u32),
            _ => Self::Usual,
        }
    }
}

/// The next step of a random session.
pub(super) fn next(model: &XonXoff, now: Micros, dice: &mut Dice) -> Proposal {
    let guess = Guess { model, now };
    if !model.is_open {
        return host(dice.between(1, 3_000_000), HostRequest::Open);
    }
    if model.is_down {
        return guess.while_down(dice);
    }
    if let Some(proposal) = guess.planned(dice) {
        return proposal;
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
    /// What the session is about; `None`: nothing in particular, any more.
    fn planned(&self, dice: &mut Dice) -> Option<Proposal> {
        let plan = &self.model.plan;
        if plan.get() == Plan::Open {
            plan.set(Plan::draw(self.model.rules.xoff_repeat, dice));
        }
        let known = self.model.receiver.room.known();
        match plan.get() {
            Plan::LargeJob(length) => {
                plan.set(Plan::Waits(self.model.jobs + 1));
                Some(self.send(length as usize, dice))
            }
            Plan::Waits(job) if self.model.sender.job() == Some(job) => {
                Some(self.wait_for(job, 20_000, dice))
            }
            Plan::ManyJobs(count) if self.model.jobs < count => {
                Some(match self.model.sender.job() {
                    Some(job) => self.wait_for(job, 4, dice),
                    None => self.send(dice.between(1, 3) as usize, dice),
                })
            }
            Plan::ManyDeliveries(count) if self.model.receiver.deliveries() < count => {
                let wait = self.characters(1);
                Some(match self.model.receiver.deadline(&self.model.rules) {
                    Some(end) => give((end - self.now).0, Given::Nothing),
                    None if dice.one_in(2) => host(wait, HostRequest::Abort(0)),
                    None => come(wait, vec![b'A']),
                })
            }
            // The host is slow now and then.
            Plan::LargeDelivery(_) if dice.one_in(24) => Some(self.burst(dice)),
            Plan::LargeDelivery(_)
                if dice.one_in(if self.model.receiver.speaker.is_stopped() { 2 } else { 24 }) =>
            {
                Some(self.room(dice))
            }
            Plan::LargeDelivery(left) if left > 0 && known <= 1 => Some(self.room(dice)),
            Plan::LargeDelivery(left) if left > 0 => {
                let count = left.min(known / 2).min(9_000);
                plan.set(Plan::LargeDelivery(left - count));
                Some(come(dice.between(1, 500), self.sent(count as usize, dice)))
            }
            Plan::Deaf(_) if !self.model.receiver.room.keeps() => {
                Some(host(1_000, HostRequest::Keep))
            }
            Plan::Deaf(left) if left > 0 => {
                let count = left.min(dice.between(1, 9_000) as u32);
                plan.set(Plan::Deaf(left - count));
                let bytes = self.sent(count as usize, dice);
                Some(come(self.characters(bytes.len()), bytes))
            }
            _ => {
                plan.set(Plan::Usual);
                None
            }
        }
    }

    /// A job of so many bytes that can be sent.
    fn send(&self, length: usize, dice: &mut Dice) -> Proposal {
        let mut data = self.text(length, dice);
        data.retain(|byte| self.model.rules.control(*byte).is_none());
        let (id, kind, fields) = (self.model.jobs + 1, "send".to_owned(), Vec::new());
        host(self.characters(1), HostRequest::Job { id, kind, fields, data })
    }

    /// The job may go on; up to so many characters of time go by.
    fn wait_for(&self, job: u32, longest: i64, dice: &mut Dice) -> Proposal {
        let sender = &self.model.sender;
        if sender.is_held() || sender.is_waiting() {
            return come(self.characters(1), vec![self.model.rules.xon]);
        }
        if sender.is_paused() {
            return host(self.characters(1), HostRequest::Resume(job));
        }
        give(self.characters(dice.between(1, longest) as usize), Given::Nothing)
    }

    /// A program with a control byte that stands behind more than 65,536 lines.
    fn fault_far_behind(&self, dice: &mut Dice) -> Option<Vec<u8>> {
        let rules = &self.model.rules;
        if rules.transparent || rules.control_in_data != ControlInData::Refuse {
            return None;
        }
        let lines = vec![b'\n'; dice.between(65_530, 70_000) as usize];
        Some([lines, b"AB".to_vec(), vec![rules.xoff]].concat())
    }

    /// As many end marks as end a program, or one less or more.
    fn end_marks(&self, dice: &mut Dice) -> Vec<u8> {
        let rules = &self.model.rules;
        let count = rules.end_mark_count as i64 + dice.between(-1, 1);
        let mut marks = rules.end_mark.repeat(count as usize);
        if dice.one_in(4) {
            marks.pop();
        }
        marks
    }

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
            10 if !self.model.rules.end_mark.is_empty() => {
                let marks = self.end_marks(dice);
                come(self.characters(marks.len()), marks)
            }
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
        // Lost ones may be told with the one that came behind them.
        let read = [
            LineErrorKind::Parity,
            LineErrorKind::Framing,
            LineErrorKind::ParityOrFraming,
            LineErrorKind::Overrun,
        ];
        let (kind, byte) = if dice.one_in(2) {
            (*dice.pick(&read), Some(self.byte(dice)))
        } else {
            (*dice.pick(&[LineErrorKind::Overrun, LineErrorKind::Break]), None)
        };
        line(self.characters(1), LineInput::Damaged { kind, byte, span: 0 })
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
            0 if dice.one_in(3) => self.job(dice),
            0 => self.room(dice),
            1 => host(self.pause(dice), HostRequest::Close),
            _ => line(self.pause(dice), LineInput::Up),
        }
    }

    fn job(&self, dice: &mut Dice) -> Proposal {
        let longest = if dice.one_in(40) { 65_536 } else { 1_500 };
        let far = if dice.one_in(200) { self.fault_far_behind(dice) } else { None };
        let data = far.unwrap_or_else(|| self.program(dice.length(longest), dice));
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
            3 if rules.receive_drop.is_empty() => 0,
            3 => *dice.pick(&rules.receive_drop),
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
