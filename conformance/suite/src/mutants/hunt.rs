//! Runs the cases of a profile against a mutant until one sees wrong behaviour.

use super::Mutant;
use crate::judge::run::Start;
use crate::script::Script;
use crate::{Case, Class, FaultClass, Judge, Permutation};

/// What came of one mutant.
///
/// The example of [`hunt`] shows one.
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
///
/// The example of [`hunt`] shows one.
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
///
/// The example of [`hunt`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NotAKill {
    /// The case with its permutation.
    pub run: String,
    /// What happened instead, by the name that reports use.
    pub class: String,
}

/// Runs the cases of the mutant's profile: those that cite its clause, as they are written, then in
/// every permutation; then the others in the same way. Ends at the first kill.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::mutants::{Catalogue, Kill, NotAKill, hunt};
/// use softplug_conformance::{FromFn, load};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
/// use std::path::Path;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let catalogue = Path::new("../../fixtures/mutants/xon-xoff.toml");
/// let catalogue = Catalogue::parse(catalogue, &std::fs::read_to_string(catalogue)?)?;
/// let is_obey = |id: &str| id == "xon-xoff.tx.obey-xoff/ignored";
/// let mutant = catalogue.mutants.iter().find(|mutant| is_obey(&mutant.id)).expect("it is listed");
/// // The sound plug-in survives, until a case is wrong instead of it.
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let survived = hunt(&subject, mutant, &[case], &[]);
/// assert!(survived.kill.is_none() && survived.not_kills.is_empty() && survived.runs > 1);
/// let text = case.trace.format();
/// let wrong = case.with_trace(Trace::parse(&text.replace("43 44 ", "43 45 "))?);
/// let run = "xon-xoff.tx.hold/uncut".to_owned();
/// let kill = Kill { run: run.clone(), class: "diverged".to_owned(), cites: true };
/// assert_eq!(hunt(&subject, mutant, &[&wrong], &[]).kill, Some(kill));
/// // What the plug-in does not have proves nothing.
/// let unfit = case.with_trace(Trace::parse(&text.replace("since: 1", "config: speed=9\nsince: 1"))?);
/// let not_a_kill = NotAKill { run, class: "not-applicable".to_owned() };
/// assert_eq!(hunt(&subject, mutant, &[&unfit], &[]).not_kills[0], not_a_kill);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn hunt(subject: &dyn Judge, mutant: &Mutant, cases: &[&Case], scripts: &[&Script]) -> Hunt {
    let clause = mutant.clause();
    let cites = |clauses: &[String]| clauses.iter().any(|cited| cited == clause);
    let mut hunt = Hunt { kill: None, not_kills: Vec::new(), runs: 0 };
    for is_citing in [true, false] {
        let mut starts = Vec::new();
        for case in cases.iter().filter(|case| cites(&case.trace.front.clauses) == is_citing) {
            let start = Start::new(subject, case);
            let class = start.failure.as_ref().map(|failure| failure.class);
            let id = &case.trace.front.id;
            if hunt.take(clause, format!("{id}/{}", Permutation::Uncut), class, is_citing) {
                return hunt;
            }
            starts.push((id, start));
        }
        for script in scripts.iter().filter(|script| cites(&script.clauses) == is_citing) {
            let class = subject.run_script(script).failure.map(|failure| failure.class);
            let run = format!("{}/{}", script.id, Permutation::Uncut);
            if hunt.take(clause, run, class, is_citing) {
                return hunt;
            }
        }
        for (id, start) in starts {
            for permutation in start.permutations().into_iter().skip(1) {
                let class = start.judge(&permutation, 0).map(|failure| failure.class);
                if hunt.take(clause, format!("{id}/{permutation}"), class, is_citing) {
                    return hunt;
                }
            }
        }
    }
    hunt
}

/// Whether a failure of this kind shows that the clause is broken. What a clause of the ABI
/// itself forbids is seen as a broken rule of the ABI and as nothing else.
fn is_kill(clause: &str, class: Class) -> bool {
    let is_of_abi = clause.starts_with("abi.");
    class.is_wrong_behaviour() || (is_of_abi && class == Class::Fault(FaultClass::RuleBroken))
}

impl Hunt {
    /// What failed without proving anything, as a clause of a sentence.
    pub(super) fn not_kills_in_words(&self) -> String {
        let Some(first) = self.not_kills.first() else { return String::new() };
        let (count, NotAKill { run, class }) = (self.not_kills.len(), first);
        format!(" ({count} of them failed without wrong behaviour, first {run}: {class})")
    }

    /// Counts a run. Whether it is a kill.
    fn take(&mut self, clause: &str, run: String, class: Option<Class>, cites: bool) -> bool {
        self.runs += 1;
        let Some(class) = class else { return false };
        let name = class.name().to_owned();
        if is_kill(clause, class) {
            self.kill = Some(Kill { run, class: name, cites });
        } else {
            self.not_kills.push(NotAKill { run, class: name });
        }
        self.kill.is_some()
    }
}
