//! Runs the cases of a profile against a mutant until one sees wrong behaviour.

use super::Mutant;
use crate::{Case, Class, Filter, Judge, Permutation, Verdict, judge};

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
        for case in &cases {
            let uncut = format!("{}/{}", case.trace.front.id, Permutation::Uncut);
            let (verdicts, _) = judge(subject, case, &Filter::only([uncut]));
            if hunt.take(&verdicts, cites(case, mutant)) {
                return hunt;
            }
        }
        for case in &cases {
            let (verdicts, _) = judge(subject, case, &Filter::default());
            let permuted = verdicts.get(1..).unwrap_or_default();
            if hunt.take(permuted, cites(case, mutant)) {
                return hunt;
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

    /// Counts runs up to the first kill. Whether there was one.
    fn take(&mut self, verdicts: &[Verdict], cites: bool) -> bool {
        for verdict in verdicts {
            self.runs += 1;
            let Some(failure) = &verdict.failure else { continue };
            let (run, class) = (verdict.case.clone(), name(failure.class));
            if let Class::Fault(_) = failure.class {
                self.not_kills.push(NotAKill { run, class });
                continue;
            }
            self.kill = Some(Kill { run, class, cites });
            return true;
        }
        false
    }
}

/// The name of a class in reports.
fn name(class: Class) -> String {
    let value = serde_json::to_value(class).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}
