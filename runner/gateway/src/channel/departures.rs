//! Which of the bytes that the port took have left.

use std::collections::VecDeque;

use softplug_abi::Micros;

use crate::pacer::Run;

/// Runs after which those that have left are looked for: there are as many on
/// each link, so they are not many.
const RUNS: usize = 4;

/// Runs of bytes that the port took and that have not all left for certain.
#[derive(Debug)]
pub(super) struct Departures {
    runs: VecDeque<Run>,
    /// The port keeps the line's rate: no byte leaves before its time.
    rate_known: bool,
    taken: u64,
    /// Bytes of runs that have wholly left.
    settled: u64,
    /// What was said last.
    lately: (u64, u64),
}

impl Departures {
    pub(super) fn new(rate_known: bool) -> Self {
        Self { runs: VecDeque::new(), rate_known, taken: 0, settled: 0, lately: (0, 0) }
    }

    pub(super) fn took(&mut self, now: Micros, run: Run) {
        // Nobody may be asking what has left: then it is not kept.
        if self.runs.len() >= RUNS {
            self.left(now, 0);
        }
        self.taken += run.count as u64;
        self.runs.push_back(run);
    }

    /// Another port; what the one before was given is settled.
    pub(super) fn begin_anew(&mut self, rate_known: bool) {
        self.runs.clear();
        self.settled = self.taken;
        self.rate_known = rate_known;
    }

    /// How many bytes maybe and surely have left, if the port still holds
    /// `unsent` bytes.
    pub(super) fn left(&mut self, now: Micros, unsent: usize) -> (u64, u64) {
        let limit = self.taken.saturating_sub(unsent as u64);
        while let Some(run) = self.runs.front() {
            let whole = run.surely_left(run.count - 1) <= now;
            if !whole || self.settled + run.count as u64 > limit {
                break;
            }
            self.settled += run.count as u64;
            self.runs.pop_front();
        }
        let in_run = |run: &Run, at: &dyn Fn(&Run, usize) -> Micros| {
            (0..run.count).take_while(|index| at(run, *index) <= now).count() as u64
        };
        let surely = self.runs.front().map_or(0, |run| in_run(run, &Run::surely_left));
        let surely = (self.settled + surely).min(limit);
        let maybe = if self.rate_known {
            let maybe: u64 = self.runs.iter().map(|run| in_run(run, &Run::maybe_left)).sum();
            self.settled + maybe
        } else {
            self.taken
        };
        self.lately = (maybe, surely);
        self.lately
    }

    /// What [`left`](Self::left) said last.
    pub(super) fn lately(&self) -> (u64, u64) {
        self.lately
    }

    /// When the run that leaves next will have left.
    pub(super) fn next(&self) -> Option<Micros> {
        self.runs.front().map(|run| run.surely_left(run.count - 1))
    }
}
