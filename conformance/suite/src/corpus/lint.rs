//! Whether ledgers and cases fit each other.

use super::{Corpus, Listed};
use crate::given::ledger::{Clause, Ledger, fingerprint};
use crate::random::model_of;
use softplug_models::Profile;
use softplug_report::{CaseKind, Level};
use softplug_trace::Assignment;
use std::collections::BTreeSet;

/// The word in a trace's settings that names a preset; it is no setting of a profile.
const PRESET: &str = "preset";

/// Something that does not fit.
///
/// The example of [`lint`] shows one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Finding {
    /// A case belongs to no ledger.
    #[error(
        "{case}: there is no ledger for the profile \"{profile}\"; add requirements/{profile}.toml"
    )]
    UnknownProfile {
        /// The case.
        case: String,
        /// Its profile.
        profile: String,
    },
    /// Two cases have one id.
    #[error("{case}: two cases have this id; rename one")]
    SameCase {
        /// The id.
        case: String,
    },
    /// A case cites no clause.
    #[error("{case}: it cites no clause; name what it shows")]
    NoClause {
        /// The case.
        case: String,
    },
    /// A case cites what its ledger does not have.
    #[error("{case}: its ledger has no clause \"{clause}\"; add it there or correct the case")]
    UnknownClause {
        /// The case.
        case: String,
        /// The clause.
        clause: String,
    },
    /// A case cites a clause that no case can show.
    #[error("{case}: {clause} is excluded; drop the reason there or the clause here")]
    ExcludedClause {
        /// The case.
        case: String,
        /// The clause.
        clause: String,
    },
    /// A case binds more than any of its clauses.
    #[error("{case}: its level is {}, but none of its clauses binds as much", level_name(*.level))]
    TooStrong {
        /// The case.
        case: String,
        /// Its level.
        level: Level,
    },
    /// A case is older than a clause that it cites, or newer than its ledger.
    #[error(
        "{case}: since is {since}, it must be {low} to {high}: from its newest clause to its ledger's revision"
    )]
    WrongSince {
        /// The case.
        case: String,
        /// Its revision.
        since: u32,
        /// That of its newest clause.
        low: u32,
        /// That of its ledger.
        high: u32,
    },
    /// A case uses a setting that its ledger does not list.
    #[error(
        "{case}: its ledger does not list the setting \"{setting}\"; add it there with type and unit"
    )]
    UnknownSetting {
        /// The case.
        case: String,
        /// The setting.
        setting: String,
    },
    /// A clause's words are not those that its hash is of.
    #[error(
        "{clause}: the sentence was changed; look at its cases, then write sha256 = \"{expected}\""
    )]
    ChangedSentence {
        /// The clause.
        clause: String,
        /// The hash of the sentence as it stands.
        expected: String,
    },
    /// A clause without a hash.
    #[error("{clause}: its sentence has no hash; write sha256 = \"{expected}\"")]
    NoHash {
        /// The clause.
        clause: String,
        /// The hash of the sentence.
        expected: String,
    },
    /// A MUST that no MUST case shows.
    #[error(
        "{clause}: it is a must, and no case of level must cites it; write one, or say under excluded why there is none"
    )]
    WithoutCase {
        /// The clause.
        clause: String,
    },
    /// A MUST that the profile's model does not judge.
    #[error(
        "{clause}: it is a must, and the model of its profile does not judge it; enter it there, or say under unmodelled why not"
    )]
    Unmodelled {
        /// The clause.
        clause: String,
    },
    /// A clause belongs to a feature that its ledger does not list.
    #[error("{clause}: its ledger does not list the feature \"{feature}\"; add it there")]
    UnknownFeature {
        /// The clause.
        clause: String,
        /// The feature.
        feature: String,
    },
    /// A feature without clauses.
    #[error("profile {profile}: no clause belongs to the feature \"{feature}\"; drop it")]
    IdleFeature {
        /// The profile.
        profile: String,
        /// The feature.
        feature: String,
    },
    /// A setting that no case uses.
    #[error(
        "profile {profile}: no case uses the setting \"{setting}\"; write one that does, or drop it"
    )]
    IdleSetting {
        /// The profile.
        profile: String,
        /// The setting.
        setting: String,
    },
}

/// What does not fit, sorted. The ledgers may be others than the corpus' own.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::lint::{Finding, lint};
///
/// let corpus = Corpus::embedded();
/// assert_eq!(lint(&corpus.ledgers, &corpus), []);
/// // Whoever changes a clause must look at its cases.
/// let mut ledgers = corpus.ledgers.clone();
/// ledgers[0].clauses[0].sentence.push_str(", mostly");
/// let findings = lint(&ledgers, &corpus);
/// assert!(matches!(&findings[..], [Finding::ChangedSentence { .. }]));
/// ```
pub fn lint(ledgers: &[Ledger], corpus: &Corpus) -> Vec<Finding> {
    let cases = corpus.list();
    let mut findings = BTreeSet::new();
    let mut ids = BTreeSet::new();
    for case in &cases {
        if !ids.insert(case.id) {
            findings.insert(Finding::SameCase { case: case.id.to_owned() });
        }
        match ledgers.iter().find(|ledger| ledger.profile == case.profile) {
            Some(ledger) => findings.extend(of_case(ledger, case)),
            None => drop(findings.insert(Finding::UnknownProfile {
                case: case.id.to_owned(),
                profile: case.profile.to_owned(),
            })),
        }
    }
    for ledger in ledgers {
        findings.extend(of_ledger(ledger, &cases));
    }
    findings.into_iter().collect()
}

fn of_case(ledger: &Ledger, case: &Listed<'_>) -> Vec<Finding> {
    let id = || case.id.to_owned();
    let mut findings = Vec::new();
    let mut cited: Vec<&Clause> = Vec::new();
    if case.clauses.is_empty() {
        findings.push(Finding::NoClause { case: id() });
    }
    for name in case.clauses.iter().chain(case.alternatives()) {
        match ledger.clause(name) {
            None => findings.push(Finding::UnknownClause { case: id(), clause: name.clone() }),
            Some(clause) if clause.excluded.is_some() => {
                findings.push(Finding::ExcludedClause { case: id(), clause: name.clone() });
            }
            Some(clause) => cited.push(clause),
        }
    }
    let binds = |clause: &&Clause| clause.level <= case.level;
    if !cited.is_empty() && !cited.iter().any(binds) {
        findings.push(Finding::TooStrong { case: id(), level: case.level });
    }
    let low = cited.iter().map(|clause| clause.since).max().unwrap_or(1);
    if !(low..=ledger.revision).contains(&case.since) {
        let (since, high) = (case.since, ledger.revision);
        findings.push(Finding::WrongSince { case: id(), since, low, high });
    }
    let listed = |name: &str| ledger.settings.iter().any(|setting| setting.name == name);
    for Assignment { name, .. } in case.config() {
        if name != PRESET && !listed(name) {
            findings.push(Finding::UnknownSetting { case: id(), setting: name.clone() });
        }
    }
    findings
}

fn of_ledger(ledger: &Ledger, cases: &[Listed<'_>]) -> Vec<Finding> {
    let cases: Vec<_> = cases.iter().filter(|case| case.profile == ledger.profile).collect();
    let mut findings = Vec::new();
    for clause in &ledger.clauses {
        let id = || clause.id.clone();
        let expected = fingerprint(&clause.sentence);
        if clause.sha256.is_empty() {
            findings.push(Finding::NoHash { clause: id(), expected });
        } else if clause.sha256 != expected {
            findings.push(Finding::ChangedSentence { clause: id(), expected });
        }
        // Sessions may pass a clause by: it needs a case that shows it each time.
        let shows = |case: &&&Listed<'_>| {
            let is_sure = case.level == Level::Must && case.kind != CaseKind::Random;
            is_sure && case.cites(&clause.id)
        };
        let is_owed = clause.level == Level::Must && clause.excluded.is_none();
        if is_owed && !cases.iter().any(|case| shows(&case)) {
            findings.push(Finding::WithoutCase { clause: id() });
        }
        let is_judged = |model: &Profile| {
            clause.unmodelled.is_some() || model.clauses.contains(&clause.id.as_str())
        };
        if is_owed && !model_of(ledger).is_none_or(is_judged) {
            findings.push(Finding::Unmodelled { clause: id() });
        }
        let listed = |name: &String| ledger.features.iter().any(|feature| feature.name == *name);
        if let Some(feature) = clause.feature.as_ref().filter(|name| !listed(name)) {
            findings.push(Finding::UnknownFeature { clause: id(), feature: feature.clone() });
        }
    }
    let profile = || ledger.profile.clone();
    for feature in &ledger.features {
        let is_used =
            ledger.clauses.iter().any(|clause| clause.feature.as_ref() == Some(&feature.name));
        if !is_used {
            let feature = feature.name.clone();
            findings.push(Finding::IdleFeature { profile: profile(), feature });
        }
    }
    for setting in &ledger.settings {
        let uses = |case: &&Listed<'_>| case.config().iter().any(|pair| pair.name == setting.name);
        if !cases.iter().any(uses) {
            let setting = setting.name.clone();
            findings.push(Finding::IdleSetting { profile: profile(), setting });
        }
    }
    findings
}

fn level_name(level: Level) -> &'static str {
    match level {
        Level::Must => "must",
        Level::Should => "should",
        Level::May => "may",
    }
}
