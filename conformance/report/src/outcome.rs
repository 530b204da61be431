//! What a case's result means for the verdict, and the counts that follow.

use crate::{
    CaseKind, CaseResult, CaseRow, ClauseRow, Counts, FailedRun, Level, ProfileInfo, Report,
    Selection, VerdictKind,
};

/// What a case's result means. Formats and counts take it from here, so that no
/// two of them can disagree.
///
/// ```
/// use softplug_report::{Outcome, json};
///
/// let text = std::fs::read_to_string("tests/reports/warnings.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let case = report.cases.iter().find(|case| case.id == "xon-xoff.tx.done-count").unwrap();
/// let outcome = report.outcome(case);
/// assert_eq!((outcome, outcome.text()), (Outcome::Warned, "failed (should)"));
/// assert!(outcome.has_failed() && outcome.is_required());
/// assert_eq!(Outcome::of(case, &report.clauses, &report.profile, &report.selection), outcome);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Outcome {
    /// Required, and passed.
    Passed,
    /// Required, and failed; it decides the verdict. A run that ended before its time (a
    /// trap, an exhausted budget, …) does so at every level.
    Failed,
    /// Required, level SHOULD, and failed, where that only warns.
    Warned,
    /// Required, level MAY, and failed.
    Informed,
    /// Required, and failed as the baseline expects.
    ExpectedFailure,
    /// Newer than the revision, and passed.
    UnscoredPass,
    /// Newer than the revision, and failed.
    UnscoredFailure,
    /// Required, but not executed: the run is incomplete.
    Missing,
    /// Newer than the revision, and not executed.
    UnscoredSkip,
    /// Of a feature that the plug-in does not claim.
    Unclaimed,
}

impl Outcome {
    /// The outcome in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Warned => "failed (should)",
            Self::Informed => "failed (may)",
            Self::ExpectedFailure => "failed as expected",
            Self::UnscoredPass => "passed, unscored",
            Self::UnscoredFailure => "failed, unscored",
            Self::Missing => "not executed",
            Self::UnscoredSkip => "not executed, unscored",
            Self::Unclaimed => "feature not claimed",
        }
    }

    /// Whether a run of the case failed, whatever that means.
    pub const fn has_failed(self) -> bool {
        matches!(
            self,
            Self::Failed
                | Self::Warned
                | Self::Informed
                | Self::ExpectedFailure
                | Self::UnscoredFailure
        )
    }

    /// Whether the case is one of those that must be executed.
    pub const fn is_required(self) -> bool {
        !matches!(
            self,
            Self::UnscoredPass | Self::UnscoredFailure | Self::UnscoredSkip | Self::Unclaimed
        )
    }

    /// Of a case, held against the clauses that it may cite (sorted by id), the
    /// profile (its features sorted) and what was asked for.
    pub fn of(
        case: &CaseRow,
        clauses: &[ClauseRow],
        profile: &ProfileInfo,
        selection: &Selection,
    ) -> Self {
        if !is_claimed(case, clauses, profile) {
            return Self::Unclaimed;
        }
        let is_scored = case.since <= profile.revision;
        match &case.result {
            CaseResult::Skipped { .. } if is_scored => Self::Missing,
            CaseResult::Skipped { .. } => Self::UnscoredSkip,
            CaseResult::Unscored { passed: true } => Self::UnscoredPass,
            CaseResult::Unscored { passed: false } => Self::UnscoredFailure,
            CaseResult::Passed => Self::Passed,
            CaseResult::ExpectedFailure { .. } => Self::ExpectedFailure,
            CaseResult::Failed if !case.failures.iter().all(FailedRun::is_wrong_behaviour) => {
                Self::Failed
            }
            CaseResult::Failed => match case.level {
                Level::Must => Self::Failed,
                Level::Should if selection.strict => Self::Failed,
                Level::Should => Self::Warned,
                Level::May => Self::Informed,
            },
        }
    }
}

/// A case belongs to every feature of its clauses.
fn is_claimed(case: &CaseRow, clauses: &[ClauseRow], profile: &ProfileInfo) -> bool {
    let feature_of = |id: &String| {
        let place = clauses.binary_search_by(|clause| clause.id.cmp(id)).ok()?;
        clauses[place].feature.as_ref()
    };
    case.clauses
        .iter()
        .filter_map(feature_of)
        .all(|feature| profile.features.binary_search(feature).is_ok())
}

impl Counts {
    /// The counts that follow from a report's rows: clauses and features are sorted.
    ///
    /// ```
    /// use softplug_report::{Counts, ProfileInfo, Selection};
    ///
    /// let profile =
    ///     ProfileInfo { name: "r3964".into(), revision: 1, claimed: true, features: vec![] };
    /// assert_eq!(Counts::of(&[], &[], &profile, &Selection::default()), Counts::default());
    /// ```
    pub fn of(
        cases: &[CaseRow],
        clauses: &[ClauseRow],
        profile: &ProfileInfo,
        selection: &Selection,
    ) -> Self {
        let mut counts = Self::default();
        for case in cases {
            let outcome = Outcome::of(case, clauses, profile, selection);
            let required = u32::from(outcome.is_required());
            counts.required += required;
            counts.executed += required;
            counts.runs = counts.runs.saturating_add(case.runs);
            match outcome {
                Outcome::Passed => counts.passed += 1,
                Outcome::Failed => counts.failed += 1,
                Outcome::Warned => counts.warned += 1,
                Outcome::Informed => counts.informed += 1,
                Outcome::ExpectedFailure => counts.expected += 1,
                Outcome::UnscoredPass | Outcome::UnscoredFailure => counts.unscored += 1,
                Outcome::Missing => counts.executed -= 1,
                Outcome::UnscoredSkip => {}
                Outcome::Unclaimed => counts.unclaimed += 1,
            }
        }
        counts
    }
}

impl Report {
    /// What a case's result means in this report.
    pub fn outcome(&self, case: &CaseRow) -> Outcome {
        Outcome::of(case, &self.clauses, &self.profile, &self.selection)
    }

    /// Its clause of this id.
    pub fn clause(&self, id: &str) -> Option<&ClauseRow> {
        let place = self.clauses.binary_search_by(|clause| clause.id.as_str().cmp(id)).ok()?;
        Some(&self.clauses[place])
    }
}

impl VerdictKind {
    /// Whether the plug-in conforms, with warnings or without.
    ///
    /// ```
    /// use softplug_report::VerdictKind;
    ///
    /// assert!(VerdictKind::ConformantWithWarnings.is_conformant());
    /// assert!(!VerdictKind::Partial.is_conformant());
    /// ```
    pub const fn is_conformant(self) -> bool {
        matches!(self, Self::Conformant | Self::ConformantWithWarnings)
    }
}

impl Level {
    /// The keyword: `MUST`, `SHOULD` or `MAY`.
    pub const fn keyword(self) -> &'static str {
        match self {
            Self::Must => "MUST",
            Self::Should => "SHOULD",
            Self::May => "MAY",
        }
    }
}

impl CaseKind {
    /// `trace` or `script`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Trace => "trace",
            Self::Script => "script",
            Self::Random => "random",
        }
    }
}

impl FailedRun {
    /// Whether the run got to its end and the plug-in did something wrong in it. If not,
    /// it trapped, used up its budget, refused an event or broke the ABI.
    pub fn is_wrong_behaviour(&self) -> bool {
        self.class == "diverged" || self.class.starts_with("depends-on-")
    }
}
