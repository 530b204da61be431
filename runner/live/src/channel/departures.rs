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
    /// The port tells what it holds: as long as it is not asked, nothing is sure.
    tells: bool,
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
    taken: u64,
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
        Self::on(Line::of(port))
    }

    fn on(line: Line) -> Self {
        Self {
            line,
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
        self.look = Look { at: now, out, held, taken: self.taken };
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

    /// So many bytes behind those that the port was given will never be: what follows is behind
    /// them. What is there counts as [`lost`](Self::lost) next.
    pub(super) fn pass_over_never_given(&mut self, count: u64) {
        self.taken += count;
    }

    /// Another port; what the one before was given is settled.
    pub(super) fn begin_anew(&mut self, port: &Port, now: Micros) {
        self.lost(now);
        self.line = Line::of(port);
        self.look = Look { at: now, out: self.taken, held: 0, taken: self.taken };
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
    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        self.runs.front().map(|run| run.surely_left(run.count - 1))
    }

    /// What was out at the last look, and what the fastest line has sent since; also as much as
    /// the port was given since, which is little, because an adapter need not keep to the rate
    /// that it has.
    pub(super) fn place_maybe(&self, now: Micros) -> u64 {
        if !self.line.rate_known {
            return self.taken;
        }
        let since = most_in(self.line.characters, now - self.look.at);
        let given = self.taken - self.look.taken;
        self.look.out.saturating_add(since.max(given)).min(self.taken)
    }

    pub(super) fn place_surely(&mut self, now: Micros) -> u64 {
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
        match self.line.below {
            _ if !self.line.tells => self.taken,
            Some(_) => self.aged,
            None => self.look.out,
        }
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
            tells: port.tells_backlog(),
            below: port.leaves_when_stopped(),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::pacer::Pacer;

    /// A UART below the kernel's queue: the kernel fills its memory when that is empty, unless
    /// the partner has stopped it; what is in it leaves.
    #[derive(Debug)]
    struct Uart {
        character: i64,
        fifo: u64,
        queue: u64,
        inside: u64,
        left: u64,
        is_stopped: bool,
        /// When the character on the line ends.
        ends: i64,
        now: i64,
    }

    impl Uart {
        fn fill(&mut self) {
            if self.inside == 0 && !self.is_stopped && self.queue > 0 {
                self.inside = self.queue.min(self.fifo);
                self.queue -= self.inside;
                self.ends = self.now + self.character;
            }
        }

        fn until(&mut self, at: i64) {
            self.fill();
            while self.inside > 0 && self.ends <= at {
                self.now = self.ends;
                self.inside -= 1;
                self.left += 1;
                self.ends = self.now + self.character;
                self.fill();
            }
            self.now = at;
        }
    }

    #[derive(Clone, Debug)]
    enum Step {
        Wait(i64),
        Write(usize),
        Stop(bool),
        CallBack,
    }

    fn step() -> impl Strategy<Value = Step> {
        prop_oneof![
            4 => (1_i64..60_000).prop_map(Step::Wait),
            4 => (1_usize..40).prop_map(Step::Write),
            2 => any::<bool>().prop_map(Step::Stop),
            1 => Just(Step::CallBack),
        ]
    }

    proptest! {
        #[test]
        fn what_has_left_lies_between_the_two_figures(
            steps in prop::collection::vec(step(), 1..120),
            fifo in prop_oneof![Just(1_u64), Just(16), Just(64)],
            tells_empty in any::<bool>(),
        ) {
            let characters = LineParameters::new(9_600);
            let mut pacer = Pacer::new(characters, 4);
            let below = Some(fifo as u32 + 1);
            let mut departures = Departures::on(Line { characters, rate_known: true, tells: true, below });
            let mut uart = Uart {
                // A character of 1,041.67 µs takes no longer than that, nor half a per cent less.
                character: 1_041, fifo, queue: 0, inside: 0, left: 0, is_stopped: false, ends: 0, now: 0,
            };
            let mut from = (Place::default(), 0);
            for step in steps {
                let now = Micros(uart.now);
                match step {
                    Step::Wait(span) => uart.until(uart.now + span),
                    Step::Write(count) => {
                        uart.queue += count as u64;
                        departures.took(now, pacer.took(now, count));
                        uart.fill();
                    }
                    Step::Stop(is_stopped) => {
                        uart.is_stopped = is_stopped;
                        uart.fill();
                    }
                    Step::CallBack => {
                        departures.looked(now, Backlog { bytes: uart.queue as usize, is_empty: false });
                        uart.queue = 0;
                        departures.called_back();
                        pacer.discarded(now);
                        // The next job's figures begin here.
                        from = (departures.place(), uart.left + uart.inside);
                    }
                }
                let now = Micros(uart.now);
                let is_empty = tells_empty && uart.queue + uart.inside == 0;
                departures.looked(now, Backlog { bytes: uart.queue as usize, is_empty });
                let left = departures.left(now, Place::default());
                prop_assert!(left.surely <= uart.left && uart.left <= left.maybe, "{left:?} {uart:?}");
                let (maybe, surely) = departures.places(now);
                prop_assert!(surely <= maybe);
                let (left, behind) = (departures.left(now, from.0), uart.left.saturating_sub(from.1));
                prop_assert!(left.surely <= behind && behind <= left.maybe, "{left:?} {uart:?}");
            }
            // In the end all has left that was not called back, and that is known.
            uart.is_stopped = false;
            uart.until(uart.now + 2_000_000);
            for _ in 0..2 {
                departures.looked(Micros(uart.now), Backlog::default());
                uart.until(uart.now + 2_000_000);
            }
            departures.looked(Micros(uart.now), Backlog::default());
            let left = departures.left(Micros(uart.now), Place::default());
            prop_assert_eq!(left.surely, uart.left);
            prop_assert!(left.maybe >= uart.left);
        }
    }

    #[test]
    fn a_port_that_is_lost_leaves_what_it_was_last_known_to_hold() {
        let characters = LineParameters::new(9_600);
        let mut pacer = Pacer::new(characters, 4_096);
        let mut departures =
            Departures::on(Line { characters, rate_known: true, tells: true, below: None });
        departures.took(Micros(0), pacer.took(Micros(0), 4_009));
        // It has passed on 400, and is pulled out ten characters later.
        departures.looked(Micros(417_000), Backlog { bytes: 3_609, is_empty: false });
        let now = Micros(427_416);
        assert_eq!(departures.left(now, Place::default()), Left { maybe: 410, surely: 400 });
        departures.lost(now);
        let later = Micros(9_000_000);
        assert_eq!(departures.left(later, Place::default()).surely, 400);
        // The next job begins behind all that was lost.
        let place = departures.place();
        departures.look.out = departures.taken;
        departures.took(later, pacer.took(later, 3));
        departures.looked(later + Micros(20_000_000), Backlog::default());
        let left = departures.left(later + Micros(20_000_000), place);
        assert_eq!(left, Left { maybe: 3, surely: 3 });
    }
}
