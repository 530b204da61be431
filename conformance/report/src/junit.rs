//! `junit.xml`, for CI systems: one suite, one test case for each case. No times:
//! they would differ from run to run.

use crate::explain::explain;
use crate::{CaseResult, CaseRow, Executed, Outcome, Report, VerdictKind, text};
use quick_junit::{NonSuccessKind, Property, TestCase, TestCaseStatus, TestSuite};

/// The report in JUnit's form.
///
/// A case that failed, as far as that decides the verdict, is a failure; one that was
/// not executed is skipped, with its reason; a warning stands in `system-out`. Unless
/// the plug-in conforms, a case named `verdict` fails as well: a reader that only counts
/// failures cannot take an incomplete run for a green one.
///
/// ```
/// use softplug_report::{json, junit};
///
/// let text = std::fs::read_to_string("tests/reports/partial.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// assert!(junit::write(&report).contains(r#"<testcase name="verdict""#));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(report: &Report) -> String {
    let profile = text::line(&report.profile.name);
    let revision = report.profile.revision;
    let mut suite = TestSuite::new(format!("{profile} revision {revision}"));
    for (name, value) in properties(report) {
        suite.add_property(Property::new(name, text::line(&value)));
    }
    if let Some(case) = verdict(report) {
        suite.add_test_case(case);
    }
    suite.add_test_cases(report.cases.iter().map(|case| test_case(report, case)));
    let mut all = quick_junit::Report::new(format!(
        "{} {}",
        text::line(&report.suite.name),
        text::line(&report.suite.version)
    ));
    all.add_test_suite(suite);
    all.to_string().expect("writing to memory succeeds, and no text holds what XML cannot")
}

fn properties(report: &Report) -> Vec<(&'static str, String)> {
    let mut properties = vec![
        ("verdict", report.verdict.text().to_owned()),
        ("reason", report.reason.clone()),
        ("plugin", report.plugin.name.clone()),
        ("plugin.version", report.plugin.version.clone()),
        ("plugin.sha256", report.plugin.sha256.clone()),
        ("profile", report.profile.name.clone()),
        ("revision", report.profile.revision.to_string()),
        ("suite", format!("{} {}", report.suite.name, report.suite.version)),
        ("corpus.sha256", report.suite.corpus.clone()),
        ("engine", report.suite.engine.clone()),
        ("digest", report.digest.clone()),
        ("runs", report.counts.runs.to_string()),
        ("sessions", report.selection.sessions.to_string()),
        ("seed", report.selection.seed.to_string()),
    ];
    if let Some(coverage) = &report.coverage {
        let part = |part: Executed| format!("{} of {}", part.executed, part.of);
        properties.push(("executed.functions", part(coverage.functions)));
        properties.push(("executed.branches", part(coverage.branches)));
    }
    if let Some(explored) = &report.explored {
        properties.push(("explored.faults", explored.faults.to_string()));
        properties.push(("explored.states", explored.states().to_string()));
        let digests = explored.configurations.iter();
        let digests = digests.map(|configuration| configuration.digest.as_str());
        properties.push(("explored.digests", digests.collect::<Vec<_>>().join(" ")));
    }
    if let Some(score) = &report.score {
        let all = score.told();
        properties.push(("score", format!("{} of {all} changes", score.noticed.all())));
    }
    properties
}

/// The case that says why the run is not green.
fn verdict(report: &Report) -> Option<TestCase> {
    let (kind, name) = match report.verdict {
        VerdictKind::Conformant | VerdictKind::ConformantWithWarnings => return None,
        VerdictKind::NotConformant => (NonSuccessKind::Failure, "not-conformant"),
        VerdictKind::Partial => (NonSuccessKind::Error, "partial"),
        VerdictKind::NotJudged => (NonSuccessKind::Error, "not-judged"),
    };
    let sentence = format!("{}: {}", report.verdict.text(), text::line(&report.reason));
    let findings = report.lint.iter().map(|finding| text::line(finding));
    let lines: Vec<_> = std::iter::once(sentence.clone()).chain(findings).collect();
    let mut status = TestCaseStatus::non_success(kind);
    status.set_message(sentence).set_type(name).set_description(lines.join("\n"));
    let mut case = TestCase::new("verdict", status);
    case.set_classname(text::line(&report.profile.name));
    Some(case)
}

fn test_case(report: &Report, case: &CaseRow) -> TestCase {
    let outcome = report.outcome(case);
    let mut status = match outcome {
        Outcome::Failed => TestCaseStatus::non_success(NonSuccessKind::Failure),
        Outcome::Passed | Outcome::Warned | Outcome::Informed => TestCaseStatus::success(),
        _ => TestCaseStatus::skipped(),
    };
    match outcome {
        Outcome::Passed | Outcome::Warned | Outcome::Informed => {}
        Outcome::Failed => {
            let first = case.failures.first();
            status.set_message(first.map_or_else(String::new, |run| text::line(&run.message)));
            status.set_type(first.map_or_else(String::new, |run| text::line(&run.class)));
            status.set_description(explain(report, case));
        }
        _ => {
            status.set_message(skip_reason(outcome, case));
        }
    }
    let mut test = TestCase::new(text::line(&case.id), status);
    let clauses = case.clauses.iter().map(|clause| text::line(clause));
    test.set_classname(case.clauses.first().map_or_else(String::new, |clause| text::line(clause)));
    test.add_property(Property::new("title", text::line(&case.title)));
    test.add_property(Property::new("level", case.level.keyword()));
    test.add_property(Property::new("outcome", outcome.text()));
    test.add_properties(clauses.map(|clause| Property::new("clause", clause)));
    if outcome != Outcome::Failed && outcome.has_failed() {
        let weight = match outcome {
            Outcome::Warned => "warning",
            Outcome::Informed => "note",
            _ => "does not count",
        };
        test.set_system_out(format!("{weight}: {}", explain(report, case)));
    }
    test
}

fn skip_reason(outcome: Outcome, case: &CaseRow) -> String {
    match &case.result {
        CaseResult::ExpectedFailure { reason } => {
            format!("failed as the baseline expects: {}", text::line(reason))
        }
        CaseResult::Skipped { reason } => text::line(reason),
        _ => format!("{}: newer than the revision", outcome.text()),
    }
}
