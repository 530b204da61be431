//! `badge.json`, for the endpoint of shields.io: what was judged, by what, and the
//! verdict. No percentage: nine tenths of a protocol is not a protocol.

use crate::{Report, VerdictKind, text};
use serde::Serialize;

/// The report as a badge.
///
/// ```
/// use softplug_report::{badge, json};
///
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// assert!(badge::write(&report).contains(r#""message": "conformant (softplug 0.1.0)""#));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(report: &Report) -> String {
    let (suite, profile) = (&report.suite, &report.profile);
    let verdict = report.verdict;
    let badge = Badge {
        schema_version: 1,
        label: format!("{} r{}", text::line(&profile.name), profile.revision),
        message: format!(
            "{}{} ({} {})",
            verdict.text(),
            unexecuted(report),
            text::line(&suite.name),
            text::line(&suite.version)
        ),
        color: match verdict {
            VerdictKind::Conformant => "brightgreen",
            VerdictKind::ConformantWithWarnings => "yellowgreen",
            VerdictKind::Partial => "orange",
            VerdictKind::NotConformant => "red",
            VerdictKind::NotJudged => "lightgrey",
        },
        is_error: !verdict.is_conformant(),
    };
    let mut text = serde_json::to_string_pretty(&badge).expect("a badge is texts and a number");
    text.push('\n');
    text
}

/// What a conformant plug-in has that no run executed.
fn unexecuted(report: &Report) -> String {
    match report.coverage.as_ref().map_or(0, |coverage| coverage.places.len()) {
        0 => String::new(),
        places => format!(", {} never executed", text::count(places as u32, "place")),
    }
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Badge {
    schema_version: u32,
    label: String,
    message: String,
    color: &'static str,
    /// The page that shows the badge cannot give it another colour.
    is_error: bool,
}
