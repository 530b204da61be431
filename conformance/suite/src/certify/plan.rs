//! Which cases are run, and which of them count.

use super::error::CertifyError;
use super::glob::matches;
use super::options::CertifyOptions;
use crate::corpus::{Corpus, Listed};
use crate::given::ledger::Ledger;
use softplug_abi::manifest::{Manifest, Setting};

/// The profile that every plug-in is held to without a claim: the rules between plug-in and host.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::certify::ABI;
///
/// assert!(Corpus::embedded().ledger(ABI).is_some());
/// ```
pub const ABI: &str = "abi";

/// What one certification runs.
pub(super) struct Plan<'a> {
    pub(super) ledger: &'a Ledger,
    pub(super) revision: u32,
    /// Whether the manifest claims the profile.
    pub(super) is_claimed: bool,
    /// Optional features that it claims, sorted.
    pub(super) features: Vec<String>,
    /// All cases of the profile, sorted by id.
    pub(super) cases: Vec<Planned<'a>>,
}

pub(super) struct Planned<'a> {
    pub(super) case: Listed<'a>,
    pub(super) fate: Fate,
    /// It came with the revision or before.
    pub(super) is_scored: bool,
}

/// Whether a case runs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Fate {
    Runs,
    /// No pattern takes it.
    Filtered,
    /// It belongs to a feature that the plug-in does not claim.
    Unclaimed(String),
}

impl<'a> Plan<'a> {
    pub(super) fn new(
        corpus: &'a Corpus,
        options: &CertifyOptions,
        manifest: Option<&Manifest>,
    ) -> Result<Self, CertifyError> {
        let ledger = corpus.ledger(&options.profile).ok_or_else(|| {
            let known: Vec<_> = corpus.ledgers.iter().map(|known| known.profile.as_str()).collect();
            let name: String =
                options.profile.chars().filter(|c| !c.is_control()).take(40).collect();
            CertifyError::UnknownProfile { name, known: known.join(", ") }
        })?;
        let revision = options.revision.unwrap_or(ledger.revision);
        if revision == 0 || revision > ledger.revision {
            let (profile, newest) = (ledger.profile.clone(), ledger.revision);
            return Err(CertifyError::UnknownRevision { profile, revision, newest });
        }
        let claim = manifest
            .and_then(|manifest| manifest.profiles.iter().find(|own| own.name == ledger.profile));
        let mut features = claim.map(|claim| claim.features.clone()).unwrap_or_default();
        features.sort();
        features.dedup();
        let mut plan = Self {
            ledger,
            revision,
            is_claimed: claim.is_some() || ledger.profile == ABI,
            features,
            cases: Vec::new(),
        };
        let own = corpus.list().into_iter().filter(|case| case.profile == ledger.profile);
        let own: Vec<_> = own.collect();
        for case in &own {
            if let Some(clause) = case.clauses.iter().find(|id| ledger.clause(id).is_none()) {
                let (case, clause) = (case.id.to_owned(), clause.clone());
                return Err(CertifyError::UnknownClause { case, clause });
            }
        }
        plan.cases = own
            .into_iter()
            .map(|case| Planned {
                case,
                fate: plan.fate(&case, &options.cases),
                is_scored: case.since <= revision,
            })
            .collect();
        let selected = |planned: &Planned<'_>| is_selected(&options.cases, planned.case.id);
        if !plan.cases.iter().any(selected) {
            return Err(CertifyError::NothingSelected { profile: ledger.profile.clone() });
        }
        Ok(plan)
    }

    fn fate(&self, case: &Listed<'_>, patterns: &[String]) -> Fate {
        let mut needed = self.ledger.features_of(case.clauses).into_iter();
        let is_missing = |feature: &&str| !self.features.iter().any(|own| own == feature);
        match needed.find(is_missing) {
            Some(feature) => Fate::Unclaimed(feature.to_owned()),
            None if is_selected(patterns, case.id) => Fate::Runs,
            None => Fate::Filtered,
        }
    }

    /// What of the manifest does not fit the profile: then no verdict would say anything.
    pub(super) fn unfit(&self, manifest: Option<&Manifest>) -> Vec<String> {
        let profile = &self.ledger.profile;
        let known = |name: &String| self.ledger.features.iter().any(|known| known.name == *name);
        let features = self.features.iter().filter(|name| !known(name)).map(|name| {
            let all: Vec<_> =
                self.ledger.features.iter().map(|known| known.name.as_str()).collect();
            let all = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
            format!("the manifest claims the feature \"{name}\" of {profile}; there are: {all}")
        });
        let settings = manifest.map(|manifest| manifest.settings.as_slice()).unwrap_or_default();
        let settings = settings.iter().filter_map(|setting| self.unfit_setting(setting));
        features.chain(settings).collect()
    }

    fn unfit_setting(&self, setting: &Setting) -> Option<String> {
        let used = self.ledger.settings.iter().find(|used| used.name == setting.name)?;
        let is_same = (used.kind, &used.unit) == (setting.kind, &setting.unit);
        let profile = &self.ledger.profile;
        let (name, kind, own) = (&setting.name, used.kind.name(), setting.kind.name());
        (!is_same).then(|| {
            format!(
                "the setting \"{name}\" is of type {own} and unit \"{}\", in {profile} it is of \
                 type {kind} and unit \"{}\"",
                setting.unit, used.unit
            )
        })
    }
}

/// Whether one of the patterns takes a case; without patterns all are taken.
fn is_selected(patterns: &[String], id: &str) -> bool {
    patterns.is_empty() || patterns.iter().any(|pattern| matches(pattern, id))
}
