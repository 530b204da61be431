//! Workflow commands of GitHub Actions: failed cases as annotations.

use crate::explain::explain;
use crate::{Outcome, Report, VerdictKind, text};
use std::fmt::Write;

/// The report as workflow commands, a line each: first the verdict (GitHub shows only
/// the first ten of a kind), then every failed case.
///
/// ```
/// use softplug_report::{annotations, json};
///
/// let text = std::fs::read_to_string("tests/reports/partial.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let text = annotations::write(&report);
/// assert!(text.starts_with("::error title=xon-xoff revision 1%3A partial::"), "{text}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(report: &Report) -> String {
    let mut text = String::new();
    let command = match report.verdict {
        VerdictKind::Conformant => "notice",
        VerdictKind::ConformantWithWarnings => "warning",
        VerdictKind::Partial | VerdictKind::NotConformant | VerdictKind::NotJudged => "error",
    };
    let profile = text::line(&report.profile.name);
    let revision = report.profile.revision;
    let title = format!("{profile} revision {revision}: {}", report.verdict.text());
    let findings = report.lint.iter().map(|finding| text::line(finding));
    let message: Vec<_> = std::iter::once(text::line(&report.reason)).chain(findings).collect();
    let _ = writeln!(text, "::{command} title={}::{}", property(&title), data(&message.join("\n")));
    for case in &report.cases {
        let command = match report.outcome(case) {
            Outcome::Failed => "error",
            Outcome::Warned => "warning",
            outcome if outcome.has_failed() => "notice",
            _ => continue,
        };
        let _ = write!(text, "::{command} ");
        if let Some(run) = case.failures.first().filter(|run| !run.file.is_empty()) {
            let _ = write!(text, "file={},", property(&text::line(&run.file)));
            if let Some(line) = run.line {
                let _ = write!(text, "line={line},");
            }
        }
        let title = property(&text::line(&case.id));
        let _ = writeln!(text, "title={title}::{}", data(&explain(report, case)));
    }
    text
}

/// What stands behind `::`.
fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

/// The value of a property.
fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_cannot_leave_their_command() {
        assert_eq!(data("50%\r\n::error::x"), "50%25%0D%0A::error::x");
        assert_eq!(property("a:b,c%\n"), "a%3Ab%2Cc%25%0A");
    }
}
