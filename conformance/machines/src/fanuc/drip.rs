//! What becomes of the blocks: stored, or executed while more of them come.

use std::collections::VecDeque;

use softplug_abi::Micros;

use super::options::{FeedHold, Feeding, Options};
use super::report::Starvation;

/// Starvations that are told one by one.
const TOLD: usize = 100;

/// The buffer's level, and the execution that empties it block by block.
#[derive(Debug)]
pub(super) struct Execution {
    block_time: Micros,
    /// Characters at which the cycle starts; `None`: blocks are only stored.
    cycle_start: Option<usize>,
    feed_holds: VecDeque<FeedHold>,
    state: State,
    /// Lengths of the complete blocks in the buffer.
    blocks: VecDeque<u32>,
    /// Characters of the block that is still coming.
    partial: u32,
    level: usize,
    largest_level: usize,
    executed: u64,
    starved: u32,
    starved_for: Micros,
    starvations: Vec<Starvation>,
}

#[derive(Copy, Clone, Debug)]
enum State {
    /// The cycle has not been started.
    Waiting,
    /// A block is being executed, the nth since `origin`.
    Running { origin: Micros, count: i64 },
    /// A feed hold.
    Held { until: Micros },
    /// The next block is not there; with the time of hold on the line up to then.
    Empty { since: Micros, held: Micros },
    /// The program has come to its end, or was broken off.
    Over,
}

impl Execution {
    pub(super) fn new(options: &Options) -> Self {
        let (cycle_start, feed_holds) = match &options.feeding {
            Feeding::Memory => (None, VecDeque::new()),
            Feeding::Drip { cycle_start, feed_holds } => {
                (Some(*cycle_start), feed_holds.clone().into())
            }
        };
        Self {
            block_time: options.block_time,
            cycle_start,
            feed_holds,
            state: State::Over,
            blocks: VecDeque::new(),
            partial: 0,
            level: 0,
            largest_level: 0,
            executed: 0,
            starved: 0,
            starved_for: Micros::ZERO,
            starvations: Vec::new(),
        }
    }

    /// Characters in the buffer.
    pub(super) fn level(&self) -> usize {
        self.level
    }

    pub(super) fn largest_level(&self) -> usize {
        self.largest_level
    }

    /// Blocks that were executed, of all programs.
    pub(super) fn executed(&self) -> u64 {
        self.executed
    }

    /// An empty buffer for a new program.
    pub(super) fn begin(&mut self) {
        self.clear();
        self.state = State::Waiting;
    }

    /// The program is broken off.
    pub(super) fn clear(&mut self) {
        self.blocks.clear();
        self.partial = 0;
        self.level = 0;
        self.state = State::Over;
    }

    /// A character of a block came into the buffer.
    pub(super) fn arrive(&mut self) {
        self.level += 1;
        self.partial += 1;
        self.largest_level = self.largest_level.max(self.level);
    }

    /// The block is complete; `held` is the time of hold on the line so far.
    pub(super) fn complete(&mut self, at: Micros, held: Micros) {
        self.blocks.push_back(std::mem::take(&mut self.partial));
        match self.state {
            State::Waiting if self.cycle_start.is_none_or(|start| self.level >= start) => {
                self.next_block(at, held);
            }
            State::Empty { since, held: before } => {
                self.starve(since, (at - since) - (held - before));
                self.next_block(at, held);
            }
            State::Waiting | State::Running { .. } | State::Held { .. } | State::Over => {}
        }
    }

    /// Nothing more will come, or nothing more fits: what is there is executed.
    pub(super) fn flush(&mut self, at: Micros, held: Micros) {
        if self.partial > 0 && self.blocks.is_empty() {
            self.blocks.push_back(std::mem::take(&mut self.partial));
        }
        if matches!(self.state, State::Waiting | State::Empty { .. }) {
            self.next_block(at, held);
        }
    }

    /// The program's end is in the buffer.
    pub(super) fn end(&mut self, at: Micros, held: Micros) {
        if self.partial > 0 {
            self.blocks.push_back(std::mem::take(&mut self.partial));
        }
        match self.state {
            State::Waiting | State::Empty { .. } => self.next_block(at, held),
            State::Running { .. } | State::Held { .. } | State::Over => {}
        }
    }

    /// When the state next changes by itself.
    pub(super) fn next(&self) -> Option<Micros> {
        match self.state {
            State::Waiting | State::Empty { .. } | State::Over => None,
            State::Running { origin, count } => {
                Some(origin + Micros(self.block_time.0.saturating_mul(count)))
            }
            State::Held { until } => Some(until).filter(|until| *until < Micros::MAX),
        }
    }

    /// Does what [`next`](Self::next) announced for this time.
    pub(super) fn advance(&mut self, at: Micros, held: Micros) {
        match self.state {
            State::Waiting | State::Empty { .. } | State::Over => return,
            State::Running { .. } => {
                self.executed += 1;
                if let Some(hold) = self.feed_holds.pop_front_if(|hold| hold.after <= self.executed)
                {
                    self.state = State::Held { until: at + hold.span };
                    return;
                }
            }
            State::Held { .. } => {}
        }
        self.next_block(at, held);
    }

    /// How often and how long execution has waited for a block up to now, and
    /// when. `awaits` says whether more of the program is to come.
    pub(super) fn starvation(
        &self,
        now: Micros,
        held: Micros,
        awaits: bool,
    ) -> (u32, Micros, Vec<Starvation>) {
        let mut seen = (self.starved, self.starved_for, self.starvations.clone());
        if let State::Empty { since, held: before } = self.state
            && awaits
            && self.cycle_start.is_some()
        {
            let span = (now - since) - (held - before);
            if span > Micros::ZERO {
                seen.0 += 1;
                seen.1 = seen.1 + span;
                seen.2.push(Starvation { at: since, block: self.executed, span });
                seen.2.truncate(TOLD);
            }
        }
        seen
    }

    /// Takes the next block out of the buffer, if it is there.
    fn next_block(&mut self, at: Micros, held: Micros) {
        let Some(length) = self.blocks.pop_front() else {
            self.state = State::Empty { since: at, held };
            return;
        };
        self.level -= length as usize;
        self.state = match self.state {
            State::Running { origin, count } => State::Running { origin, count: count + 1 },
            _ => State::Running { origin: at, count: 1 },
        };
    }

    /// A control that stores blocks is not hurt by waiting.
    fn starve(&mut self, since: Micros, span: Micros) {
        if self.cycle_start.is_none() || span <= Micros::ZERO {
            return;
        }
        self.starved += 1;
        self.starved_for = self.starved_for + span;
        if self.starvations.len() < TOLD {
            self.starvations.push(Starvation { at: since, block: self.executed, span });
        }
    }
}
