//! Closed world: everything demanded happens, at its time, and nothing else.

use super::demand::{Demand, Demanded};
use crate::run::back_to_back::Run;
use crate::run::seen::Seen;
use softplug_abi::{LineParameters, Micros};

/// The first place where the two differ.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Mismatch {
    pub(crate) at: Micros,
    /// When the demand was due at the latest.
    pub(crate) due: Micros,
    /// Number of the demand, and of the thing in it.
    pub(crate) expected: Option<(usize, usize)>,
    /// Number of what was seen.
    pub(crate) observed: Option<usize>,
}

/// Holds what was seen against one timeline of demands, both in the order of time.
pub(crate) fn compare(
    demands: &[Demand],
    seen: &[Seen],
    line: LineParameters,
) -> Result<(), Mismatch> {
    let mut matcher =
        Matcher { demands, progress: vec![0; demands.len()], first_open: 0, run: Run::new(line) };
    for (number, seen) in seen.iter().enumerate() {
        matcher.take(seen).map_err(|mismatch| Mismatch { observed: Some(number), ..mismatch })?;
    }
    match matcher.overdue(Micros::MAX) {
        Some(mismatch) => Err(mismatch),
        None => Ok(()),
    }
}

struct Matcher<'a> {
    demands: &'a [Demand],
    /// Things of each demand that were seen.
    progress: Vec<usize>,
    /// All demands before it are fulfilled.
    first_open: usize,
    run: Run,
}

impl Matcher<'_> {
    fn take(&mut self, seen: &Seen) -> Result<(), Mismatch> {
        if let Some(missed) = self.overdue(seen.at) {
            return Err(missed);
        }
        let mut next = None;
        for number in self.first_open..self.demands.len() {
            if self.is_fulfilled(number) {
                continue;
            }
            let demand = &self.demands[number];
            let done = self.progress[number];
            if demand.channel() != seen.channel() {
                continue;
            }
            let (from, to) = self.window(number);
            let place = Some((number, done));
            next = next.or(Some((place, to)));
            if from > seen.at {
                break;
            }
            if demand.allows(done, &seen.what) && seen.at <= to {
                self.fulfil(number, seen);
                return Ok(());
            }
            // It must come now, and comes first: lines of one kind and time have
            // an order.
            if to <= seen.at {
                return Err(Mismatch { at: seen.at, due: to, expected: place, observed: None });
            }
        }
        let (expected, due) = next.unwrap_or((None, seen.at));
        Err(Mismatch { at: seen.at, due, expected, observed: None })
    }

    fn is_fulfilled(&self, number: usize) -> bool {
        self.progress[number] == self.demands[number].length()
    }

    /// The first demand whose time was over before `now`.
    fn overdue(&self, now: Micros) -> Option<Mismatch> {
        let started = (self.first_open..self.demands.len())
            .take_while(|number| self.demands[*number].from < now)
            .filter(|number| !self.is_fulfilled(*number));
        let missed = started.map(|number| (self.window(number).1, number));
        let (at, number) = missed.filter(|(to, _)| *to < now).min()?;
        Some(Mismatch {
            at,
            due: at,
            expected: Some((number, self.progress[number])),
            observed: None,
        })
    }

    /// When the next thing of a demand may happen: the first in the line's window,
    /// the others back to back.
    fn window(&self, number: usize) -> (Micros, Micros) {
        let demand = &self.demands[number];
        if self.progress[number] == 0 {
            return (demand.from, demand.to);
        }
        let next = self.run.end();
        (next, next)
    }

    fn fulfil(&mut self, number: usize, seen: &Seen) {
        self.progress[number] += 1;
        if matches!(self.demands[number].what, Demanded::Bytes(_)) {
            self.run.add(seen.at);
        }
        while self.first_open < self.demands.len() && self.is_fulfilled(self.first_open) {
            self.first_open += 1;
        }
    }
}

/// The first difference between two runs that should be the same.
pub(crate) fn first_difference(base: &[Seen], seen: &[Seen]) -> Option<usize> {
    let same = base.iter().zip(seen).take_while(|(base, seen)| base == seen).count();
    (same < base.len().max(seen.len())).then_some(same)
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::JobId;
    use softplug_link::Observed;

    fn bytes(from: i64, to: i64, bytes: &[u8]) -> Demand {
        let what = Demanded::Bytes(bytes.to_vec());
        Demand { from: Micros(from), to: Micros(to), line: 0, what }
    }

    fn done(at: i64, id: u32) -> Demand {
        let what = Observed::Done { job: JobId(id), sent: 0 };
        let what = Demanded::Once { what, is_counted: false };
        Demand { from: Micros(at), to: Micros(at), line: 0, what }
    }

    fn seen(list: &[(i64, Observed)]) -> Vec<Seen> {
        list.iter().map(|(at, what)| Seen { at: Micros(*at), what: what.clone() }).collect()
    }

    fn sent(list: &[(i64, u8)]) -> Vec<Seen> {
        seen(&list.iter().map(|(at, byte)| (*at, Observed::Byte(*byte))).collect::<Vec<_>>())
    }

    fn judge(demands: &[Demand], seen: &[Seen]) -> Result<(), Mismatch> {
        compare(demands, seen, LineParameters::new(9_600))
    }

    #[test]
    fn characters_are_counted_from_the_start_of_their_run() {
        let one_line = [bytes(0, 0, b"ABCD")];
        let two_lines = [bytes(0, 0, b"AB"), bytes(2_084, 2_084, b"CD")];
        let run = sent(&[(0, b'A'), (1_042, b'B'), (2_084, b'C'), (3_125, b'D')]);
        assert_eq!(judge(&one_line, &run), Ok(()));
        assert_eq!(judge(&two_lines, &run), Ok(()));
        let late = sent(&[(0, b'A'), (1_042, b'B'), (2_084, b'C'), (3_126, b'D')]);
        let mismatch = Mismatch {
            at: Micros(3_125),
            due: Micros(3_125),
            expected: Some((0, 3)),
            observed: Some(3),
        };
        assert_eq!(judge(&one_line, &late), Err(mismatch));
    }

    #[test]
    fn a_window_holds_both_of_its_ends_and_moves_the_whole_line() {
        let demands = [bytes(10, 20, b"AB")];
        for start in [10, 15, 20] {
            assert_eq!(judge(&demands, &sent(&[(start, b'A'), (start + 1_042, b'B')])), Ok(()));
        }
        for start in [9, 21] {
            assert!(judge(&demands, &sent(&[(start, b'A'), (start + 1_042, b'B')])).is_err());
        }
        assert!(judge(&demands, &sent(&[(10, b'A'), (1_062, b'B')])).is_err());
    }

    #[test]
    fn what_is_not_listed_fails() {
        let demands = [bytes(0, 0, b"A")];
        let extra = sent(&[(0, b'A'), (5_000, b'B')]);
        let mismatch =
            Mismatch { at: Micros(5_000), due: Micros(5_000), expected: None, observed: Some(1) };
        assert_eq!(judge(&demands, &extra), Err(mismatch));
        let other =
            seen(&[(0, Observed::Byte(b'A')), (1_042, Observed::Done { job: JobId(1), sent: 1 })]);
        assert!(judge(&demands, &other).is_err());
    }

    #[test]
    fn what_does_not_happen_fails_at_its_time() {
        let demands = [bytes(0, 0, b"A"), done(1_042, 1)];
        let mismatch = Mismatch {
            at: Micros(1_042),
            due: Micros(1_042),
            expected: Some((1, 0)),
            observed: None,
        };
        assert_eq!(judge(&demands, &sent(&[(0, b'A')])), Err(mismatch));
    }

    #[test]
    fn lines_of_one_kind_and_time_have_an_order() {
        let demands = [done(5, 1), done(5, 2)];
        let done = |id| (5, Observed::Done { job: JobId(id), sent: 0 });
        assert_eq!(judge(&demands, &seen(&[done(1), done(2)])), Ok(()));
        let mismatch =
            Mismatch { at: Micros(5), due: Micros(5), expected: Some((0, 0)), observed: Some(0) };
        assert_eq!(judge(&demands, &seen(&[done(2), done(1)])), Err(mismatch));
    }

    #[test]
    fn lines_of_different_kinds_have_none() {
        let demands = [done(5, 1), bytes(5, 5, b"A")];
        let both =
            seen(&[(5, Observed::Byte(b'A')), (5, Observed::Done { job: JobId(1), sent: 0 })]);
        assert_eq!(judge(&demands, &both), Ok(()));
    }

    #[test]
    fn the_first_character_follows_nothing_not_even_at_time_zero() {
        let mut run = Run::new(LineParameters::new(9_600));
        assert!(!run.add(Micros::ZERO));
        assert!(run.add(run.end()));
        assert!(!run.add(run.end() + Micros(1)));
    }
}
