//! Chance, from a seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};

/// Chance that a seed repeats.
///
/// ```
/// use softplug_models::Dice;
///
/// let draw = |seed| Dice::new(seed, "xon-xoff", 1).below(1_000);
/// assert_eq!(draw(7), draw(7));
/// ```
#[derive(Clone, Debug)]
pub struct Dice(ChaCha8Rng);

impl Dice {
    /// For the session with this number, of a profile.
    pub fn new(seed: u64, profile: &str, number: u64) -> Self {
        let seed = Sha256::digest(format!("{profile}/{number}/{seed}"));
        Self(ChaCha8Rng::from_seed(seed.into()))
    }

    /// Another chance, which draws from this one once.
    pub(crate) fn fork(&mut self) -> Self {
        Self(ChaCha8Rng::seed_from_u64(self.0.next_u64()))
    }

    /// A number from 0 to `end - 1`; 0 if `end` is 0.
    pub fn below(&mut self, end: u64) -> u64 {
        if end == 0 { 0 } else { self.0.next_u64() % end }
    }

    /// A number from `first` to `last`.
    pub fn between(&mut self, first: i64, last: i64) -> i64 {
        first + self.below((last - first).max(0) as u64 + 1) as i64
    }

    /// True once in `count` times.
    pub fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }

    /// One of them. There must be one.
    pub fn pick<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len() as u64) as usize]
    }

    /// Any byte.
    pub fn byte(&mut self) -> u8 {
        self.below(256) as u8
    }

    /// A length: mostly short, now and then near a power of two, seldom long.
    pub fn length(&mut self, longest: usize) -> usize {
        let length = match self.below(16) {
            0 => 0,
            1..=9 => self.below(20),
            10..=12 => (1 << self.below(10)) + self.below(3),
            13 | 14 => self.below(300),
            _ => self.below(longest as u64 + 1),
        };
        (length as usize).min(longest)
    }
}
