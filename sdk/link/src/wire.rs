//! A UART's transmitter in virtual time.

use alloc::collections::VecDeque;
use core::hash::{Hash, Hasher};
use softplug_abi::{LineParameters, Micros};

/// Deeper ports take memory as they fill.
const USUAL_DEPTH: usize = 4_096;

/// Characters that the port was given and that have not left yet. They leave
/// back to back: the nth of a run ends `n` character times after the run's
/// start, rounded up to a whole µs.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_link::Wire;
///
/// let mut wire = Wire::new(LineParameters::new(9_600), 1);
/// assert_eq!(wire.give(Micros(0)), Micros(0));
/// assert_eq!(wire.space(), 0);
/// assert_eq!(wire.poll_timeout(), Some(Micros(1_042)));
/// wire.handle_timeout(Micros(1_042));
/// assert_eq!((wire.left(), wire.space()), (1, 1));
/// ```
#[derive(Clone, Debug)]
pub struct Wire {
    line: LineParameters,
    depth: usize,
    run_start: Micros,
    run_length: u64,
    /// When the wire is free again.
    free_at: Micros,
    ends: VecDeque<Micros>,
    left: u64,
}

impl Wire {
    /// A transmitter that holds at most `depth` characters, the one on the wire
    /// included.
    pub fn new(line: LineParameters, depth: usize) -> Self {
        Self {
            line,
            depth: depth.max(1),
            run_start: Micros::ZERO,
            run_length: 0,
            free_at: Micros::ZERO,
            ends: VecDeque::with_capacity(depth.min(USUAL_DEPTH)),
            left: 0,
        }
    }

    /// How many characters it takes now.
    pub fn space(&self) -> usize {
        self.depth - self.ends.len()
    }

    /// Characters that have left, of all that were given.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// When the next character will have left.
    pub fn poll_timeout(&self) -> Option<Micros> {
        self.ends.front().copied()
    }

    /// When all that was given will have left.
    pub fn free_at(&self) -> Micros {
        self.free_at
    }

    /// Takes a character; returns when its start bit leaves. There must be space.
    pub fn give(&mut self, now: Micros) -> Micros {
        if self.free_at < now {
            self.run_start = now;
            self.run_length = 0;
        } else if self.free_at != self.run_end(self.run_length) {
            self.run_start = self.free_at;
            self.run_length = 0;
        }
        let start = self.run_end(self.run_length);
        self.run_length += 1;
        let end = self.run_end(self.run_length);
        self.free_at = end;
        self.ends.push_back(end);
        start
    }

    /// Sends a break after what it holds; returns when it begins.
    pub fn give_break(&mut self, now: Micros, length: Micros) -> Micros {
        let start = self.free_at.max(now);
        self.free_at = start + length;
        start
    }

    /// Lets characters leave that end at or before `now`.
    pub fn handle_timeout(&mut self, now: Micros) {
        while self.ends.front().is_some_and(|end| *end <= now) {
            self.ends.pop_front();
            self.left += 1;
        }
    }

    /// When each character ends, counted from `now`, and the part of a µs by which the run places
    /// the next ones.
    pub(crate) fn hash_ahead(&self, now: Micros, state: &mut impl Hasher) {
        let ahead = |time: Micros| time.0 - now.0;
        let Self { line: _, depth, run_start: _, run_length, free_at, ends, left: _ } = self;
        (depth, ends.len()).hash(state);
        for end in ends {
            ahead(*end).hash(state);
        }
        if *free_at >= now {
            let run_ends_here = *free_at == self.run_end(*run_length);
            let part = if run_ends_here { self.part_of_a_micro() } else { 0 };
            (ahead(*free_at), part).hash(state);
        }
    }

    /// How far the run's end, unrounded, lies behind a whole µs, in parts of two baud.
    fn part_of_a_micro(&self) -> u64 {
        let bits = u128::from(self.run_length) * u128::from(self.line.half_bits()) * 1_000_000;
        (bits % (2 * u128::from(self.line.baud.max(1)))) as u64
    }

    fn run_end(&self, characters: u64) -> Micros {
        self.run_start + self.line.characters(characters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_of_any_depth_takes_the_memory_that_it_fills() {
        let mut wire = Wire::new(LineParameters::new(9_600), usize::MAX);
        wire.give(Micros::ZERO);
        assert_eq!(wire.space(), usize::MAX - 1);
    }
}
