//! What stands in a report. Lists are sorted: clauses and cases by id,
//! permutations as the suite orders them.

use crate::VerdictKind;
use serde::{Deserialize, Serialize};

/// Version of the report's shape.
pub const SCHEMA: u32 = 1;

/// One certification: one plug-in, one profile.
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
    /// Case 0: the check of the module against the ABI; empty: it is sound.
    pub lint: Vec<String>,
    /// The clauses of the profile.
    pub clauses: Vec<ClauseRow>,
    /// The cases of the profile.
    pub cases: Vec<CaseRow>,
}

/// The suite.
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
}

/// Counts of cases; a case counts once, with all its permutations.
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
pub const FAILURES: usize = 3;

/// How a case is given.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CaseKind {
    /// A trace, replayed.
    Trace,
    /// A partner that reacts.
    Script,
}

/// What came of a case.
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
    /// The same of what was seen.
    pub observed_bytes: String,
    /// What was given and seen before that, as lines of a trace.
    pub before: Vec<String>,
    /// The command that runs it again; `PLUGIN` stands for the module's file.
    pub again: String,
}
