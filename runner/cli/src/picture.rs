//! A course of events as a picture in text: partner, plug-in and host side by
//! side, time running downwards.

use std::fmt::Write as _;

/// Characters between two lifelines.
const LANE: usize = 36;
/// Characters before the first lifeline: the time.
const MARGIN: usize = 13;

/// What the picture is drawn with.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Glyphs {
    life: char,
    shaft: char,
    left: char,
    right: char,
    more: &'static str,
}

impl Glyphs {
    const BOXES: Self = Self { life: '│', shaft: '─', left: '◀', right: '▶', more: "…" };
    /// For terminals that know nothing else.
    pub(crate) const ASCII: Self =
        Self { life: '|', shaft: '-', left: '<', right: '>', more: "..." };

    /// Box-drawing characters where the terminal's locale knows them.
    pub(crate) fn of_locale() -> Self {
        let set = ["LC_ALL", "LC_CTYPE", "LANG"];
        let locale = set.iter().filter_map(|name| std::env::var(name).ok());
        Self::named(locale.into_iter().find(|locale| !locale.is_empty()).as_deref())
    }

    fn named(locale: Option<&str>) -> Self {
        let codeset = locale.and_then(|locale| locale.split_once('.')).map(|(_, codeset)| codeset);
        match codeset.map(str::to_ascii_lowercase).as_deref() {
            Some("utf-8" | "utf8") => Self::BOXES,
            _ => Self::ASCII,
        }
    }
}

/// Where an event is drawn.
enum Row<'a> {
    /// Between partner and plug-in; to the right: the plug-in is given it.
    Line { to_plug_in: bool, text: String },
    /// Between plug-in and host; to the right: the host is given it.
    Host { to_host: bool, text: String },
    /// Across all of it.
    Note(&'a str),
}

/// Draws the lines of a trace; lines that are none are left out.
pub(crate) fn picture<'a>(lines: impl IntoIterator<Item = &'a str>, glyphs: Glyphs) -> String {
    let title = |name: &str| format!("{name:^9}");
    let (partner, plug_in) = (title("partner"), title("plug-in"));
    let (start, gap) = (MARGIN - 4, LANE - 8);
    let mut picture = format!("{:start$}{partner}{:gap$}{plug_in}{:gap$}  host\n", "", "", "");
    for line in lines {
        let Some((time, row)) = row(line) else { continue };
        let left = |text| arrow(glyphs, false, text);
        let right = |text| arrow(glyphs, true, text);
        let empty = " ".repeat(LANE);
        let (line_lane, host_lane) = match &row {
            Row::Line { to_plug_in: true, text } => (right(text), empty),
            Row::Line { to_plug_in: false, text } => (left(text), empty),
            Row::Host { to_host: true, text } => (empty, right(text)),
            Row::Host { to_host: false, text } => (empty, left(text)),
            Row::Note(text) => {
                let _ = writeln!(picture, "{time:>12} {} {text}", glyphs.life);
                continue;
            }
        };
        let life = glyphs.life;
        let _ = writeln!(picture, "{time:>12} {life}{line_lane}{life}{host_lane}{life}");
    }
    picture
}

/// An arrow of a lane's length with a text in its middle.
fn arrow(glyphs: Glyphs, to_right: bool, text: &str) -> String {
    let most = LANE - 8;
    let mut text = text.to_owned();
    if text.chars().count() > most {
        text = text.chars().take(most - glyphs.more.len().min(3)).collect::<String>() + glyphs.more;
    }
    let shafts = LANE - 3 - text.chars().count();
    let shaft = |count: usize| std::iter::repeat_n(glyphs.shaft, count).collect::<String>();
    let (before, after) = (shaft(shafts / 2), shaft(shafts - shafts / 2));
    if to_right {
        format!("{before} {text} {after}{}", glyphs.right)
    } else {
        format!("{}{before} {text} {after}", glyphs.left)
    }
}

/// `< 2.050000 10  ; DLE`
fn row(line: &str) -> Option<(String, Row<'_>)> {
    let line = line.trim();
    if let Some(comment) = line.strip_prefix('#') {
        return Some((String::new(), Row::Note(comment.trim())));
    }
    let (sign, rest) = line.split_once(' ')?;
    let (time, what) = rest.trim_start().split_once(' ').unwrap_or((rest.trim_start(), ""));
    let (what, annotation) = match what.split_once("  ; ") {
        Some((what, annotation)) => (what.trim(), Some(annotation.trim())),
        None => (what.trim(), None),
    };
    let text = match annotation {
        Some(annotation) if !annotation.contains(what) => format!("{what}  {annotation}"),
        _ => what.to_owned(),
    };
    let row = match sign {
        "<" => Row::Line { to_plug_in: true, text },
        "<<" => Row::Line { to_plug_in: true, text: format!("{text} (burst)") },
        "!" => Row::Line { to_plug_in: true, text: format!("! {text}") },
        ">" => Row::Line { to_plug_in: false, text },
        "?" => Row::Host { to_host: false, text },
        "=" => Row::Host { to_host: true, text },
        "." => Row::Note("nothing more until here"),
        _ => return None,
    };
    // Of a window its beginning is enough.
    let time = match time.split_once('~') {
        Some((from, _)) => format!("{from}~"),
        None => time.to_owned(),
    };
    Some((time, row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_line_has_its_place() {
        let lines = [
            "? 0.000000 send 1 \"AB\"",
            "> 0.000000 02             ; STX",
            "# The second attempt.",
            "< 2.050000~2.051000 10             ; DLE",
            "! 2.060000 break",
            "<< 3.000000 gen:text(1,121)",
            "= 4.000000 fail 1 no-answer status=1795 sent=123456789 and more",
            ". 6.000000",
        ];
        let drawn = picture(lines, Glyphs::ASCII);
        let lines: Vec<_> = drawn.lines().collect();
        assert_eq!(lines.len(), 9, "{drawn}");
        assert!(lines[1].ends_with("- send 1 \"AB\" -----------|"), "{drawn}");
        assert!(lines[2].contains("|<") && lines[2].contains("- 02  STX -"), "{drawn}");
        assert!(lines[3].ends_with("| The second attempt."), "{drawn}");
        assert!(lines[4].contains("  2.050000~ |-") && lines[4].contains("10  DLE"), "{drawn}");
        assert!(lines[5].contains("- ! break -") && lines[5].contains(">|"), "{drawn}");
        assert!(lines[6].contains("gen:text(1,121) (burst)"), "{drawn}");
        assert!(lines[7].contains("...") && lines[7].ends_with(">|"), "{drawn}");
        assert!(lines[8].contains("nothing more until here"), "{drawn}");
        let widths = [1, 2, 4, 5, 6, 7].map(|at| lines[at].chars().count());
        assert!(widths.windows(2).all(|pair| pair[0] == pair[1]), "{widths:?}\n{drawn}");
    }

    #[test]
    fn boxes_are_drawn_where_the_locale_knows_them() {
        for (locale, glyphs) in [
            (Some("de_DE.UTF-8"), Glyphs::BOXES),
            (Some("C.utf8"), Glyphs::BOXES),
            (Some("C"), Glyphs::ASCII),
            (Some("de_DE.ISO-8859-1"), Glyphs::ASCII),
            (None, Glyphs::ASCII),
        ] {
            assert_eq!(Glyphs::named(locale), glyphs, "{locale:?}");
        }
    }
}
