//! The ways in which one trace is run, and their names.

use super::cut::Cuts;
use crate::given::load::Case;
use crate::given::timeline::{Timeline, TimelineError, Windows, windows};
use softplug_abi::manifest::Manifest;
use std::fmt;
use std::str::FromStr;

/// Random cuts of each trace.
const RANDOM_CUTS: u8 = 32;
/// Runs with a single swap of each trace, at most.
const SINGLE_SWAPS: u32 = 200;

/// One way to run a trace. The name stands behind the trace's id: `ID/cut:1`.
///
/// ```
/// use softplug_conformance::Permutation;
///
/// assert_eq!("cut:random-07".parse(), Ok(Permutation::CutRandom(7)));
/// assert_eq!(Permutation::SwapAfter(12).to_string(), "swap:12");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Permutation {
    /// `uncut`: as it is written.
    Uncut,
    /// `late`, `late:N`: all inputs with a window, or only the Nth of them, at
    /// the window's end.
    Late(Option<u32>),
    /// `cut:1`: bytes of one time one by one.
    CutSingly,
    /// `cut:whole`: bytes of one time at once.
    CutWhole,
    /// `cut:random-NN`: bytes of one time cut at random places.
    CutRandom(u8),
    /// `twice`: in an instance that has run it before, closed and opened again.
    Twice,
    /// `swap:all`: saved and restored into a fresh instance after every event.
    SwapAll,
    /// `swap:N`: the same, but only at the Nth place.
    SwapAfter(u32),
}

impl Permutation {
    /// Every way but the single swaps: how many of these there are shows only in
    /// a run.
    pub(crate) fn without_swaps(
        case: &Case,
        manifest: &Manifest,
    ) -> Result<Vec<Self>, TimelineError> {
        let mut all = vec![Self::Uncut];
        if case.trace.is_recording() {
            return Ok(all);
        }
        let permute = case.trace.front.permute;
        match windows(case) {
            0 => {}
            1 => all.push(Self::Late(None)),
            count => {
                all.push(Self::Late(None));
                all.extend((1..=count).map(|number| Self::Late(Some(number))));
            }
        }
        if permute.cuts && Timeline::new(case, manifest, Windows::Early)?.can_be_cut() {
            all.extend([Self::CutSingly, Self::CutWhole]);
            all.extend((1..=RANDOM_CUTS).map(Self::CutRandom));
        }
        if permute.twice {
            all.push(Self::Twice);
        }
        Ok(all)
    }

    /// The runs with swaps, at `places`; where there are very many, evenly spread.
    pub(crate) fn swaps(case: &Case, manifest: &Manifest, places: u32) -> Vec<Self> {
        if !case.trace.front.permute.swap || manifest.state.saves.is_none() || places == 0 {
            return Vec::new();
        }
        let count = places.min(SINGLE_SWAPS);
        let place =
            |number: u32| 1 + (u64::from(number) * u64::from(places) / u64::from(count)) as u32;
        let single = (0..count).map(|number| Self::SwapAfter(place(number)));
        std::iter::once(Self::SwapAll).chain(single).collect()
    }

    /// How it cuts bytes of one time; the seed changes where random cuts fall.
    pub(crate) fn cuts(self, seed: u64) -> Cuts {
        match self {
            Self::CutSingly => Cuts::Singly,
            Self::CutWhole => Cuts::Whole,
            Self::CutRandom(number) => Cuts::Random(number, seed),
            _ => Cuts::AsWritten,
        }
    }

    /// Whether it must show the same as the uncut run, to the µs.
    pub(crate) fn equals_uncut(self) -> bool {
        !matches!(self, Self::Uncut | Self::Late(_))
    }
}

impl fmt::Display for Permutation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uncut => f.write_str("uncut"),
            Self::Late(None) => f.write_str("late"),
            Self::Late(Some(number)) => write!(f, "late:{number}"),
            Self::CutSingly => f.write_str("cut:1"),
            Self::CutWhole => f.write_str("cut:whole"),
            Self::CutRandom(number) => write!(f, "cut:random-{number:02}"),
            Self::Twice => f.write_str("twice"),
            Self::SwapAll => f.write_str("swap:all"),
            Self::SwapAfter(place) => write!(f, "swap:{place}"),
        }
    }
}

/// A permutation has no such name.
///
/// ```
/// use softplug_conformance::Permutation;
///
/// let error = "cut:2".parse::<Permutation>().unwrap_err();
/// assert!(error.to_string().starts_with("there is no permutation \"cut:2\"; there are uncut,"));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "there is no permutation \"{0}\"; there are uncut, late, late:N, cut:1, cut:whole, \
     cut:random-NN, twice, swap:all and swap:N"
)]
pub struct UnknownPermutation(String);

impl FromStr for Permutation {
    type Err = UnknownPermutation;

    fn from_str(name: &str) -> Result<Self, UnknownPermutation> {
        let unknown = || UnknownPermutation(name.to_owned());
        let number = |text: &str| text.parse::<u32>().ok().filter(|number| *number > 0);
        let permutation = match name.split_once(':') {
            None => match name {
                "uncut" => Some(Self::Uncut),
                "late" => Some(Self::Late(None)),
                "twice" => Some(Self::Twice),
                _ => None,
            },
            Some(("late", count)) => number(count).map(|count| Self::Late(Some(count))),
            Some(("cut", "1")) => Some(Self::CutSingly),
            Some(("cut", "whole")) => Some(Self::CutWhole),
            Some(("cut", random)) => random
                .strip_prefix("random-")
                .and_then(number)
                .and_then(|count| u8::try_from(count).ok())
                .map(Self::CutRandom),
            Some(("swap", "all")) => Some(Self::SwapAll),
            Some(("swap", place)) => number(place).map(Self::SwapAfter),
            _ => None,
        };
        // Only the name as it is printed: "swap:012" is another word.
        permutation.filter(|known| known.to_string() == name).ok_or_else(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_again() {
        let all = [
            Permutation::Uncut,
            Permutation::Late(None),
            Permutation::Late(Some(3)),
            Permutation::CutSingly,
            Permutation::CutWhole,
            Permutation::CutRandom(7),
            Permutation::Twice,
            Permutation::SwapAll,
            Permutation::SwapAfter(12),
        ];
        for permutation in all {
            assert_eq!(permutation.to_string().parse(), Ok(permutation));
        }
        assert_eq!(Permutation::CutRandom(7).to_string(), "cut:random-07");
        for wrong in ["", "cut", "cut:2", "cut:random-7", "swap:0", "swap:012", "late:", "Uncut"] {
            assert!(wrong.parse::<Permutation>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn only_the_run_as_written_and_late_inputs_stand_for_themselves() {
        assert!(!Permutation::Uncut.equals_uncut());
        assert!(!Permutation::Late(None).equals_uncut());
        for other in [Permutation::CutSingly, Permutation::Twice, Permutation::SwapAll] {
            assert!(other.equals_uncut());
        }
    }

    #[test]
    fn a_permutation_names_its_cuts() {
        let of = |permutation: Permutation| permutation.cuts(9);
        assert!(matches!(of(Permutation::Uncut), Cuts::AsWritten));
        assert!(matches!(of(Permutation::SwapAll), Cuts::AsWritten));
        assert!(matches!(of(Permutation::CutSingly), Cuts::Singly));
        assert!(matches!(of(Permutation::CutWhole), Cuts::Whole));
        assert!(matches!(of(Permutation::CutRandom(3)), Cuts::Random(3, 9)));
    }

    #[test]
    fn swaps_need_a_trace_that_allows_them_a_state_and_a_place() {
        let manifest = |state: &str| {
            let text = format!(
                r#"{{"abi": "1.0", "name": "x", "version": "1.0.0", "licence": "MIT", "protocol": "none",
                "description": "For the suite's own tests."{state}}}"#
            );
            Manifest::parse(text.as_bytes()).unwrap()
        };
        let case = |permute: &str| {
            let text = format!(
                "id: x.a\ntitle: T\nprofile: x\nclauses: x.a\nlevel: may\n\
                 line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n{permute}---\n. 1.0\n"
            );
            Case::new("x.a.spt", softplug_trace::Trace::parse(&text).unwrap())
        };
        let saves = manifest(r#", "state": {"saves": 1, "accepts": [1]}"#);
        let all = Permutation::swaps(&case(""), &saves, 2);
        let both = [Permutation::SwapAll, Permutation::SwapAfter(1), Permutation::SwapAfter(2)];
        assert_eq!(all, both);
        for none in [
            Permutation::swaps(&case("permute: cuts\n"), &saves, 2),
            Permutation::swaps(&case(""), &manifest(""), 2),
            Permutation::swaps(&case(""), &saves, 0),
        ] {
            assert_eq!(none, []);
        }
    }
}
