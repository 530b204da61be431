//! What stands in a report. Lists are sorted: clauses and cases by id,
//! permutations as the suite orders them.

use crate::{Coverage, Explored, Score, VerdictKind};
use serde::{Deserialize, Serialize};

/// Version of the report's shape.
///
/// The example of [`Report`] shows it.
pub const SCHEMA: u32 = 1;

/// One certification: one plug-in, one profile.
///
/// ```
/// use softplug_report::{Fuel, PluginInfo, ProfileInfo, SCHEMA, SuiteInfo, json};
///
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// assert_eq!(report.schema, SCHEMA);
/// let SuiteInfo { name, engine, .. } = &report.suite;
/// assert!(name == "softplug" && engine.starts_with("wasmtime "));
/// let PluginInfo { name, bytes, .. } = &report.plugin;
/// assert!(name == "xon-xoff" && *bytes < 32 * 1_024);
/// let ProfileInfo { name, revision, claimed, .. } = &report.profile;
/// assert_eq!((name.as_str(), *revision, *claimed), ("xon-xoff", 1, true));
/// let Fuel { units, bytes, tenths_per_byte, .. } = report.fuel;
/// assert_eq!(tenths_per_byte, units * 10 / bytes);
/// assert_eq!(report.reason, "all 5 required cases passed");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The suite that judged.
    pub suite: SuiteInfo,
    /// The plug-in that was judged.
    pub plugin: PluginInfo,
    /// The profile that it was judged by.
    pub profile: ProfileInfo,
    /// What was asked for.
    pub selection: Selection,
    /// The verdict. It is a function of everything below: see [`verdict`](crate::verdict).
    pub verdict: VerdictKind,
    /// The verdict's reason, one sentence.
    pub reason: String,
    /// Counts of cases.
    pub counts: Counts,
    /// SHA-256 over id, verdict and observable actions of every uncut case, as
    /// 64 hex digits.
    pub digest: String,
    /// What the plug-in's computing costs, on the engine that the suite names.
    pub fuel: Fuel,
    /// How much of the module was executed; only of a plug-in that is conformant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coverage: Option<Coverage>,
    /// What exploring the module has found, if that was asked for; only of a plug-in that is
    /// conformant but for that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explored: Option<Explored>,
    /// How many changes of the module were noticed, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// Case 0: the check of the module against the ABI; empty: it is sound.
    pub lint: Vec<String>,
    /// The clauses of the profile.
    pub clauses: Vec<ClauseRow>,
    /// The cases of the profile.
    pub cases: Vec<CaseRow>,
}

/// The suite.
///
/// The example of [`Report`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteInfo {
    /// `softplug`.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of the corpus: ledgers and cases of all profiles, as 64 hex digits.
    pub corpus: String,
    /// The engine whose fuel is counted: its name and version.
    pub engine: String,
    /// The engine that every case was compared with: its name and version.
    pub second_engine: String,
}

/// The plug-in.
///
/// The example of [`Report`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PluginInfo {
    /// Its name, from the manifest; empty where there is none that can be read.
    pub name: String,
    /// Its version, from the manifest.
    pub version: String,
    /// SHA-256 of the module, as 64 hex digits.
    pub sha256: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// Version of the ABI that it speaks.
    pub abi: String,
}

/// The profile.
///
/// The example of [`Report`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfileInfo {
    /// Its name.
    pub name: String,
    /// The revision whose cases are scored; later ones run unscored.
    pub revision: u32,
    /// Whether the plug-in's manifest claims the profile.
    pub claimed: bool,
    /// Optional features that it claims, sorted.
    pub features: Vec<String>,
}

/// What was asked for. Anything that narrows a run makes it incomplete.
///
/// ```
/// use softplug_report::{Counts, Reason, Selection, VerdictKind, verdict};
///
/// // Whatever narrows a run makes it incomplete.
/// let all = Counts { required: 2, executed: 2, passed: 2, ..Counts::default() };
/// let narrowed = Selection { cases: vec!["xon-xoff.*".to_owned()], ..Selection::default() };
/// assert_eq!(verdict(&all, &narrowed, &Reason::None).0, VerdictKind::Partial);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// A failed SHOULD counts as a failed MUST.
    pub strict: bool,
    /// Patterns of case ids; empty: all.
    pub cases: Vec<String>,
    /// SHA-256 of the baseline of expected failures, if there was one.
    pub baseline: Option<String>,
    /// The run was ended from outside.
    pub interrupted: bool,
    /// Random sessions that were asked for.
    #[serde(default)]
    pub sessions: u32,
    /// As many are needed for a whole verdict.
    #[serde(default)]
    pub sessions_needed: u32,
    /// The seed that they were drawn from.
    #[serde(default)]
    pub seed: u64,
}

/// Counts of cases; a case counts once, with all its permutations.
///
/// ```
/// use softplug_report::{Counts, json};
///
/// let text = std::fs::read_to_string("tests/reports/partial.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let Counts { required, executed, passed, unclaimed, .. } = report.counts;
/// assert_eq!((required, executed, passed, unclaimed), (5, 2, 2, 1));
/// assert_eq!(report.reason, "only 2 of 5 required cases were executed");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// Cases that must be executed for a verdict on the whole profile: scored,
    /// and of the core or of a claimed feature.
    pub required: u32,
    /// Those of them that were executed, in every permutation.
    pub executed: u32,
    /// Executed, required, passed.
    pub passed: u32,
    /// Executed, required, failed, level MUST (with `strict`: SHOULD too) or by a trap and
    /// the like, not expected to fail.
    pub failed: u32,
    /// Executed, required, failed, level SHOULD (without `strict`), not expected to fail.
    pub warned: u32,
    /// Executed, required, failed, level MAY, not expected to fail.
    pub informed: u32,
    /// Executed, required, failed as the baseline expects.
    pub expected: u32,
    /// Cases that ran unscored: newer than the revision.
    pub unscored: u32,
    /// Cases of features that the plug-in does not claim; they do not run.
    pub unclaimed: u32,
    /// Single runs: all permutations of all cases.
    pub runs: u32,
}

/// Fuel, from the uncut runs of the required cases.
///
/// The example of [`Report`] shows it.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fuel {
    /// Units of fuel used.
    pub units: u64,
    /// Bytes that reached the plug-in, that left it (control bytes too), and that it
    /// delivered.
    pub bytes: u64,
    /// Units a byte, in tenths, rounded down; 0 without bytes.
    pub tenths_per_byte: u64,
    /// The most units that one event took.
    pub largest_event: u64,
    /// The case in which it did; empty without one.
    pub largest_case: String,
}

/// How much a clause or case binds.
///
/// ```
/// use softplug_report::Level;
///
/// assert_eq!(Level::Should.keyword(), "SHOULD");
/// assert!(Level::Must < Level::Should, "the strongest comes first");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Failing it fails the run.
    Must,
    /// Failing it warns.
    Should,
    /// Failing it informs.
    May,
}

/// A clause of the ledger and what the run says of it.
///
/// ```
/// use softplug_report::{ClauseRow, json};
///
/// let text = std::fs::read_to_string("tests/reports/not-conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let ClauseRow { cited, executed, failed, feature, .. } =
///     report.clause("xon-xoff.rx.hold-off").expect("it is a clause of the profile");
/// assert_eq!((*cited, *executed, *failed, feature.as_deref()), (1, 1, 1, None));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClauseRow {
    /// `xon-xoff.tx.obey-xoff`.
    pub id: String,
    /// How much it binds.
    pub level: Level,
    /// The exact sentence.
    pub sentence: String,
    /// The revision that brought it.
    pub since: u32,
    /// The optional feature that it belongs to; none: the core.
    pub feature: Option<String>,
    /// Why no case can show it; none: it is testable.
    pub excluded: Option<String>,
    /// Cases that cite it.
    pub cited: u32,
    /// Those of them that were executed.
    pub executed: u32,
    /// Those of them that failed.
    pub failed: u32,
    /// Mutants of the reference plug-ins that break it and are killed, as the
    /// corpus' kill matrix says.
    pub mutants: u32,
}

/// A case and what came of it.
///
/// ```
/// use softplug_report::{CaseKind, CaseResult, CaseRow, FAILURES, FailedRun, json};
///
/// let text = std::fs::read_to_string("tests/reports/not-conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let case = report.cases.iter().find(|case| case.id == "xon-xoff.tx.hold");
/// let CaseRow { kind, result, failures, more_failures, .. } = case.expect("it is in the profile");
/// assert_eq!((kind.name(), *kind), ("trace", CaseKind::Trace));
/// assert_eq!(*result, CaseResult::Failed);
/// // Five of its runs failed, of which three are listed.
/// assert_eq!((failures.len(), *more_failures), (FAILURES, 2));
/// let FailedRun { run, line, at_us, .. } = &failures[0];
/// assert_eq!((run.as_str(), *line, *at_us), ("xon-xoff.tx.hold/uncut", Some(15), 1_146));
/// assert!(failures[0].is_wrong_behaviour());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaseRow {
    /// The id of the uncut case.
    pub id: String,
    /// One sentence.
    pub title: String,
    /// Trace or script.
    pub kind: CaseKind,
    /// How much it binds.
    pub level: Level,
    /// The clauses that it shows.
    pub clauses: Vec<String>,
    /// The revision that brought it.
    pub since: u32,
    /// What came of it.
    pub result: CaseResult,
    /// Runs of it: permutations that were executed.
    pub runs: u32,
    /// Units of fuel of the uncut run.
    pub fuel: u64,
    /// The failed runs, at most [`FAILURES`]; the first one is the one to read.
    pub failures: Vec<FailedRun>,
    /// Failed runs that are not listed.
    pub more_failures: u32,
}

/// Failed runs that are listed for one case.
///
/// The example of [`CaseRow`] shows it.
pub const FAILURES: usize = 3;

/// How a case is given.
///
/// The example of [`CaseRow`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CaseKind {
    /// A trace, replayed.
    Trace,
    /// A partner that reacts.
    Script,
    /// Random sessions against the profile's model.
    Random,
}

/// What came of a case.
///
/// The example of [`CaseRow`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum CaseResult {
    /// All runs passed.
    Passed,
    /// A run failed.
    Failed,
    /// A run failed, as the baseline expects.
    ExpectedFailure {
        /// The baseline's reason.
        reason: String,
    },
    /// Executed, with this outcome, but newer than the revision.
    Unscored {
        /// Whether all runs passed.
        passed: bool,
    },
    /// Not executed.
    Skipped {
        /// Why: `filtered`, `interrupted`, `feature NAME is not claimed`, …
        reason: String,
    },
}

/// A failed run.
///
/// The example of [`CaseRow`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailedRun {
    /// The case with its permutation: `xon-xoff.tx.hold/cut:1`.
    pub run: String,
    /// What kind of failure: `diverged`, `depends-on-cuts`, `trapped`, … Where one of the
    /// case's failed runs is no wrong behaviour, one such run is listed.
    pub class: String,
    /// One sentence.
    pub message: String,
    /// The case's file, relative to the corpus: `traces/xon-xoff/xon-xoff.tx.hold.spt`;
    /// empty without one.
    pub file: String,
    /// The line of it that is not fulfilled, from 1.
    pub line: Option<u32>,
    /// When, in µs of the case's time.
    pub at_us: i64,
    /// What was demanded, as a line of a trace; empty where nothing is compared.
    pub expected: String,
    /// What was seen.
    pub observed: String,
    /// Bytes around the place, as hex digits; both sides begin at the same place.
    pub expected_bytes: String,
    /// Bytes that were seen there, as hex digits.
    pub observed_bytes: String,
    /// What was given and seen before that, as lines of a trace.
    pub before: Vec<String>,
    /// The command that runs it again; `PLUGIN` stands for the module's file.
    pub again: String,
}
