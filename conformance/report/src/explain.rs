//! A failed case in words, the same in every format that has room for it.

use crate::{CaseRow, FailedRun, Report, hex, text};

/// The case's clauses, a line each: `xon-xoff.tx.obey-xoff (MUST): the sentence`.
pub(crate) fn clauses(report: &Report, case: &CaseRow) -> Vec<String> {
    let line = |id: &String| {
        let id_shown = text::line(id);
        report.clause(id).map_or(id_shown.clone(), |clause| {
            let keyword = clause.level.keyword();
            format!("{id_shown} ({keyword}): {}", text::line(&clause.sentence))
        })
    };
    case.clauses.iter().map(line).collect()
}

/// All that there is to say about a failed case, as lines of text without a line end at
/// the end: its clauses, the first failed run (place, expected and observed, bytes above
/// each other, what came before, the command that runs it again), the names of the others.
///
/// Characters that could change a terminal are written out.
///
/// ```
/// use softplug_report::{explain, json};
///
/// let text = std::fs::read_to_string("tests/reports/not-conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let text = explain(&report, &report.cases[5]);
/// assert!(text.contains("observed  41 42 43 |ABC|"), "{text}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn explain(report: &Report, case: &CaseRow) -> String {
    let mut lines = vec![text::line(&case.id), text::line(&case.title)];
    lines.extend(clauses(report, case).iter().map(|clause| format!("clause {clause}")));
    for (number, run) in case.failures.iter().enumerate() {
        lines.push(String::new());
        if number == 0 {
            lines.extend(failed_run(run));
        } else {
            lines.push(format!("failed too: {}", text::line(&run.run)));
            lines.push(format!("  {}", text::line(&run.message)));
        }
    }
    if case.more_failures > 0 {
        lines.push(format!("and {}", text::count(case.more_failures, "more failed run")));
    }
    lines.join("\n")
}

/// A failed run: where, expected and observed, what came before, how to run it again.
fn failed_run(run: &FailedRun) -> Vec<String> {
    let mut lines = vec![format!("{}: {}", text::line(&run.run), text::line(&run.message))];
    if let Some(place) = place(run) {
        lines.push(format!("  --> {place}"));
    }
    lines.push(format!("  at {} s ({})", text::seconds(run.at_us), text::line(&run.class)));
    if !run.expected.is_empty() || !run.observed.is_empty() {
        lines.push(format!("    expected  {}", text::line(&run.expected)));
        lines.push(format!("    observed  {}", text::line(&run.observed)));
    }
    if let Some(difference) = hex::Difference::new(&run.expected_bytes, &run.observed_bytes) {
        lines.extend(hex::lines(&difference).iter().map(|line| format!("    {line}")));
    }
    if !run.before.is_empty() {
        lines.push("  before that".to_owned());
        lines.extend(run.before.iter().map(|line| format!("    {}", text::line(line))));
    }
    lines.push(format!("  again: {}", text::line(&run.again)));
    lines
}

/// `FILE:LINE`, `FILE`, or nothing.
pub(crate) fn place(run: &FailedRun) -> Option<String> {
    let file = text::line(&run.file);
    match run.line {
        _ if file.is_empty() => None,
        Some(line) => Some(format!("{file}:{line}")),
        None => Some(file),
    }
}
