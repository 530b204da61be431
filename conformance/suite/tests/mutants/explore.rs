//! Exploring finds each promise broken that a mutant breaks: one that was never seen broken might not be
//! looked at at all.

use softplug_conformance::mutants::{Catalogue, wake};
use softplug_explore::{Bounds, Breach, Changes, explore, plans};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::{catalogues, modules};

/// Promise, mutant, configuration and faults. Without the profile's model,
/// which would speak first, but where it is what speaks.
const BROKEN: &[(&str, &str, &str, u8)] = &[
    ("altered", "r3964.rx.deliver/last-byte-lost", "one-block", 0),
    ("invented", "fanuc-rs232.feed.resume/ignored", "read-and-punch", 0),
    ("lost", "xon-xoff.link.swap/silence-not-timed", "hold", 1),
    ("doubled", "3964.line.frame/check-character-sent", "one-block", 0),
    ("not-delivered", "xon-xoff.tx.done-when-left/when-queued", "hold", 0),
    ("failed-for-nothing", "r3964-simplified.rx.set-up/stx-not-answered", "one-block", 0),
    ("wrong-on-line", "heidenhain-fe.line.check/without-begin", "both-ways", 0),
    ("sent-while-held", "xon-xoff.tx.obey-xoff/ignored", "hold", 0),
    ("cut", "xon-xoff.tx.no-leak/first-only", "strings", 1),
    ("stands-still", "r3964.tx.too-long/one-more", "split", 0),
    ("rule", "xon-xoff.tx.line-ends/lf-cr-two", "line-ends", 1),
];

/// For these there is no mutant: a fault is the host's word, and no clause of ours can be broken so
/// that a plug-in goes on for ever.
const WITHOUT: [&str; 2] = ["fault", "never-ends"];

#[test]
fn each_promise_is_found_broken_by_a_mutant() {
    let folder = modules();
    let catalogues = catalogues();
    for &(promise, id, name, faults) in BROKEN {
        let changes = Changes { without_model: promise != "rule", ..Changes::default() };
        let breach = found(&folder, &catalogues, id, name, &changes, faults);
        assert_eq!(breach.as_deref(), Some(promise), "{id} in {name}");
    }
    let covered: BTreeSet<&str> =
        BROKEN.iter().map(|(promise, ..)| *promise).chain(WITHOUT).collect();
    assert_eq!(covered, BTreeSet::from(Breach::NAMES));
}

fn found(
    folder: &Path,
    catalogues: &[Catalogue],
    id: &str,
    name: &str,
    changes: &Changes,
    faults: u8,
) -> Option<String> {
    let (profile, mutant) = catalogues
        .iter()
        .find_map(|catalogue| {
            let mutant = catalogue.mutants.iter().find(|mutant| mutant.id == id)?;
            Some((&catalogue.profile, mutant))
        })
        .unwrap_or_else(|| panic!("there is no mutant {id}"));
    let module = fs::read(folder.join(format!("{}.wasm", mutant.plugin))).unwrap();
    let module = wake(&module, id).unwrap();
    let plan = plans(profile).unwrap().into_iter().find(|plan| plan.name == name).unwrap();
    let bounds = Bounds { faults, ..Bounds::default() };
    let never = AtomicBool::new(false);
    let explored = explore(&module, plan, changes, &bounds, &|_| {}, &never).unwrap();
    explored.counterexample.map(|found| found.breach.name().to_owned())
}
