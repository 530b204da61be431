//! Which of the bytes that the port took have left: the one place that knows.
//!
//! Two things tell of it: the line's rate, and what the port says that it still
//! holds. The rate alone is wrong as soon as somebody stops the line, and a port
//! tells of no more than the kernel's queue. So *may have left* is never more
//! than the port no longer held when it was last asked, and what the line can
//! have sent since; *surely left* is never more than what the rate and the port
//! both say.
//!
//! Places count all that the port was ever given. Some of it was called back, or
//! lost with a port: places pass over it, what has left does not count it.

use std::collections::VecDeque;

use softplug_abi::{LineParameters, Micros};

use crate::pacer::{Run, most_in};
use crate::port::{Backlog, Port};

/// Runs after which those that have left are looked for: there are as many on
/// each link, so they are not many.
const RUNS: usize = 4;

/// How many characters have left the line of those that the port was given
/// behind some [`Place`]: the one source of all figures of what was sent. The
/// protocol's own characters count.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Left {
    /// No more than these can have left.
    pub maybe: u64,
    /// These have left for certain, as far as the port tells: what a device
    /// server has taken counts, and what an adapter has for so long as the
    /// line's rate says.
    pub surely: u64,
}

/// How much a port was given by some moment, a job's beginning for one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Place {
    taken: u64,
    /// Of these, those that will never leave.
    never_left: u64,
}

/// What is known of the port.
#[derive(Copy, Clone, Debug)]
struct Line {
    characters: LineParameters,
    /// The port keeps the line's rate: no byte leaves before its time.
    rate_known: bool,
    /// Characters that the port does not tell of, and that leave although the
    /// partner has stopped it.
    below: Option<u32>,
}

/// What the port told: by then no byte behind place `out` had left.
#[derive(Copy, Clone, Debug, Default)]
struct Look {
    at: Micros,
    out: u64,
    held: u64,
}

/// Runs of bytes that the port took and that have not all left for certain.
#[derive(Debug)]
pub(super) struct Departures {
    line: Line,
    runs: VecDeque<Run>,
    taken: u64,
    /// Bytes of runs that have wholly left.
    settled: u64,
    /// Up to which place the plug-in was told that all has surely left.
    told: u64,
    look: Look,
    /// Since when the port has held as much as at the last look, if it holds something.
    stuck_since: Option<Micros>,
    /// A look that is not yet old enough for what it says is out to have left, and the place up
    /// to which one was.
    ageing: Look,
    aged: u64,
    /// Bytes that never left, first place and count.
    never_left: VecDeque<(u64, u64)>,
    /// How many of them places that have settled passed over.
    passed_over: u64,
}

impl Departures {
    pub(super) fn new(port: &Port) -> Self {
        Self {
            line: Line::of(port),
            runs: VecDeque::new(),
            taken: 0,
            settled: 0,
            told: 0,
            look: Look::default(),
            stuck_since: None,
            ageing: Look::default(),
            aged: 0,
            never_left: VecDeque::new(),
            passed_over: 0,
        }
    }

    pub(super) fn took(&mut self, now: Micros, run: Run) {
        // Nobody may be asking what has left: then it is not kept.
        if self.runs.len() >= RUNS {
            self.settle(now);
        }
        self.taken += run.count as u64;
        self.runs.push_back(run);
    }

    /// The port tells what it holds. It was asked at `now` or later.
    pub(super) fn looked(&mut self, now: Micros, backlog: Backlog) {
        let held = (backlog.bytes as u64).min(self.taken);
        let out = (self.taken - held).max(self.look.out);
        let is_stuck = held > 0 && out == self.look.out && self.look.held > 0;
        self.stuck_since = match self.stuck_since {
            _ if held == 0 => None,
            Some(since) if is_stuck => Some(since),
            _ => Some(now),
        };
        self.look = Look { at: now, out, held };
        if backlog.is_empty {
            self.aged = self.taken;
            self.settled = self.taken;
            self.runs.clear();
            self.pass_over();
        }
        let below = u64::from(self.line.below.unwrap_or(0));
        if now >= self.ageing.at + self.line.characters.characters(below) {
            self.aged = self.aged.max(self.ageing.out);
            self.ageing = self.look;
        }
    }

    /// When the port was asked last.
    pub(super) fn looked_at(&self) -> Micros {
        self.look.at
    }

    /// How long the port has held the same bytes: somebody has stopped it.
    pub(super) fn stuck_for(&self, now: Micros) -> Micros {
        self.stuck_since.map_or(Micros::ZERO, |since| now - since)
    }

    /// All that the port held was called back; none of it has left, or as much as slipped out
    /// in the meantime.
    pub(super) fn called_back(&mut self) {
        let held = self.taken - self.look.out;
        if held > 0 {
            self.never_left.push_back((self.look.out, held));
        }
        self.look.out = self.taken;
        self.stuck_since = None;
    }

    /// The port is gone, or was asked to drop what it has and does not tell what that was: what
    /// has not surely left by now does not count as that any more.
    pub(super) fn lost(&mut self, now: Micros) {
        let surely = self.place_surely(now);
        if surely < self.taken {
            self.never_left.push_back((surely, self.taken - surely));
        }
        self.runs.clear();
        self.settled = self.taken;
        self.pass_over();
    }

    /// Another port; what the one before was given is settled.
    pub(super) fn begin_anew(&mut self, port: &Port, now: Micros) {
        self.lost(now);
        self.line = Line::of(port);
        self.look = Look { at: now, out: self.taken, held: 0 };
        (self.ageing, self.aged, self.stuck_since) = (self.look, self.taken, None);
    }

    /// Up to which place all may have left, and all surely have, for the marks of
    /// the plug-in: never late, and never early.
    pub(super) fn places(&mut self, now: Micros) -> (u64, u64) {
        let surely = self.place_surely(now);
        self.told = surely;
        if !self.line.rate_known {
            return (self.taken, surely);
        }
        let by_rate = |run: &Run| {
            (0..run.count).take_while(|index| run.maybe_left(*index) <= now).count() as u64
        };
        let maybe = self.settled + self.runs.iter().map(by_rate).sum::<u64>();
        (maybe.min(self.place_maybe(now)).max(surely), surely)
    }

    /// All that the port was given so far.
    pub(super) fn place(&self) -> Place {
        let to_pass: u64 = self.never_left.iter().map(|(_, count)| count).sum();
        Place { taken: self.taken, never_left: self.passed_over + to_pass }
    }

    /// What has left of that behind `from`.
    pub(super) fn left(&mut self, now: Micros, from: Place) -> Left {
        let surely = self.place_surely(now);
        let inside = |(first, count): &(u64, u64)| surely.saturating_sub(*first).min(*count);
        let never = self.passed_over + self.never_left.iter().map(inside).sum::<u64>();
        let surely = surely.saturating_sub(from.taken);
        // Of what was called back some may have slipped out: it may have left.
        Left {
            maybe: self.place_maybe(now).saturating_sub(from.taken),
            surely: surely.saturating_sub(never.saturating_sub(from.never_left)),
        }
    }

    /// Whether more has left than the plug-in was told.
    pub(super) fn has_news(&self) -> bool {
        self.settled > self.told
    }

    /// When the run that leaves next will have left.
    pub(super) fn next(&self) -> Option<Micros> {
        self.runs.front().map(|run| run.surely_left(run.count - 1))
    }

    /// What was out at the last look, and what the fastest line has sent since.
    fn place_maybe(&self, now: Micros) -> u64 {
        if !self.line.rate_known {
            return self.taken;
        }
        let since = most_in(self.line.characters, now - self.look.at);
        self.look.out.saturating_add(since).min(self.taken)
    }

    fn place_surely(&mut self, now: Micros) -> u64 {
        let limit = self.settle(now);
        let begun = self.runs.front().map_or(0, |run| {
            (0..run.count).take_while(|index| run.surely_left(*index) <= now).count() as u64
        });
        (self.settled + begun).min(limit.max(self.settled))
    }

    /// Takes leave of runs that have wholly left; gives the place up to which the port allows it.
    fn settle(&mut self, now: Micros) -> u64 {
        let limit = self.limit();
        while let Some(run) = self.runs.front() {
            let whole = run.surely_left(run.count - 1) <= now;
            if !whole || self.settled + run.count as u64 > limit {
                break;
            }
            self.settled += run.count as u64;
            self.runs.pop_front();
        }
        self.pass_over();
        limit
    }

    /// The place up to which the port held nothing.
    fn limit(&self) -> u64 {
        if self.line.below.is_some() { self.aged } else { self.look.out }
    }

    /// What was never sent is behind us.
    fn pass_over(&mut self) {
        while let Some((first, count)) = self.never_left.front()
            && first + count <= self.settled
        {
            self.passed_over += count;
            self.never_left.pop_front();
        }
    }
}

impl Line {
    fn of(port: &Port) -> Self {
        Self {
            characters: port.line(),
            rate_known: port.rate_known(),
            below: port.leaves_when_stopped(),
        }
    }
}
