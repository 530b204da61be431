//! What a permutation comes to in a run.

use super::cut::Cuts;
use super::permute::{Clock, Permutation, Rooms};
use crate::given::timeline::Windows;
use std::sync::Arc;

/// How a run differs from the case as it is written.
#[derive(Clone, Debug)]
pub(crate) struct Way {
    pub(crate) windows: Windows,
    pub(crate) cuts: Cuts,
    pub(crate) swaps: Swaps,
    pub(crate) before: Before,
    pub(crate) rooms: Option<Rooms>,
    pub(crate) byte: Option<u8>,
}

/// Where the plug-in is swapped.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Swaps {
    Nowhere,
    Everywhere,
    At(u32),
}

/// What is before the case.
#[derive(Clone, Debug)]
pub(crate) enum Before {
    /// The link is opened, at 0.
    Nothing,
    /// The link is opened when its clock stands there.
    Clock(Clock),
    /// It was opened at 0, and nothing happened until then.
    Idle(Clock),
    /// The case itself, then the link was closed.
    Itself,
    /// The case itself, so many times on the open link.
    Again(u32),
    /// Another case on the open link.
    Case(Arc<str>),
}

impl Way {
    /// The seed changes where random cuts fall.
    pub(crate) fn new(permutation: &Permutation, cut_seed: u64) -> Self {
        let mut way = Self {
            windows: Windows::Early,
            cuts: Cuts::AsWritten,
            swaps: Swaps::Nowhere,
            before: Before::Nothing,
            rooms: None,
            byte: None,
        };
        for part in permutation.parts() {
            way.add(part, cut_seed);
        }
        way
    }

    fn add(&mut self, part: &Permutation, cut_seed: u64) {
        match part {
            Permutation::Uncut | Permutation::Both(_) => {}
            Permutation::Late(None) => self.windows = Windows::Late,
            Permutation::Late(Some(number)) => self.windows = Windows::LateOnly(*number),
            Permutation::CutSingly => self.cuts = Cuts::Singly,
            Permutation::CutWhole => self.cuts = Cuts::Whole,
            Permutation::CutRandom(number) => self.cuts = Cuts::Random(*number, cut_seed),
            Permutation::Twice => self.before = Before::Itself,
            Permutation::SwapAll => self.swaps = Swaps::Everywhere,
            Permutation::SwapAfter(place) => self.swaps = Swaps::At(*place),
            Permutation::Later(clock) => self.before = Before::Clock(*clock),
            Permutation::Idle(clock) => self.before = Before::Idle(*clock),
            Permutation::Rooms(rooms) => self.rooms = Some(*rooms),
            Permutation::After(id) => self.before = Before::Case(Arc::clone(id)),
            Permutation::Again(count) => self.before = Before::Again(*count),
            Permutation::Byte(byte) => self.byte = Some(*byte),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permutation_names_its_cuts() {
        let of = |permutation: &Permutation| Way::new(permutation, 9).cuts;
        assert!(matches!(of(&Permutation::Uncut), Cuts::AsWritten));
        assert!(matches!(of(&Permutation::SwapAll), Cuts::AsWritten));
        assert!(matches!(of(&Permutation::CutSingly), Cuts::Singly));
        assert!(matches!(of(&Permutation::CutWhole), Cuts::Whole));
        assert!(matches!(of(&Permutation::CutRandom(3)), Cuts::Random(3, 9)));
    }

    #[test]
    fn two_ways_come_together() {
        let both = Permutation::both(Permutation::CutWhole, Permutation::Rooms(Rooms::Odd));
        let Way { cuts, rooms, .. } = Way::new(&both, 0);
        assert_eq!((cuts, rooms), (Cuts::Whole, Some(Rooms::Odd)));
    }
}
