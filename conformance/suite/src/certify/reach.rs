//! What each run of a case executes.

use crate::corpus::{Listed, Source};
use crate::judge::run::{Judge, Start};
use crate::module::executed::{Executed, Watcher};
use crate::random::Sessions;
use crate::run::permute::Permutation;

/// One run of a case.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Run {
    /// A trace as it is written, or a script.
    Case,
    Permutation(Permutation),
    /// By its number.
    Session(u64),
}

/// How much of a case is run.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Extent {
    Whole,
    /// Without permutations.
    Uncut,
}

/// Runs a case and tells what each of its runs executed. False: it was stopped.
pub(crate) fn each_run(
    watcher: &Watcher,
    listed: &Listed<'_>,
    extent: Extent,
    sessions: Sessions,
    is_over: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(Run, Executed),
) -> bool {
    watcher.take();
    match listed.source {
        Source::Trace(case) => {
            let start = Start::new(watcher, case);
            tell(Run::Case, watcher.take());
            if extent == Extent::Uncut {
                return true;
            }
            for permutation in start.permutations() {
                if is_over() {
                    return false;
                }
                if permutation != Permutation::Uncut {
                    start.judge(&permutation, 0);
                    tell(Run::Permutation(permutation), watcher.take());
                }
            }
        }
        Source::Script(script) => {
            Judge::run_script(watcher, script);
            tell(Run::Case, watcher.take());
        }
        Source::Sessions(group) => {
            for number in sessions.numbers(group.number) {
                if is_over() {
                    return false;
                }
                if group.session(watcher, sessions.seed, number).is_some() {
                    tell(Run::Session(number), watcher.take());
                }
            }
        }
    }
    true
}
