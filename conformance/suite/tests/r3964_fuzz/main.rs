//! The 3964 family under random data, cuts, faults and noise.
//!
//! `SOFTPLUG_FUZZ_CASES` says how many cases each test runs (2,000), and
//! `SOFTPLUG_FUZZ_SEED` the seed of the first (0). A failure prints its seed and
//! the simplest case that still fails.

mod case;
mod oracle;
#[path = "../common/pair.rs"]
mod pair;
mod run;

use case::Subject;

#[test]
fn two_stations_keep_the_promise() {
    run::many(Subject::Station);
}

#[test]
fn r3964_keeps_the_promise() {
    run::many(Subject::R3964);
}

#[test]
fn simplified_keeps_the_promise() {
    run::many(Subject::Simplified);
}
