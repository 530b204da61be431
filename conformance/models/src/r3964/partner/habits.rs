//! Partners that do the same for a whole session: they bring counters and sums to their
//! ends.

use super::{Next, Upper, bytes, host, nothing};
use crate::dice::Dice;
use crate::model::{HostRequest, Proposal};
use crate::r3964::Station;
use crate::r3964::frame::{DLE, NAK, STX};
use crate::r3964::state::State;
use softplug_abi::Micros;

/// Attempts from which on a partner may go on failing in the same way.
const MANY: i64 = 100;
/// Characters of blocks that come in one read.
const READ: usize = 1_000;
/// Blocks of a long session.
const BLOCKS: u32 = 24_000;

/// What a partner does for a whole session.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Habit {
    /// Now this, now that.
    Any,
    /// Something very long is to be begun.
    BeginsLong,
    /// It is under way, and all is acknowledged.
    IsLong,
    /// So many blocks, one way or the other, and all is acknowledged.
    ManyBlocks(u32),
    /// A block of each length each way, all acknowledged; so many were begun.
    EveryLength(usize),
    /// No STX of ours is answered.
    Silent,
    /// Each STX of ours is refused.
    RefusesSetUps,
    /// Each block of ours is refused.
    RefusesBlocks,
    /// Each block of the partner is bad.
    SendsBadBlocks,
}

impl Habit {
    /// Of a long session.
    pub(super) fn filling(station: &Station, upper: &dyn Upper, number: u64) -> Self {
        if number.is_multiple_of(4) && upper.is_plain() {
            Self::EveryLength(0)
        } else if number % 2 == 1 && upper.long_ones(station) > 0 {
            Self::BeginsLong
        } else {
            Self::ManyBlocks(BLOCKS)
        }
    }

    /// One that brings a count to its end.
    pub(super) fn failing(dice: &mut Dice) -> Self {
        *dice.pick(&[Self::Silent, Self::RefusesSetUps, Self::RefusesBlocks, Self::SendsBadBlocks])
    }

    pub(super) fn draw(station: &Station, upper: &dyn Upper, dice: &mut Dice) -> Self {
        let parameters = &station.parameters;
        let rarity = upper.long_ones(station);
        if rarity > 0 && dice.one_in(rarity) {
            return Self::BeginsLong;
        }
        if parameters.setup_attempts >= MANY && dice.one_in(4) {
            return *dice.pick(&[Self::Silent, Self::RefusesSetUps]);
        }
        if parameters.transmission_attempts >= MANY && dice.one_in(3) {
            return *dice.pick(&[Self::RefusesBlocks, Self::SendsBadBlocks]);
        }
        Self::Any
    }
}

impl Next<'_> {
    /// Whether the habit says what comes next.
    pub(super) fn has_habit(&mut self) -> bool {
        let next = match self.mood.habit {
            Habit::Any => None,
            Habit::Silent | Habit::RefusesSetUps | Habit::RefusesBlocks if self.is_free() => {
                self.failing_job()
            }
            Habit::ManyBlocks(left) if matches!(self.station.state, State::Idle) => {
                self.next_block(left);
                return true;
            }
            Habit::EveryLength(begun) if matches!(self.station.state, State::Idle) => {
                self.next_length(begun);
                return true;
            }
            Habit::BeginsLong | Habit::IsLong | Habit::ManyBlocks(_) | Habit::EveryLength(_) => {
                self.long()
            }
            Habit::Silent => self.silence(),
            Habit::RefusesSetUps => self.refused_set_up(),
            Habit::RefusesBlocks => self.refused_block(),
            Habit::SendsBadBlocks => return self.bad_block(),
        };
        let is_said = next.is_some();
        self.plan.extend(next);
        is_said
    }

    fn is_free(&self) -> bool {
        matches!(self.station.state, State::Idle) && self.station.job.is_none()
    }

    /// A job for it, or the end of the habit.
    fn failing_job(&mut self) -> Option<Proposal> {
        if self.dice.one_in(3) {
            self.mood.habit = Habit::Any;
            return None;
        }
        let wait = self.a_while();
        self.upper.short_job(self.station, self.dice).map(|job| host(wait, job))
    }

    fn a_while(&mut self) -> i64 {
        self.dice.between(1, 2_000)
    }

    fn long(&mut self) -> Option<Proposal> {
        let wait = self.a_while();
        let end = self.until_quiet();
        let handshake = self.station.parameters.handshake;
        Some(match self.station.state {
            State::Idle if self.mood.habit == Habit::BeginsLong => {
                self.mood.habit = Habit::IsLong;
                self.upper.begin_long(self.station, self.dice)
            }
            State::Idle if !self.upper.is_long_under_way(self.station) => {
                self.mood.habit = Habit::Any;
                return None;
            }
            State::Idle => self.upper.go_on(self.station, self.dice),
            State::WaitingForDle { qvz: Some(_), .. } | State::WaitingForAcknowledgement { .. } => {
                bytes(wait, &[DLE])
            }
            State::WaitingForDle { .. } => nothing(end.max(1)),
            State::Sending { .. } => bytes(end + wait, &[DLE]),
            State::Granting { .. } | State::Receiving { .. } => {
                let is_begun = self.station.reception.as_ref();
                if is_begun.is_some_and(|known| known.incoming.characters() > 0) {
                    // Disturbed: it is given up.
                    return Some(nothing(self.station.parameters.zvz.0));
                }
                let data = match self.mood.habit {
                    Habit::ManyBlocks(_) => self.upper.block(self.station, false, self.dice),
                    Habit::EveryLength(begun) => {
                        let length = begun.saturating_sub(1) / 2;
                        super::data(length.min(self.station.limit()), self.dice)
                    }
                    _ => self.upper.good_block(self.station, self.dice),
                };
                let wait = if handshake { end + wait } else { 1 };
                bytes(wait, &self.station.framed(&data))
            }
            State::WaitingForRepetition { .. } => bytes(end + wait, &[STX]),
            state => {
                let deadline = state.deadline().unwrap_or(self.now);
                nothing((deadline - self.now).0.max(1))
            }
        })
    }

    /// A short job, a block of the partner, or what the layer needs to go on.
    fn next_block(&mut self, left: u32) {
        self.mood.habit = left.checked_sub(1).map_or(Habit::Any, Habit::ManyBlocks);
        let wait = self.a_while();
        if let Some(proposals) = self.upper.in_idle(self.now, wait, self.dice) {
            return self.plan.extend(proposals);
        }
        if self.station.job.is_some() {
            return self.push(host(wait, HostRequest::Resume(self.station.jobs)));
        }
        if self.dice.one_in(2) {
            let job = self.upper.short_job(self.station, self.dice);
            return self.plan.extend(job.map(|job| host(wait, job)));
        }
        let mut all = vec![STX];
        if !self.station.parameters.handshake {
            all.extend(self.small_block(false));
        }
        self.push(bytes(wait, &all));
    }

    /// Our block of a length, then the partner's.
    fn next_length(&mut self, begun: usize) {
        let wait = self.a_while();
        let length = begun / 2;
        let id = self.station.jobs;
        if self.station.job.is_some() {
            return self.push(host(wait, HostRequest::Resume(id)));
        }
        if length > self.station.limit() {
            self.mood.habit = Habit::Any;
            return self.push(nothing(wait));
        }
        self.mood.habit = Habit::EveryLength(begun + 1);
        let data = super::data(length, self.dice);
        if begun.is_multiple_of(2) {
            let (id, kind, fields) = (id + 1, "send".to_owned(), Vec::new());
            return self.push(host(wait, HostRequest::Job { id, kind, fields, data }));
        }
        let mut all = vec![STX];
        if !self.station.parameters.handshake {
            all.extend(self.station.framed(&data));
        }
        self.push(bytes(wait, &all));
    }

    /// One step can be hundreds of attempts.
    fn silence(&mut self) -> Option<Proposal> {
        let State::WaitingForDle { .. } = self.station.state else { return None };
        let attempts = self.dice.between(1, 300);
        let qvz = self.station.parameters.qvz.0 + 3 * self.character();
        Some(nothing(attempts * qvz))
    }

    fn refused_set_up(&mut self) -> Option<Proposal> {
        let State::WaitingForDle { qvz, .. } = self.station.state else { return None };
        let wait = self.a_while().min(self.station.parameters.qvz.0).max(1);
        Some(match qvz {
            Some(_) => bytes(wait, &[NAK]),
            None => nothing(self.until_quiet().max(1)),
        })
    }

    fn refused_block(&mut self) -> Option<Proposal> {
        let wait = self.a_while().min(self.station.parameters.qvz.0).max(1);
        Some(match self.station.state {
            State::WaitingForDle { qvz: Some(_), .. } => bytes(wait, &[DLE, NAK]),
            State::WaitingForDle { .. } => nothing(self.until_quiet().max(1)),
            // Without handshake one step can be hundreds of attempts.
            State::Sending { .. } if self.dice.one_in(8) => {
                let attempts = self.dice.between(1, 300);
                nothing(attempts * (self.station.parameters.qvz.0 + self.until_quiet()))
            }
            State::Sending { .. } | State::WaitingForAcknowledgement { .. } => bytes(wait, &[NAK]),
            _ => return None,
        })
    }

    fn bad_block(&mut self) -> bool {
        let wait = self.a_while();
        let handshake = self.station.parameters.handshake;
        let is_paused = self.station.job.is_some();
        match self.station.state {
            State::Idle if is_paused => return false,
            State::Idle if self.dice.one_in(4) => {
                self.mood.habit = Habit::Any;
                return false;
            }
            State::Idle | State::WaitingForRepetition { .. } if handshake => {
                self.push(bytes(wait, &[STX]));
            }
            State::Idle | State::WaitingForRepetition { .. } => self.many_blocks(wait, true),
            State::Granting { .. } => {
                let mut all = self.small_block(true);
                // Its repetition is announced with it.
                if !self.dice.one_in(4) {
                    all.push(STX);
                }
                let end = self.until_quiet();
                self.push(bytes(end + wait, &all));
            }
            _ => return false,
        }
        true
    }

    fn small_block(&mut self, is_bad: bool) -> Vec<u8> {
        let length = self.dice.below(4) as usize;
        let data = super::data(length.min(self.station.limit()), self.dice);
        let mut all = self.station.framed(&data);
        match all.last_mut() {
            Some(check) if is_bad && self.station.parameters.bcc => *check ^= 0x42,
            _ if is_bad => drop(all.splice(..0, [DLE, b'A'])),
            _ => {}
        }
        all
    }

    /// A partner that does not wait for answers either: many blocks in one read.
    pub(super) fn many_blocks(&mut self, wait: i64, are_bad: bool) {
        let most = self.dice.between(10, READ as i64) as usize;
        let rarity = *self.dice.pick(&[2, 10, 1_000]);
        let mut all = Vec::new();
        while all.len() < most {
            all.push(STX);
            let is_bad = are_bad || self.dice.one_in(rarity);
            all.extend(self.small_block(is_bad));
        }
        self.push(bytes(wait, &all));
        let later = self.until_quiet() + Micros::from_millis(1).0;
        self.push(nothing(later));
    }
}
