//! Whether a report follows from its own rows.

use crate::{
    CaseResult, CaseRow, ClauseRow, Counts, Explored, FAILURES, FailedRun, Fuel, Outcome, Reason,
    Report, SCHEMA, VerdictKind, hex, text, verdict,
};
use std::collections::{BTreeMap, BTreeSet};

/// Bytes that one side of a failed run may show.
const SHOWN_BYTES: usize = 4096;

/// A report that contradicts itself.
///
/// The example of [`check()`](crate::check()) shows one.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{place}: {message}")]
pub struct Inconsistency {
    /// The field: `counts`, `cases[3] ("xon-xoff.tx.hold")`, …
    pub place: String,
    /// What is wrong with it, one sentence.
    pub message: String,
}

/// Recomputes all that follows from a report's rows, and names the first place
/// where the report says something else.
///
/// A verdict may be worse than the rows in two ways only: the plug-in could not be
/// judged (then no case was executed), or the baseline is stale (then there was one).
/// It may never be better.
///
/// ```
/// use softplug_report::{VerdictKind, check, json};
///
/// let file = std::path::Path::new("conformance.json");
/// let text = std::fs::read_to_string("tests/reports/not-conformant.json")?;
/// let mut report = json::read(file, &text)?;
/// report.verdict = VerdictKind::Conformant;
/// assert_eq!(check(&report).unwrap_err().place, "verdict");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first place that does not follow.
pub fn check(report: &Report) -> Result<(), Inconsistency> {
    if report.schema != SCHEMA {
        return wrong("schema", format!("is {}, and not {SCHEMA}", report.schema));
    }
    digests(report)?;
    sorted("profile.features", report.profile.features.iter())?;
    sorted("clauses", report.clauses.iter().map(|clause| &clause.id))?;
    sorted("cases", report.cases.iter().map(|case| &case.id))?;
    for (number, case) in report.cases.iter().enumerate() {
        let place = format!("cases[{number}] ({})", text::quoted(&case.id));
        row(report, case).or_else(|bad| wrong(&place, bad.to_string()))?;
    }
    clauses(report)?;
    let expected = Counts::of(&report.cases, &report.clauses, &report.profile, &report.selection);
    if let Some((name, said, expected)) = differing(&report.counts, &expected) {
        return wrong(
            &format!("counts.{name}"),
            format!("is {said}, but the rows give {expected}"),
        );
    }
    fuel(report)?;
    if report.score.as_ref().is_some_and(|score| !score.adds_up()) {
        return wrong("score", "does not account for every change that was tried");
    }
    if report.coverage.as_ref().is_some_and(|coverage| !coverage.adds_up()) {
        return wrong("coverage", "names more or fewer places than are missing");
    }
    if let Some(what) = report.explored.as_ref().and_then(Explored::wrong) {
        return wrong("explored", what);
    }
    conclusion(report)
}

fn wrong<T>(place: &str, message: impl Into<String>) -> Result<T, Inconsistency> {
    Err(Inconsistency { place: place.to_owned(), message: message.into() })
}

fn digests(report: &Report) -> Result<(), Inconsistency> {
    let baseline = report.selection.baseline.as_ref();
    let digests = [
        ("suite.corpus", Some(&report.suite.corpus)),
        ("plugin.sha256", Some(&report.plugin.sha256)),
        ("selection.baseline", baseline),
        ("digest", Some(&report.digest)),
    ];
    for (place, digest) in digests {
        let is_digest = |text: &&String| {
            text.len() == 64 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        };
        if digest.is_some_and(|digest| !is_digest(&digest)) {
            return wrong(place, "is no SHA-256: 64 digits of 0 to 9 and a to f");
        }
    }
    Ok(())
}

/// Sorted, none twice.
fn sorted<'a>(
    place: &str,
    mut names: impl Iterator<Item = &'a String>,
) -> Result<(), Inconsistency> {
    let Some(mut last) = names.next() else { return Ok(()) };
    for name in names {
        if name <= last {
            let message = format!("{} stands behind {}", text::quoted(name), text::quoted(last));
            return wrong(place, format!("{message}; they are sorted, and none is there twice"));
        }
        last = name;
    }
    Ok(())
}

/// What a row of a case must not say.
#[derive(Debug, thiserror::Error)]
enum BadRow {
    #[error("cites the clause {}, which is not listed", text::quoted(.0))]
    UnlistedClause(String),
    #[error("cites the clause {} twice", text::quoted(.0))]
    ClauseTwice(String),
    #[error("was executed, although it belongs to a feature that is not claimed")]
    Unclaimed,
    #[error("is newer than the revision, which its result does not say")]
    Newer,
    #[error("is not newer than the revision, which its result does not say")]
    NotNewer,
    #[error("has {0} runs, which its result contradicts")]
    Runs(usize),
    #[error("lists {0} failed runs, which its result contradicts")]
    FailedRuns(usize),
    #[error("lists {listed} failed runs and {more} more of {runs}")]
    Sum { listed: usize, more: usize, runs: usize },
    #[error("has used fuel without being executed")]
    Fuel,
    #[error("lists the run {}, which is not one of its own", text::quoted(.0))]
    ForeignRun(String),
    #[error("the run {} names a line 0; lines count from 1", text::quoted(.0))]
    LineZero(String),
    #[error("the run {} shows bytes that are no hex digits, or too many", text::quoted(.0))]
    NoBytes(String),
}

fn row(report: &Report, case: &CaseRow) -> Result<(), BadRow> {
    let mut seen = BTreeSet::new();
    for id in &case.clauses {
        if report.clause(id).is_none() {
            return Err(BadRow::UnlistedClause(id.clone()));
        }
        if !seen.insert(id) {
            return Err(BadRow::ClauseTwice(id.clone()));
        }
    }
    let is_newer = case.since > report.profile.revision;
    let is_executed = !matches!(case.result, CaseResult::Skipped { .. });
    let is_unscored = matches!(case.result, CaseResult::Unscored { .. });
    if is_executed && report.outcome(case) == Outcome::Unclaimed {
        return Err(BadRow::Unclaimed);
    }
    if is_executed && is_newer != is_unscored {
        return Err(if is_newer { BadRow::Newer } else { BadRow::NotNewer });
    }
    let has_failed = report.outcome(case).has_failed();
    let (runs, listed, more) =
        (case.runs as usize, case.failures.len(), case.more_failures as usize);
    if is_executed == (runs == 0) {
        return Err(BadRow::Runs(runs));
    }
    if has_failed == (listed == 0) {
        return Err(BadRow::FailedRuns(listed));
    }
    if listed > FAILURES || (more > 0 && listed < FAILURES) || listed.saturating_add(more) > runs {
        return Err(BadRow::Sum { listed, more, runs });
    }
    if !is_executed && case.fuel != 0 {
        return Err(BadRow::Fuel);
    }
    case.failures.iter().try_for_each(|run| failed_run(case, run))
}

fn failed_run(case: &CaseRow, run: &FailedRun) -> Result<(), BadRow> {
    let name = || run.run.clone();
    let permutation = run.run.strip_prefix(&case.id).and_then(|rest| rest.strip_prefix('/'));
    if permutation.is_none_or(str::is_empty) {
        return Err(BadRow::ForeignRun(name()));
    }
    if run.line == Some(0) {
        return Err(BadRow::LineZero(name()));
    }
    for digits in [&run.expected_bytes, &run.observed_bytes] {
        if hex::parse(digits).is_none_or(|bytes| bytes.len() > SHOWN_BYTES) {
            return Err(BadRow::NoBytes(name()));
        }
    }
    Ok(())
}

fn clauses(report: &Report) -> Result<(), Inconsistency> {
    let mut counted: BTreeMap<&str, [u32; 3]> = BTreeMap::new();
    for case in &report.cases {
        let is_executed = !matches!(case.result, CaseResult::Skipped { .. });
        let has_failed = report.outcome(case).has_failed();
        for id in &case.clauses {
            let [cited, executed, failed] = counted.entry(id).or_default();
            *cited += 1;
            *executed += u32::from(is_executed);
            *failed += u32::from(has_failed);
        }
    }
    for (number, clause) in report.clauses.iter().enumerate() {
        let ClauseRow { cited, executed, failed, .. } = *clause;
        let expected = counted.get(clause.id.as_str()).copied().unwrap_or_default();
        if expected != [cited, executed, failed] {
            let place = format!("clauses[{number}] ({})", text::quoted(&clause.id));
            let message = format!(
                "says {cited} cited, {executed} executed and {failed} failed, but the rows of the \
                 cases give {}, {} and {}",
                expected[0], expected[1], expected[2]
            );
            return wrong(&place, message);
        }
    }
    Ok(())
}

/// The first count that differs.
fn differing(said: &Counts, expected: &Counts) -> Option<(&'static str, u32, u32)> {
    let pairs = [
        ("required", said.required, expected.required),
        ("executed", said.executed, expected.executed),
        ("passed", said.passed, expected.passed),
        ("failed", said.failed, expected.failed),
        ("warned", said.warned, expected.warned),
        ("informed", said.informed, expected.informed),
        ("expected", said.expected, expected.expected),
        ("unscored", said.unscored, expected.unscored),
        ("unclaimed", said.unclaimed, expected.unclaimed),
        ("runs", said.runs, expected.runs),
    ];
    pairs.into_iter().find(|(_, said, expected)| said != expected)
}

fn fuel(report: &Report) -> Result<(), Inconsistency> {
    let Fuel { units, bytes, tenths_per_byte, largest_event, ref largest_case } = report.fuel;
    let required = report.cases.iter().filter(|case| report.outcome(case).is_required());
    let used = required.fold(0_u64, |sum, case| sum.saturating_add(case.fuel));
    if units != used {
        return wrong("fuel.units", format!("is {units}, but the required cases used {used}"));
    }
    let tenths = u128::from(units) * 10;
    let expected = tenths.checked_div(u128::from(bytes)).unwrap_or(0);
    if u128::from(tenths_per_byte) != expected {
        let message = format!("is {tenths_per_byte}, but units and bytes give {expected}");
        return wrong("fuel.tenths_per_byte", message);
    }
    if largest_event > units {
        return wrong("fuel.largest_event", format!("is {largest_event}, more than all units"));
    }
    let is_known = report.cases.binary_search_by(|case| case.id.cmp(largest_case)).is_ok();
    if is_known || (largest_case.is_empty() && largest_event == 0) {
        return Ok(());
    }
    wrong("fuel.largest_case", format!("names {}, which is no case", text::quoted(largest_case)))
}

fn conclusion(report: &Report) -> Result<(), Inconsistency> {
    let said = report.verdict;
    let is_free = match said {
        VerdictKind::NotJudged => {
            if report.counts.runs > 0 {
                return wrong("verdict", "is not-judged, although cases were executed");
            }
            true
        }
        _ if !report.lint.is_empty() => {
            let message = format!("is {}, although the module is not sound", said.text());
            return wrong("verdict", message);
        }
        VerdictKind::NotConformant => {
            report.selection.baseline.is_some() && report.explored.is_none()
        }
        _ => false,
    };
    if is_free {
        // The rows cannot show why a plug-in cannot be judged or a baseline is stale.
        let message = "gives no reason for a verdict that the rows do not give";
        return if report.reason.trim().is_empty() { wrong("reason", message) } else { Ok(()) };
    }
    let executed = report.coverage.as_ref().map_or(Reason::None, Reason::of);
    let judged = verdict(&report.counts, &report.selection, &executed);
    if report.explored.is_some() && !judged.0.is_conformant() {
        return wrong("explored", "is there, although the rows do not make it conformant");
    }
    let (expected, reason) = match &report.explored {
        Some(explored) => explored.weigh(judged),
        None => judged,
    };
    if said != expected {
        let message = format!("is {}, but the rows give {}", said.text(), expected.text());
        return wrong("verdict", message);
    }
    if report.reason != reason {
        return wrong(
            "reason",
            format!("does not follow from the counts: {}", text::quoted(&reason)),
        );
    }
    Ok(())
}
