//! Pacing: how many bytes may be given to a port now.
//!
//! A port takes bytes faster than its line sends them, and what it has taken
//! cannot be held back when the partner says stop. The pacer keeps a model of
//! the line: it knows when each byte's last bit leaves, and lets at most
//! `depth` characters be in flight. The bucket is the line itself, so there is
//! no drift: what is sent late is made up for as long as the line still had
//! something to send, and that credit is part of the depth.
//!
//! Sans-I/O: the caller gives the time and waits.

use softplug_abi::{LineParameters, Micros};

/// Rates of two clocks differ by this much at the most on a line that works:
/// thousandths. A byte may leave so much earlier than by our clock.
const CLOCK_TOLERANCE: i128 = 25;

/// Waking up is not later than this, or rarely: for so long a line is kept busy.
const LATENESS: Micros = Micros::from_millis(4);

/// Characters in flight by default: few where a character is long, more where
/// waking up takes longer than a character.
pub const fn default_depth(baud: u32) -> u32 {
    match baud {
        0..=19_200 => 1,
        19_201..=57_600 => 2,
        57_601..=115_200 => 4,
        _ => 32,
    }
}

/// A model of the transmit line, with at most a given number of characters in
/// flight.
///
/// Ask [`available`](Self::available), write, tell [`took`](Self::took) how
/// many bytes the port took, wait until [`next`](Self::next).
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_live::Pacer;
///
/// let mut pacer = Pacer::new(LineParameters::new(9_600), 1);
/// assert_eq!(pacer.available(Micros(0)), 1);
/// let run = pacer.took(Micros(0), 1);
/// assert_eq!(pacer.available(Micros(1_041)), 0);
/// assert_eq!(pacer.next(Micros(0), 1), Micros(1_042));
/// assert_eq!(run.surely_left(0), Micros(1_042));
/// ```
#[derive(Clone, Debug)]
pub struct Pacer {
    line: LineParameters,
    depth: u32,
    slack: Micros,
    /// When the line has sent all that it was given, in ticks.
    free: i128,
    /// When a line has sent all whose clock is as fast as a clock may be, and when one has that
    /// was given everything as late as may be; in ticks.
    early_free: i128,
    late_free: i128,
    written: u64,
}

/// Bytes that a port took at once.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Run {
    start: i128,
    early_start: i128,
    // There are many of these: what fits into half is kept in half.
    ticks_per_micro: i64,
    character: i64,
    early_character: i64,
    slack: Micros,
    /// Bytes in the run.
    pub count: usize,
}

// One tick is 1 / (2 × baud) µs: then both a microsecond (2 × baud ticks) and a
// character (half bits × 1,000,000 ticks) are whole numbers, and no sum of
// characters is ever rounded. Where the rate is unknown, characters take none.
impl Pacer {
    /// A pacer for an idle line; `depth` counts characters, at least 1.
    pub fn new(line: LineParameters, depth: u32) -> Self {
        let depth = depth.max(1);
        let past = i128::MIN / 2;
        let (free, early_free, late_free) = (past, past, past);
        Self { line, depth, slack: Micros::ZERO, free, early_free, late_free, written: 0 }
    }

    /// A pacer that is sure of a byte's departure only `slack` after the model is:
    /// for adapters and UARTs that keep bytes for a while.
    pub fn with_slack(mut self, slack: Micros) -> Self {
        self.slack = slack;
        self
    }

    /// The line that is modelled.
    pub fn line(&self) -> LineParameters {
        self.line
    }

    /// Characters that may be in flight.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Bytes taken so far.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Characters given to the port and not yet sent by the model, the one on
    /// the line included.
    pub fn in_flight(&self, now: Micros) -> u64 {
        if self.line.baud == 0 {
            return 0;
        }
        let rest = (self.free - self.ticks(now)).max(0);
        ceil_div(rest, self.character()) as u64
    }

    /// When all that the port was given has left, by the model.
    pub fn free_at(&self) -> Micros {
        let free = ceil_div(self.free, self.ticks_per_micro());
        Micros(free.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64)
    }

    /// For how long the line has sent nothing, by the model; zero where the rate is unknown, and before
    /// the first byte.
    pub fn idle(&self, now: Micros) -> Micros {
        let idle = self.ticks(now) - self.free;
        if self.line.baud == 0 || self.written == 0 || idle <= 0 {
            return Micros::ZERO;
        }
        Micros((idle / self.ticks_per_micro()).min(i128::from(i64::MAX)) as i64)
    }

    /// Bytes that may be written now; no bound where the rate is unknown.
    pub fn available(&self, now: Micros) -> usize {
        if self.line.baud == 0 {
            return usize::MAX;
        }
        u64::from(self.depth).saturating_sub(self.in_flight(now)) as usize
    }

    /// When to write next if `wanted` bytes wait: as soon as the part of the depth
    /// is free that is not needed to keep the line busy if waking up is late, or
    /// room for all of them. That part is half, or more where characters are so long
    /// that fewer last for 4 ms. Not before `now`.
    pub fn next(&self, now: Micros, wanted: usize) -> Micros {
        if self.line.baud == 0 {
            return now;
        }
        let stays = i128::from(self.depth - self.quantum(wanted)) * self.character();
        let due = ceil_div(self.free - stays, self.ticks_per_micro());
        now.max(Micros(due.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64))
    }

    /// How much later than [`next`](Self::next) costs nothing: half the time for
    /// which the line is busy then. The other half is for waking up late.
    pub fn patience(&self, wanted: usize) -> Micros {
        if self.line.baud == 0 {
            return Micros::ZERO;
        }
        let stays = i128::from(self.depth - self.quantum(wanted)) * self.character();
        Micros((stays / self.ticks_per_micro() / 2) as i64)
    }

    /// Bytes for which there is to be room before some are written.
    fn quantum(&self, wanted: usize) -> u32 {
        let lateness = ceil_div(self.ticks(LATENESS), self.character());
        let stays = u32::try_from(lateness).unwrap_or(u32::MAX).min(self.depth / 2);
        (self.depth - stays).min(wanted.max(1).min(u32::MAX as usize) as u32)
    }

    /// The port took `count` bytes at `now`.
    pub fn took(&mut self, now: Micros, count: usize) -> Run {
        self.took_between(now, now, count)
    }

    /// The port took `count` bytes, after one reading of the clock and before
    /// another; between them anything can have held our thread up.
    pub fn took_between(&mut self, before: Micros, after: Micros, count: usize) -> Run {
        self.written += count as u64;
        // What a write takes is not the line's loss; what a thread was late is its gain.
        let is_late = self.ticks(after) - self.ticks(before) > self.character() / 2;
        let at = self.ticks(if is_late { after } else { before });
        // Within one µs the line was never idle: our clock is only that fine.
        let idle = at - self.free >= self.ticks_per_micro();
        let start = if idle { at } else { self.free };
        // A fast line ends early, but never begins before the byte is there.
        let early_start = self.early_free.max(self.ticks(before)).min(start);
        let late_start = start.max(self.late_free).max(self.ticks(after));
        let run = Run {
            start: late_start,
            early_start,
            ticks_per_micro: self.ticks_per_micro() as i64,
            character: self.character() as i64,
            early_character: self.early_character() as i64,
            slack: self.slack,
            count,
        };
        self.free = start + count as i128 * self.character();
        self.early_free = early_start + count as i128 * self.early_character();
        self.late_free = late_start + count as i128 * self.character();
        run
    }

    /// The port says that it still holds `unsent` bytes: the line is slower
    /// than the model, or was stopped. They count as in flight.
    pub fn holds(&mut self, now: Micros, unsent: usize) {
        let least = self.ticks(now) + unsent as i128 * self.character();
        self.free = self.free.max(least);
        self.late_free = self.late_free.max(least);
    }

    /// What the port held was discarded; the character on the line ends.
    pub fn discarded(&mut self, now: Micros) {
        let most = self.ticks(now) + self.character();
        self.free = self.free.min(most);
        self.early_free = self.early_free.min(most);
        self.late_free = self.late_free.min(most);
    }

    /// The line sends nothing until `until`: a break.
    pub fn busy_until(&mut self, until: Micros) {
        self.free = self.free.max(self.ticks(until));
    }

    fn ticks(&self, at: Micros) -> i128 {
        i128::from(at.0) * self.ticks_per_micro()
    }

    fn ticks_per_micro(&self) -> i128 {
        (2 * i128::from(self.line.baud)).max(1)
    }

    fn character(&self) -> i128 {
        if self.line.baud == 0 { 0 } else { i128::from(self.line.half_bits()) * 1_000_000 }
    }

    fn early_character(&self) -> i128 {
        early(self.character())
    }
}

/// How many characters the fastest line sends in so long a time; all there may
/// be where the rate is unknown.
pub(crate) fn most_in(line: LineParameters, span: Micros) -> u64 {
    if line.baud == 0 {
        return u64::MAX;
    }
    let ticks = i128::from(span.0.max(0)) * 2 * i128::from(line.baud);
    u64::try_from(ticks / early(i128::from(line.half_bits()) * 1_000_000)).unwrap_or(u64::MAX)
}

/// A character of so many ticks on a line whose clock is as fast as a clock may be.
fn early(character: i128) -> i128 {
    character / 1_000 * (1_000 - CLOCK_TOLERANCE)
}

impl Run {
    /// When the last bit of byte `index` can have left: never too late.
    pub fn maybe_left(&self, index: usize) -> Micros {
        let at = self.early_start + (index as i128 + 1) * i128::from(self.early_character);
        Micros(at.div_euclid(i128::from(self.ticks_per_micro)) as i64)
    }

    /// When the last bit of byte `index` has left by the line's rate and the
    /// slack; a port that still holds bytes then is later.
    pub fn surely_left(&self, index: usize) -> Micros {
        let at = self.start + (index as i128 + 1) * i128::from(self.character);
        Micros(ceil_div(at, i128::from(self.ticks_per_micro)) as i64) + self.slack
    }
}

fn ceil_div(value: i128, by: i128) -> i128 {
    -(-value).div_euclid(by)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use softplug_abi::Parity;

    use super::*;

    /// A line that sends what it is given, one character after the other.
    struct Line {
        ends: Vec<u128>,
        character_nanos: u128,
    }

    impl Line {
        fn write(&mut self, now_nanos: u128, count: usize) {
            for _ in 0..count {
                let start = self.ends.last().copied().unwrap_or(0).max(now_nanos);
                self.ends.push(start + self.character_nanos);
            }
        }

        fn in_flight(&self, now_nanos: u128) -> usize {
            self.ends.iter().rev().take_while(|end| **end > now_nanos).count()
        }
    }

    fn saturate(line: LineParameters, depth: u32, late: i64, bytes: u64) -> Micros {
        let mut pacer = Pacer::new(line, depth);
        let mut now = Micros(0);
        while pacer.written() < bytes {
            let room = pacer.available(now).min((bytes - pacer.written()) as usize);
            pacer.took(now, room);
            let next = pacer.next(now, (bytes - pacer.written()) as usize);
            now = if next > now { next + Micros(late) } else { next };
        }
        Micros(ceil_div(pacer.free, pacer.ticks_per_micro()) as i64)
    }

    #[test]
    fn long_runs_take_exactly_the_lines_time() {
        for (baud, depth) in [(9_600, 1), (19_200, 1), (115_200, 4), (921_600, 32)] {
            let line = LineParameters::new(baud);
            let bytes = 1_000_000;
            assert_eq!(saturate(line, depth, 0, bytes), line.characters(bytes), "{baud}");
        }
    }

    #[test]
    fn lateness_within_half_the_depth_costs_nothing() {
        let line = LineParameters::new(921_600);
        assert_eq!(saturate(line, 32, 150, 100_000), line.characters(100_000));
        // Without a second character to bridge it, each lateness is lost.
        let slow = LineParameters::new(9_600);
        assert!(saturate(slow, 1, 100, 1_000) > slow.characters(1_000) + Micros(99_000));
        assert_eq!(saturate(slow, 2, 100, 1_000), slow.characters(1_000));
    }

    #[test]
    fn no_more_stays_in_the_line_than_lateness_needs() {
        let quantum = |baud, depth| Pacer::new(LineParameters::new(baud), depth).quantum(100);
        let quanta =
            [(300, 16), (9_600, 1), (9_600, 16), (19_200, 16), (115_200, 4), (921_600, 32)];
        assert_eq!(quanta.map(|(baud, depth)| quantum(baud, depth)), [15, 1, 12, 8, 2, 16]);
    }

    #[test]
    fn an_unknown_rate_is_not_paced() {
        let mut pacer = Pacer::new(LineParameters::new(0), 4);
        let run = pacer.took(Micros(5), 1_000);
        assert_eq!(pacer.available(Micros(5)), usize::MAX);
        assert_eq!(pacer.next(Micros(5), 1), Micros(5));
        assert_eq!((run.maybe_left(999), run.surely_left(999)), (Micros(5), Micros(5)));
    }

    #[test]
    fn bytes_that_the_port_still_holds_are_in_flight() {
        let mut pacer = Pacer::new(LineParameters::new(9_600), 4);
        pacer.took(Micros(0), 4);
        let later = Micros(10_000);
        assert_eq!(pacer.available(later), 4);
        pacer.holds(later, 3);
        assert_eq!(pacer.available(later), 1);
        pacer.discarded(later);
        assert_eq!(pacer.available(later), 3);
        pacer.busy_until(Micros(60_000));
        assert_eq!(pacer.available(later), 0);
        assert_eq!(pacer.next(later, 4), Micros(60_000 - 2 * 1_042 + 1));
    }

    #[test]
    fn defaults_follow_the_length_of_a_character() {
        let depths = [300, 19_200, 38_400, 57_600, 115_200, 230_400, 921_600].map(default_depth);
        assert_eq!(depths, [1, 1, 2, 2, 4, 32, 32]);
    }

    proptest! {
        #[test]
        fn never_more_than_depth_in_flight(
            baud in prop_oneof![Just(9_600_u32), Just(19_200), Just(115_200), Just(921_600), 50_u32..4_000_000],
            depth in 1_u32..40,
            two_stop in any::<bool>(),
            steps in prop::collection::vec((0_i64..20_000, 0_usize..50), 1..200),
        ) {
            let stop_half_bits = if two_stop { 4 } else { 2 };
            let line = LineParameters { baud, data_bits: 7, parity: Parity::Even, stop_half_bits };
            let mut pacer = Pacer::new(line, depth).with_slack(Micros(3));
            let half_bits = u128::from(line.half_bits());
            let mut model =
                Line { ends: vec![], character_nanos: half_bits * 500_000_000 / u128::from(baud) };
            let mut now = Micros(0);
            for (span, wanted) in steps {
                now = now + Micros(span);
                let nanos = now.0 as u128 * 1_000;
                let count = pacer.available(now).min(wanted);
                model.write(nanos, count);
                let run = pacer.took(now, count);
                prop_assert!(pacer.in_flight(now) <= u64::from(depth));
                // A line that begins up to a µs late may have a rest of one more.
                prop_assert!(model.in_flight(nanos + 1_000) <= depth as usize);
                let first = model.ends.len() - count;
                for (index, end) in model.ends[first..].iter().enumerate() {
                    prop_assert!(run.maybe_left(index).0 as u128 * 1_000 <= *end);
                    prop_assert!((run.surely_left(index).0 as u128 + 1) * 1_000 >= *end);
                }
            }
        }

        #[test]
        fn next_is_the_first_time_with_room(
            baud in 50_u32..1_000_000, depth in 1_u32..40, wanted in 1_usize..60,
        ) {
            let mut pacer = Pacer::new(LineParameters::new(baud), depth);
            pacer.took(Micros(7), pacer.available(Micros(7)));
            let next = pacer.next(Micros(7), wanted);
            let room = pacer.quantum(wanted) as usize;
            prop_assert!(room <= wanted);
            prop_assert!(next > Micros(7));
            prop_assert!(pacer.available(next) >= room);
            prop_assert!(pacer.available(next - Micros(1)) < room);
            // Whoever is as late as that finds the line still busy.
            let late = next + pacer.patience(wanted);
            prop_assert!(late == next || pacer.in_flight(late) > 0);
        }
    }
}
