//! The program's execution: it empties the buffer at its rate, with feed holds.

use std::collections::VecDeque;

use softplug_abi::Micros;

/// How full the buffer is, and how it drains.
#[derive(Debug)]
pub(super) struct Execution {
    rate: u32,
    /// Feed holds that are still to come: position and length.
    pauses: VecDeque<(u64, Micros)>,
    state: State,
    level: usize,
    consumed: u64,
    starved: u32,
    starved_for: Micros,
}

#[derive(Copy, Clone, Debug)]
enum State {
    /// Nothing has come yet.
    Waiting,
    /// The buffer ran empty in mid-program; with the time of hold up to then.
    Empty { since: Micros, held: Micros },
    /// Bytes are taken one after the other since `origin`.
    Running { origin: Micros, taken: u64 },
    /// A feed hold.
    Paused { until: Micros },
}

impl Execution {
    pub(super) fn new(rate: u32, pauses: Vec<(u64, Micros)>) -> Self {
        Self {
            rate,
            pauses: pauses.into(),
            state: State::Waiting,
            level: 0,
            consumed: 0,
            starved: 0,
            starved_for: Micros::ZERO,
        }
    }

    pub(super) fn level(&self) -> usize {
        self.level
    }

    pub(super) fn consumed(&self) -> u64 {
        self.consumed
    }

    pub(super) fn starved(&self) -> u32 {
        self.starved
    }

    pub(super) fn starved_for(&self) -> Micros {
        self.starved_for
    }

    /// A byte came into the buffer; `held` is the time of hold up to now.
    pub(super) fn arrive(&mut self, at: Micros, held: Micros) {
        self.level += 1;
        match self.state {
            State::Waiting => self.run(at),
            State::Empty { since, held: held_before } => {
                // Without a rate the buffer is empty between any two bytes.
                let starved = (at - since) - (held - held_before);
                if self.rate > 0 && starved > Micros::ZERO {
                    self.starved += 1;
                    self.starved_for = self.starved_for + starved;
                }
                self.run(at);
            }
            State::Running { .. } | State::Paused { .. } => {}
        }
    }

    /// When the state next changes: a byte taken, a pause over.
    pub(super) fn next(&self) -> Option<Micros> {
        self.next_after(1)
    }

    /// When `bytes` more have been taken, or at the pause before that.
    pub(super) fn next_after(&self, bytes: usize) -> Option<Micros> {
        match self.state {
            State::Waiting | State::Empty { .. } => None,
            State::Running { origin, taken } => {
                let to_pause = self.pauses.front().map_or(u64::MAX, |&(position, _)| {
                    position.saturating_sub(self.consumed).max(1)
                });
                let bytes = (bytes as u64).min(to_pause).min(self.level as u64);
                Some(origin + self.span(taken + bytes))
            }
            State::Paused { until } => Some(until).filter(|&until| until < Micros::MAX),
        }
    }

    /// Does what [`next`](Self::next) announced for this time.
    pub(super) fn advance(&mut self, at: Micros, held: Micros) {
        match &mut self.state {
            State::Waiting | State::Empty { .. } => return,
            State::Running { taken, .. } => {
                *taken += 1;
                self.level -= 1;
                self.consumed += 1;
                if self.begin_pause(at) {
                    return;
                }
            }
            State::Paused { .. } if self.level > 0 => {
                self.state = State::Running { origin: at, taken: 0 };
            }
            State::Paused { .. } => {}
        }
        if self.level == 0 {
            self.state = State::Empty { since: at, held };
        }
    }

    fn run(&mut self, at: Micros) {
        if !self.begin_pause(at) {
            self.state = State::Running { origin: at, taken: 0 };
        }
    }

    fn begin_pause(&mut self, at: Micros) -> bool {
        let Some(&(position, span)) = self.pauses.front() else { return false };
        if position > self.consumed {
            return false;
        }
        self.pauses.pop_front();
        self.state = State::Paused { until: at + span };
        true
    }

    fn span(&self, bytes: u64) -> Micros {
        if self.rate == 0 {
            return Micros::ZERO;
        }
        let micros = (u128::from(bytes) * 1_000_000).div_ceil(u128::from(self.rate));
        Micros(i64::try_from(micros).unwrap_or(i64::MAX))
    }
}
