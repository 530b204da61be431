//! Settings of sessions: every pair of values comes together early.

use crate::dice::Dice;
use std::cell::RefCell;

/// Candidates for each row; the one with most new pairs is taken.
const CANDIDATES: usize = 16;
/// Rows that look at each other. A row counts on those of its block before it, which
/// are drawn anew each time.
const BLOCK: u64 = 64;

/// The rows of a block, and what they were drawn from.
struct Block {
    counts: Vec<usize>,
    seed: u64,
    number: u64,
    rows: Vec<Vec<usize>>,
}

thread_local! {
    /// The last block: sessions are drawn in their order, and the same ones for each engine.
    static LAST: RefCell<Option<Block>> = const { RefCell::new(None) };
}

/// Row `number` of settings, as places in the lists of `counts`. Every other row
/// mostly has the first value of each; the rest are drawn so that pairs of values
/// that have not met yet meet. Rows depend on the seed and `counts` alone.
pub(crate) fn row(counts: &[usize], seed: u64, number: u64) -> Vec<usize> {
    let block = number / BLOCK;
    let is_it = |last: &Block| last.number == block && last.seed == seed && last.counts == counts;
    let last = LAST.take().filter(is_it).unwrap_or_else(|| Block {
        counts: counts.to_vec(),
        seed,
        number: block,
        rows: rows(counts, seed, block),
    });
    let row = last.rows[(number % BLOCK) as usize].clone();
    LAST.set(Some(last));
    row
}

fn rows(counts: &[usize], seed: u64, block: u64) -> Vec<Vec<usize>> {
    let mut met = Met::new(counts);
    let mut rows = Vec::with_capacity(BLOCK as usize);
    for number in 0..BLOCK {
        let mut dice = Dice::new(seed, "settings", block * BLOCK + number);
        let row = if number % 2 == 0 {
            mostly_first(counts, &mut dice)
        } else {
            best(counts, &met, &mut dice)
        };
        met.add(&row);
        rows.push(row);
    }
    rows
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
        for a in 0..row.len() {
            for b in a + 1..row.len() {
                let pair = self.pair(row, a, b);
                self.pairs[pair] = true;
            }
        }
    }

    fn new_pairs(&self, row: &[usize]) -> usize {
        let pairs = |a: usize| (a + 1..row.len()).map(move |b| self.pair(row, a, b));
        (0..row.len()).flat_map(pairs).filter(|pair| !self.pairs[*pair]).count()
    }

    /// Where it is kept whether the values of settings `a` and `b` have met.
    fn pair(&self, row: &[usize], a: usize, b: usize) -> usize {
        (self.first[a] + row[a]) * self.values + self.first[b] + row[b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_the_same_whatever_was_asked_for_before() {
        let counts = [4, 3, 3, 2];
        let asked = [(1, 70), (1, 3), (2, 70), (1, 71), (1, 70), (1, 0)];
        for (seed, number) in asked {
            let (block, place) = (number / BLOCK, number % BLOCK);
            assert_eq!(row(&counts, seed, number), rows(&counts, seed, block)[place as usize]);
            assert_eq!(row(&counts[..2], seed, number).len(), 2);
        }
    }

    #[test]
    fn pairs_meet_much_earlier_than_by_chance() {
        let counts = [4, 3, 3, 2, 5, 2, 3, 4];
        let mut met = Met::new(&counts);
        for row in rows(&counts, 1, 0) {
            met.add(&row);
        }
        let all: usize = (0..counts.len())
            .flat_map(|a| (a + 1..counts.len()).map(move |b| counts[a] * counts[b]))
            .sum();
        assert_eq!(met.pairs.iter().filter(|is_met| **is_met).count(), all);
    }
}
