//! What is filed: what was judged by what, and the lines for those who sign.

use crate::{Report, text};
use maud::{Markup, html};

/// Digits of the module's digest at the foot of each page.
const SHORT: usize = 16;

/// What was judged and by what, in the head of the page.
pub(super) fn identity(report: &Report) -> Markup {
    let (plugin, suite) = (&report.plugin, &report.suite);
    html! {
        dl.identity {
            div { dt { "Plug-in" } dd { (super::plugin_name(report)) " " (text::line(&plugin.version)) } }
            div { dt { "Profile" } dd { (text::line(&report.profile.name)) ", revision " (report.profile.revision) } }
            div { dt { "Judged by" } dd { (text::line(&suite.name)) " " (text::line(&suite.version)) } }
            @if !suite.engine.is_empty() {
                div { dt { "Engine" } dd { (text::line(&suite.engine)) } }
            }
            @if !suite.second_engine.is_empty() {
                div { dt { "Compared with" } dd { (text::line(&suite.second_engine)) } }
            }
            div.long { dt { "Module, SHA-256" } dd { code { (text::line(&plugin.sha256)) } } }
        }
    }
}

/// Lines to be signed on paper. The report knows no clock, so that two runs give the same bytes:
/// the date is given by who signs.
pub(super) fn signatures() -> Markup {
    html! {
        section id="signatures" aria-label="Signatures" {
            @for who in ["Tried by", "Approved by"] {
                div.signature {
                    p { (who) }
                    dl { @for line in ["Name", "Date", "Signature"] { div { dt { (line) } dd {} } } }
                }
            }
        }
    }
}

/// The rules for paper that hold this report's own words: what stands at the foot of each page.
pub(super) fn paper(report: &Report) -> String {
    let digest: String =
        report.plugin.sha256.chars().filter(char::is_ascii_hexdigit).take(SHORT).collect();
    format!(
        "@page {{ @bottom-left {{ content: \"Conformance report \\00b7  module {digest}\"; }} }}\n"
    )
}
