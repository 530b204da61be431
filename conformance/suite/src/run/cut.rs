//! The same bytes of one time, cut differently.

use crate::given::timeline::{Given, Input, Timeline};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};

/// How the bytes of one time are cut.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Cuts {
    /// As the trace's lines stand.
    AsWritten,
    /// One byte after the other.
    Singly,
    /// All at once, however many lines they stand on.
    Whole,
    /// At random places: the number of the run, and the seed of all runs.
    Random(u8, u64),
}

impl Timeline {
    /// Whether there is anything to cut.
    pub(crate) fn can_be_cut(&self) -> bool {
        let joined = self.clone().cut("", Cuts::Whole);
        joined.given.iter().any(|given| matches!(&given.what, Input::Bytes(run) if run.len() > 1))
    }

    /// This timeline with its bytes cut; random places depend on `id`, the number
    /// and the seed alone.
    pub(crate) fn cut(self, id: &str, cuts: Cuts) -> Self {
        let given = match cuts {
            Cuts::AsWritten => return self,
            Cuts::Singly => recut(self.given, |_, _| true),
            Cuts::Whole => recut(join(self.given), |_, _| false),
            Cuts::Random(number, seed) => {
                let seed = Sha256::digest(format!("{id}/{number}/{seed}"));
                let mut random = ChaCha8Rng::from_seed(seed.into());
                // Few and many cuts are both worth trying: each run draws how many.
                let mut chance = 0;
                recut(join(self.given), move |first, _| {
                    if first {
                        chance = 1 + random.next_u32() % 7;
                    }
                    random.next_u32() % 8 < chance
                })
            }
        };
        Self { given, end: self.end }
    }
}

/// Neighbouring bytes of one time become one run.
fn join(given: Vec<Given>) -> Vec<Given> {
    let mut joined: Vec<Given> = Vec::with_capacity(given.len());
    for next in given {
        if let (Some(Given { at, what: Input::Bytes(run) }), Input::Bytes(more)) =
            (joined.last_mut(), &next.what)
            && *at == next.at
        {
            run.extend(more);
            continue;
        }
        joined.push(next);
    }
    joined
}

/// Cuts each run behind those bytes for which `is_cut` says so; it is told
/// whether the byte is the first of its run.
fn recut(given: Vec<Given>, mut is_cut: impl FnMut(bool, u8) -> bool) -> Vec<Given> {
    let mut cut = Vec::with_capacity(given.len());
    for Given { at, what } in given {
        let Input::Bytes(run) = what else {
            cut.push(Given { at, what });
            continue;
        };
        let mut piece = Vec::new();
        for (place, byte) in run.iter().enumerate() {
            piece.push(*byte);
            if is_cut(place == 0, *byte) || place + 1 == run.len() {
                cut.push(Given { at, what: Input::Bytes(std::mem::take(&mut piece)) });
            }
        }
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::Micros;

    fn timeline() -> Timeline {
        let bytes = |at, run: &[u8]| Given { at: Micros(at), what: Input::Bytes(run.to_vec()) };
        Timeline { given: vec![bytes(1, b"AB"), bytes(1, b"CDEF"), bytes(2, b"G")], end: Micros(3) }
    }

    fn pieces(timeline: &Timeline) -> Vec<(i64, String)> {
        let text = |given: &Given| match &given.what {
            Input::Bytes(run) => (given.at.0, String::from_utf8_lossy(run).into_owned()),
            other => panic!("{other:?} was not there"),
        };
        timeline.given.iter().map(text).collect()
    }

    #[test]
    fn bytes_keep_their_time_and_order_however_they_are_cut() {
        let owned = |list: &[(i64, &str)]| {
            list.iter().map(|(at, text)| (*at, (*text).to_owned())).collect::<Vec<_>>()
        };
        assert_eq!(pieces(&timeline().cut("x", Cuts::Whole)), owned(&[(1, "ABCDEF"), (2, "G")]));
        assert_eq!(pieces(&timeline().cut("x", Cuts::Singly)).len(), 7);
        let mut seen = std::collections::BTreeSet::new();
        for number in 1..=32 {
            let cut = pieces(&timeline().cut("x", Cuts::Random(number, 0)));
            let joined: String = cut.iter().map(|(_, text)| text.as_str()).collect();
            assert_eq!(joined, "ABCDEFG");
            assert_eq!(cut.last(), Some(&(2, "G".to_owned())));
            assert_eq!(
                cut,
                pieces(&timeline().cut("x", Cuts::Random(number, 0))),
                "not reproducible"
            );
            seen.insert(cut);
        }
        assert!(seen.len() > 10, "only {} different cuts", seen.len());
    }

    /// A verdict names its run: everybody must get the same cuts.
    #[test]
    fn random_cuts_are_frozen() {
        let run = |at| Given { at: Micros(at), what: Input::Bytes(vec![b'x'; 40]) };
        let lengths = |number, seed| {
            let timeline = Timeline { given: vec![run(1), run(2)], end: Micros(3) };
            let cut = pieces(&timeline.cut("some.case", Cuts::Random(number, seed)));
            cut.iter().map(|(_, text)| text.len()).collect::<Vec<_>>()
        };
        let frozen = (1..=8)
            .map(|number| (number, 0))
            .chain([(1, 1)])
            .map(|(number, seed)| format!("{number}, seed {seed}: {:?}\n", lengths(number, seed)));
        insta::assert_snapshot!(frozen.collect::<String>());
    }

    #[test]
    fn single_bytes_leave_nothing_to_cut() {
        assert!(timeline().can_be_cut());
        let single = Timeline { given: vec![timeline().given.pop().unwrap()], end: Micros(3) };
        assert!(!single.can_be_cut());
    }
}
