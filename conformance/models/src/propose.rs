//! Proposals, and times that are worth waiting.

use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use softplug_abi::{LineParameters, Micros};

pub(crate) fn come(wait: i64, bytes: Vec<u8>) -> Proposal {
    if bytes.is_empty() { give(wait, Given::Nothing) } else { line(wait, LineInput::Bytes(bytes)) }
}

pub(crate) fn line(wait: i64, input: LineInput) -> Proposal {
    give(wait, Given::Line(input))
}

pub(crate) fn host(wait: i64, request: HostRequest) -> Proposal {
    give(wait, Given::Host(request))
}

/// After so many µs, one at least.
pub(crate) fn give(wait: i64, given: Given) -> Proposal {
    Proposal { wait: Micros(wait.max(1)), given }
}

/// Where time stands on a line.
pub(crate) struct Pace {
    pub(crate) line: LineParameters,
    /// When the latest character began.
    pub(crate) began: Micros,
    pub(crate) now: Micros,
}

impl Pace {
    /// A time near the ends of characters, in µs.
    pub(crate) fn within(&self, dice: &mut Dice) -> i64 {
        let next = self.began + Micros(self.characters(1));
        match dice.below(6) {
            0..=2 if next > self.now => (next - self.now).0 + dice.between(-1, 1),
            3 => self.characters(dice.length(200)),
            _ => dice.between(1, 4 * self.characters(1)),
        }
    }

    /// Some time in µs: characters, or up to some seconds.
    pub(crate) fn pause(&self, dice: &mut Dice) -> i64 {
        match dice.below(8) {
            0..=3 => self.within(dice),
            4..=5 => dice.between(1, 500_000),
            6 => dice.between(1, 5_000_000),
            _ => self.characters(dice.length(1_000)),
        }
    }

    /// So many characters in µs.
    pub(crate) fn characters(&self, count: usize) -> i64 {
        self.line.characters(count as u64).0
    }
}
