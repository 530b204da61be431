//! What happened before a failure as a picture: time downwards, the partner, the
//! plug-in and the host side by side.

use crate::{FailedRun, text};
use maud::{Markup, html};

/// Lines that are drawn, without the last two.
const DRAWN: usize = 14;
/// Characters of a label.
const LABEL: usize = 34;
const WIDTH: u32 = 720;
const TOP: u32 = 44;
const ROW: u32 = 38;
/// Where the time stands, and the three lifelines.
const TIME: u32 = 86;
const PARTNER: u32 = 130;
const PLUGIN: u32 = 410;
const HOST: u32 = 690;

/// A line of a trace, as far as the picture needs it.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Step {
    kind: Kind,
    /// As it is written; empty without one.
    time: String,
    what: String,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Kind {
    /// `<`, `<<`
    Received,
    /// `>`
    Sent,
    /// `!`
    LineEvent,
    /// `?`
    Request,
    /// `=`
    Action,
    /// `.`
    Quiet,
    /// Anything else: a note, or `nothing`.
    Note,
}

impl Step {
    /// `KIND TIME[~TIME] WHAT ; ANNOTATION`. What is no such line is a note, with a time in
    /// front or without.
    fn parse(line: &str) -> Self {
        let line = text::line(line);
        let line = line.trim();
        let is_time = |word: &&str| {
            word.starts_with(|c: char| c.is_ascii_digit())
                && word.contains('.')
                && word.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'.' | b'~'))
        };
        let note = || {
            let (first, rest) = line.split_once(' ').unwrap_or((line, ""));
            let (time, what) = if is_time(&first) { (first, rest) } else { ("", line) };
            Self { kind: Kind::Note, time: time.to_owned(), what: words(what) }
        };
        let mut parts = line.splitn(3, char::is_whitespace);
        let kind = match parts.next() {
            Some("<" | "<<") => Kind::Received,
            Some(">") => Kind::Sent,
            Some("!") => Kind::LineEvent,
            Some("?") => Kind::Request,
            Some("=") => Kind::Action,
            Some(".") => Kind::Quiet,
            _ => return note(),
        };
        let Some(time) = parts.next().filter(is_time) else { return note() };
        let what = words(parts.next().unwrap_or_default());
        Self { kind, time: time.to_owned(), what }
    }
}

impl Step {
    /// When it begins, in µs.
    fn micros(&self) -> Option<u64> {
        let (seconds, fraction) = self.time.split('~').next()?.split_once('.')?;
        let fraction: u64 = format!("{fraction:0<6}").parse().ok()?;
        seconds.parse::<u64>().ok()?.checked_mul(1_000_000)?.checked_add(fraction)
    }
}

/// The text with single spaces.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// How a row is drawn.
#[derive(Copy, Clone, PartialEq, Eq)]
enum Role {
    Before,
    Expected,
    Observed,
}

/// The picture; nothing where there is nothing to draw.
pub(super) fn picture(run: &FailedRun) -> Markup {
    let skipped = run.before.len().saturating_sub(DRAWN);
    let mut rows: Vec<_> =
        run.before[skipped..].iter().map(|line| (Role::Before, Step::parse(line))).collect();
    for (role, line) in [(Role::Expected, &run.expected), (Role::Observed, &run.observed)] {
        if !line.is_empty() {
            rows.push((role, Step::parse(line)));
        }
    }
    if let [.., (Role::Expected, expected), (Role::Observed, observed)] = &rows[..]
        && observed.micros().is_some_and(|at| Some(at) < expected.micros())
    {
        let last = rows.len() - 1;
        rows.swap(last, last - 1);
    }
    if rows.is_empty() {
        return html! {};
    }
    let height = TOP + ROW * rows.len() as u32 + 16;
    let label = format!("Sequence of events up to {} s", text::seconds(run.at_us));
    html! {
        figure {
            div.wide tabindex="0" role="region" aria-label="Sequence picture" {
                svg.sequence viewBox={ "0 0 " (WIDTH) " " (height) } role="img" aria-label=(label) {
                    @for (x, name) in [(PARTNER, "partner"), (PLUGIN, "plug-in"), (HOST, "host")] {
                        line.life x1=(x) y1=(TOP - 12) x2=(x) y2=(height - 8) {}
                        text.head x=(x) y=(TOP - 20) { (name) }
                    }
                    @for (number, (role, step)) in rows.iter().enumerate() {
                        (row(*role, step, TOP + ROW * number as u32 + 22))
                    }
                }
            }
            figcaption {
                @if skipped > 0 { (skipped) " earlier lines are not drawn. " }
                "Dashed: what was expected. Thick: what was observed instead."
            }
        }
    }
}

fn row(role: Role, step: &Step, y: u32) -> Markup {
    let (from, to) = match step.kind {
        Kind::Received | Kind::LineEvent => (PARTNER, PLUGIN),
        Kind::Sent => (PLUGIN, PARTNER),
        Kind::Request => (HOST, PLUGIN),
        Kind::Action => (PLUGIN, HOST),
        // What is missing or wrong is the plug-in's, towards either side.
        Kind::Quiet | Kind::Note => (PLUGIN, PLUGIN),
    };
    let (class, prefix) = match role {
        Role::Before => ("before", ""),
        Role::Expected => ("expected", "expected: "),
        Role::Observed => ("observed", "observed: "),
    };
    let prefix = format!("{prefix}{}", if step.kind == Kind::LineEvent { "line: " } else { "" });
    let what = if step.kind == Kind::Quiet { "nothing until here" } else { step.what.as_str() };
    let label = shortened(&format!("{prefix}{what}"));
    let middle = u32::midpoint(from, to);
    html! {
        g class=(class) {
            title { (prefix) (step.time) " " (step.what) }
            text.time x=(TIME) y=(y + 4) { (step.time.split('~').next().unwrap_or_default()) }
            @if from == to {
                circle cx=(from) cy=(y) r="4" {}
                text.label x=(from) y=(y - 8) { (label) }
            } @else {
                line.arrow x1=(from) y1=(y) x2=(to) y2=(y) {}
                polygon.tip points=(tip(from, to, y)) {}
                text.label x=(middle) y=(y - 6) { (label) }
            }
        }
    }
}

/// The three corners of an arrow's tip.
fn tip(from: u32, to: u32, y: u32) -> String {
    let back = if to > from { to - 10 } else { to + 10 };
    format!("{to},{y} {back},{} {back},{}", y - 5, y + 5)
}

fn shortened(label: &str) -> String {
    if label.chars().count() <= LABEL {
        return label.to_owned();
    }
    label.chars().take(LABEL - 1).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_traces_are_read_and_all_else_is_a_note() {
        let step = Step::parse("> 0.001500~0.002000 41 42   ; 'AB'");
        assert_eq!((step.kind, step.time.as_str()), (Kind::Sent, "0.001500~0.002000"));
        assert_eq!(step.what, "41 42 ; 'AB'");
        let step = Step::parse("1.500000 the control  sends XON");
        assert_eq!((step.kind, step.time.as_str()), (Kind::Note, "1.500000"));
        assert_eq!(step.what, "the control sends XON");
        assert_eq!(Step::parse(". 5.000000").kind, Kind::Quiet);
        assert_eq!(Step::parse("<< 1.000000 11").kind, Kind::Received);
        for line in ["nothing", "", ">", "> soon 41", "nothing; then > 1.000000 41", "# 1.0 x"] {
            assert_eq!(Step::parse(line).kind, Kind::Note, "{line}");
        }
    }

    #[test]
    fn times_are_compared_as_numbers() {
        let micros = |time: &str| Step::parse(&format!("> {time} 41")).micros();
        assert_eq!(micros("2.5"), Some(2_500_000));
        assert_eq!(micros("10.000001~11.0"), Some(10_000_001));
        assert_eq!(micros("99999999999999999999.0"), None);
        assert_eq!(Step::parse("nothing").micros(), None);
    }

    #[test]
    fn labels_are_short() {
        assert_eq!(shortened("> 41"), "> 41");
        assert_eq!(shortened(&"ä".repeat(60)).chars().count(), LABEL);
    }
}
