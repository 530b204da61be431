//! Runs the cases of a profile against a mutant until one sees wrong behaviour.

use super::Mutant;
use crate::run::Start;
use crate::{Case, Failure, Judge, Permutation};

/// What came of one mutant.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Hunt {
    /// The first run that saw wrong behaviour; `None`: it survived all of them.
    pub kill: Option<Kill>,
    /// Runs before that which failed in a way that proves nothing.
    pub not_kills: Vec<NotAKill>,
    /// How many runs there were.
    pub runs: usize,
}

/// A run that saw wrong behaviour.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Kill {
    /// The case with its permutation.
    pub run: String,
    /// The kind of wrong behaviour, by the name that reports use.
    pub class: String,
    /// Whether the case cites the broken clause.
    pub cites: bool,
}

/// A run that failed, but not by wrong behaviour: a trap, an exhausted budget, a
/// broken rule of the ABI, a refusal.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NotAKill {
    /// The case with its permutation.
    pub run: String,
    /// What happened instead, by the name that reports use.
    pub class: String,
}

/// Runs the mutant's cases, as they are written first and then in every
/// permutation: those that cite its clause, then the others. Ends at the first kill.
pub fn hunt(subject: &dyn Judge, mutant: &Mutant, cases: &[&Case]) -> Hunt {
    let (citing, others): (Vec<&Case>, Vec<&Case>) =
        cases.iter().partition(|case| cites(case, mutant));
    let mut hunt = Hunt { kill: None, not_kills: Vec::new(), runs: 0 };
    for cases in [citing, others] {
        let mut starts = Vec::new();
        for case in cases {
            let start = Start::new(subject, case);
            if hunt.take(case, mutant, Permutation::Uncut, start.failure.as_ref()) {
                return hunt;
            }
            starts.push((case, start));
        }
        for (case, start) in starts {
            for permutation in start.permutations().into_iter().skip(1) {
                let failure = start.judge(permutation, 0);
                if hunt.take(case, mutant, permutation, failure.as_ref()) {
                    return hunt;
                }
            }
        }
    }
    hunt
}

fn cites(case: &Case, mutant: &Mutant) -> bool {
    case.trace.front.clauses.iter().any(|clause| clause == mutant.clause())
}

impl Hunt {
    /// What failed without proving anything, as a clause of a sentence.
    pub(super) fn not_kills_in_words(&self) -> String {
        let Some(first) = self.not_kills.first() else { return String::new() };
        let (count, NotAKill { run, class }) = (self.not_kills.len(), first);
        format!(" ({count} of them failed without wrong behaviour, first {run}: {class})")
    }

    /// Counts a run. Whether it is a kill.
    fn take(
        &mut self,
        case: &Case,
        mutant: &Mutant,
        permutation: Permutation,
        failure: Option<&Failure>,
    ) -> bool {
        self.runs += 1;
        let Some(failure) = failure else { return false };
        let run = format!("{}/{permutation}", case.trace.front.id);
        let class = failure.class.name().to_owned();
        if failure.class.is_wrong_behaviour() {
            self.kill = Some(Kill { run, class, cites: cites(case, mutant) });
        } else {
            self.not_kills.push(NotAKill { run, class });
        }
        self.kill.is_some()
    }
}
