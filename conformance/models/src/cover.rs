//! Settings of sessions: every pair of values comes together early.

use crate::dice::Dice;

/// Candidates for each row; the one with most new pairs is taken.
const CANDIDATES: usize = 16;
/// Rows that look at each other. A row counts on those of its block before it, which
/// are drawn anew each time.
const BLOCK: u64 = 64;

/// Row `number` of settings, as places in the lists of `counts`. Every other row
/// mostly has the first value of each; the rest are drawn so that pairs of values
/// that have not met yet meet. Rows depend on the seed and `counts` alone.
pub(crate) fn row(counts: &[usize], seed: u64, number: u64) -> Vec<usize> {
    let mut met = Met::new(counts);
    let mut row = Vec::new();
    for at in number - number % BLOCK..=number {
        let mut dice = Dice::new(seed, "settings", at);
        row = if at % 2 == 0 {
            mostly_first(counts, &mut dice)
        } else {
            best(counts, &met, &mut dice)
        };
        met.add(&row);
    }
    row
}

fn mostly_first(counts: &[usize], dice: &mut Dice) -> Vec<usize> {
    let place = |count: &usize| match dice.below(8) {
        0 => dice.below(*count as u64) as usize,
        _ => 0,
    };
    counts.iter().map(place).collect()
}

fn best(counts: &[usize], met: &Met, dice: &mut Dice) -> Vec<usize> {
    let mut best = (0, Vec::new());
    for _ in 0..CANDIDATES {
        let row: Vec<usize> =
            counts.iter().map(|count| dice.below(*count as u64) as usize).collect();
        let new = met.new_pairs(&row);
        if best.1.is_empty() || new > best.0 {
            best = (new, row);
        }
    }
    best.1
}

/// Pairs of values that stood in one row.
struct Met {
    /// The number of each setting's first value.
    first: Vec<usize>,
    values: usize,
    pairs: Vec<bool>,
}

impl Met {
    fn new(counts: &[usize]) -> Self {
        let first = (0..counts.len()).map(|place| counts[..place].iter().sum()).collect();
        let values = counts.iter().sum();
        Self { first, values, pairs: vec![false; values * values] }
    }

    fn add(&mut self, row: &[usize]) {
        for (a, b) in self.places(row) {
            self.pairs[a * self.values + b] = true;
        }
    }

    fn new_pairs(&self, row: &[usize]) -> usize {
        self.places(row).iter().filter(|(a, b)| !self.pairs[a * self.values + b]).count()
    }

    fn places(&self, row: &[usize]) -> Vec<(usize, usize)> {
        let value = |place: usize| self.first[place] + row[place];
        let pairs = |a: usize| (a + 1..row.len()).map(move |b| (value(a), value(b)));
        (0..row.len()).flat_map(pairs).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_meet_much_earlier_than_by_chance() {
        let counts = [4, 3, 3, 2, 5, 2, 3, 4];
        let mut met = Met::new(&counts);
        for number in 0..BLOCK {
            met.add(&row(&counts, 1, number));
        }
        let all: usize = (0..counts.len())
            .flat_map(|a| (a + 1..counts.len()).map(move |b| counts[a] * counts[b]))
            .sum();
        assert_eq!(met.pairs.iter().filter(|is_met| **is_met).count(), all);
    }
}
