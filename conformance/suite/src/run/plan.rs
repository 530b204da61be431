//! Which permutations a case is run in.

use super::permute::{Clock, Permutation, Rooms};
use super::replay::REST;
use crate::given::case::Case;
use crate::given::timeline::{Timeline, TimelineError, Windows, windows};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};
use softplug_abi::manifest::Manifest;
use softplug_trace::{self as trace, ByteClass, Drain, HostRequest, What};

/// Random cuts of each trace.
const RANDOM_CUTS: u8 = 32;
/// Runs with a single swap of each trace, at most.
const SINGLE_SWAPS: u32 = 200;
/// How often a case stands behind itself at most, and how many inputs that may be.
const AGAIN: u32 = 40;
const AGAIN_INPUTS: u32 = 2_000;

/// Every permutation of a case, the uncut run first, for a plug-in of which the uncut
/// run had so many places for a swap. `speaks_first`: it does something on an open
/// line of itself.
pub(crate) fn permutations(
    case: &Case,
    manifest: &Manifest,
    swap_places: u32,
    speaks_first: bool,
) -> Result<Vec<Permutation>, TimelineError> {
    let mut all = vec![Permutation::Uncut];
    if case.trace.is_recording() {
        return Ok(all);
    }
    match windows(case) {
        0 => {}
        1 => all.push(Permutation::Late(None)),
        count => {
            all.push(Permutation::Late(None));
            all.extend((1..=count).map(|number| Permutation::Late(Some(number))));
        }
    }
    let timeline = Timeline::new(case, manifest, Windows::Early)?;
    let axes = [
        cuts(case, &timeline),
        starts(case, &timeline, speaks_first),
        swaps(case, manifest, swap_places),
        rooms(case),
    ];
    let pairs = pairs(&axes, &case.trace.front.id);
    all.extend(axes.into_iter().flatten());
    all.extend(pairs);
    // Beside nothing else: it takes long.
    if case.trace.front.permute.after && !speaks_first {
        all.extend(case.long.map(|count| again(count, &timeline)));
    }
    all.extend(case.trace.front.bytes.iter().flat_map(ByteClass::others).map(Permutation::Byte));
    Ok(all)
}

fn cuts(case: &Case, timeline: &Timeline) -> Vec<Permutation> {
    if !case.trace.front.permute.cuts || !timeline.can_be_cut() {
        return Vec::new();
    }
    let fixed = [Permutation::CutSingly, Permutation::CutWhole];
    fixed.into_iter().chain((1..=RANDOM_CUTS).map(Permutation::CutRandom)).collect()
}

/// The runs with swaps, at `places`; where there are very many, evenly spread.
fn swaps(case: &Case, manifest: &Manifest, places: u32) -> Vec<Permutation> {
    if !case.trace.front.permute.swap || manifest.state.saves.is_none() || places == 0 {
        return Vec::new();
    }
    let count = places.min(SINGLE_SWAPS);
    let place = |number: u32| 1 + (u64::from(number) * u64::from(places) / u64::from(count)) as u32;
    let single = (0..count).map(|number| Permutation::SwapAfter(place(number)));
    std::iter::once(Permutation::SwapAll).chain(single).collect()
}

/// Another clock, or something else before it.
fn starts(case: &Case, timeline: &Timeline, speaks_first: bool) -> Vec<Permutation> {
    let permute = case.trace.front.permute;
    let mut all = Vec::new();
    if permute.twice {
        all.push(Permutation::Twice);
    }
    if permute.later {
        all.extend(Clock::ALL.map(Permutation::Later));
    }
    if permute.after && !speaks_first {
        all.extend(Clock::ALL.map(Permutation::Idle));
        let before = case.before.iter().map(|case| case.trace.front.id.as_str());
        all.extend(before.map(|id| Permutation::After(id.into())));
        if case.leaves_nothing() {
            let inputs = (timeline.given.len() as u32).max(1);
            all.push(again(AGAIN.min(AGAIN_INPUTS.div_ceil(inputs)), timeline));
        }
    }
    all
}

/// So often behind itself, or as often as a quarter of the clock has room for.
fn again(count: u32, timeline: &Timeline) -> Permutation {
    let most = (i64::MAX / 4) / (timeline.end + REST).0;
    Permutation::Again(count.min(u32::try_from(most).unwrap_or(u32::MAX)))
}

/// None where the course hangs on a room: the case names it, or gives it by hand.
fn rooms(case: &Case) -> Vec<Permutation> {
    let front = &case.trace.front;
    let is_by_hand = case.trace.inputs().any(|entry| {
        matches!(entry.what, What::Given(trace::Given::Host(HostRequest::Drain(Drain::Off))))
    });
    let is_free = front.permute.rooms
        && front.room.transmit.is_none()
        && front.room.delivery.is_none()
        && !is_by_hand;
    let all = if is_free { &Rooms::ALL[..] } else { &[] };
    all.iter().map(|rooms| Permutation::Rooms(*rooms)).collect()
}

/// One pair from each two axes, drawn by the case's id.
fn pairs(axes: &[Vec<Permutation>; 4], id: &str) -> Vec<Permutation> {
    let mut random = ChaCha8Rng::from_seed(Sha256::digest(format!("{id}/pairs")).into());
    let mut pairs = Vec::new();
    for (place, first) in axes.iter().enumerate() {
        for second in &axes[place + 1..] {
            let mut draw = |all: &[Permutation]| {
                let place = random.next_u64() % (all.len() as u64).max(1);
                all.get(place as usize).cloned()
            };
            if let Some((first, second)) = draw(first).zip(draw(second)) {
                pairs.push(Permutation::both(first, second));
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::Micros;

    fn case(permute: &str) -> Case {
        let text = format!(
            "id: x.a\ntitle: T\nprofile: x\nclauses: x.a\nlevel: may\n\
             line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n{permute}---\n. 1.0\n"
        );
        Case::new("x.a.spt", softplug_trace::Trace::parse(&text).unwrap())
    }

    #[test]
    fn rooms_are_varied_where_the_case_gives_none_by_hand() {
        let count = |given: &str| {
            let text = case("").trace.format().replace("---\n", &format!("---\n{given}"));
            rooms(&Case::new("x.a.spt", softplug_trace::Trace::parse(&text).unwrap())).len()
        };
        assert_eq!(count(""), Rooms::ALL.len());
        assert_eq!(count("? 0.500000 drain off\n"), 0);
        assert_eq!(count("? 0.500000 drain auto\n"), Rooms::ALL.len());
    }

    #[test]
    fn no_case_stands_behind_itself_until_the_clock_has_ended() {
        let rounds = |secs| {
            let timeline = Timeline { given: Vec::new(), end: Micros::from_secs(secs) };
            again(66_000, &timeline)
        };
        assert_eq!(rounds(86_400), Permutation::Again(66_000));
        assert_eq!(rounds(999_999_999), Permutation::Again(2_305));
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
        let saves = manifest(r#", "state": {"saves": 1, "accepts": [1]}"#);
        let all = swaps(&case(""), &saves, 2);
        let both = [Permutation::SwapAll, Permutation::SwapAfter(1), Permutation::SwapAfter(2)];
        assert_eq!(all, both);
        for none in [
            swaps(&case("permute: cuts\n"), &saves, 2),
            swaps(&case(""), &manifest(""), 2),
            swaps(&case(""), &saves, 0),
        ] {
            assert_eq!(none, []);
        }
    }

    #[test]
    fn pairs_are_of_two_axes() {
        let axes = [
            vec![Permutation::CutSingly],
            vec![Permutation::SwapAll],
            vec![],
            vec![Permutation::Rooms(Rooms::Small)],
        ];
        let names: Vec<_> = pairs(&axes, "x.a").iter().map(ToString::to_string).collect();
        assert_eq!(names, ["cut:1+swap:all", "cut:1+rooms:small", "swap:all+rooms:small"]);
    }
}
