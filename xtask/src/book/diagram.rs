//! Diagrams of the book: what stands in it as mermaid's text, as a picture.
//!
//! Both kinds are drawn alike: participants or states are columns, messages or transitions
//! are arrows between them, from top to bottom in the order of the text.

use std::fmt::Write as _;

/// Between two lines.
const STEP: usize = 34;
/// Above and beside the picture.
const MARGIN: usize = 70;
/// A character of a label is about as wide.
const CHARACTER: usize = 7;
/// Least distance between two columns.
const LANE: usize = 120;

/// A line that is not understood.
#[derive(Debug, thiserror::Error)]
#[error("this line of a diagram cannot be drawn: {0}")]
pub(crate) struct DiagramError(String);

/// A picture in SVG, in the colours of the page that it stands in.
pub(crate) fn svg(source: &str) -> Result<String, DiagramError> {
    let mut diagram = Diagram::default();
    for line in source.lines().map(str::trim) {
        diagram.read(line).ok_or_else(|| DiagramError(line.to_owned()))?;
    }
    Ok(diagram.draw())
}

#[derive(Default)]
struct Diagram {
    /// Name in the text, and what is shown.
    columns: Vec<(String, String)>,
    rows: Vec<Row>,
}

enum Row {
    Arrow {
        from: usize,
        to: usize,
        is_dashed: bool,
        text: String,
    },
    /// Where it begins.
    Begin {
        at: usize,
        text: String,
    },
    Note {
        from: usize,
        to: usize,
        text: String,
    },
}

impl Diagram {
    fn read(&mut self, line: &str) -> Option<()> {
        if line.is_empty() || line == "sequenceDiagram" || line == "stateDiagram-v2" {
        } else if let Some(rest) = line.strip_prefix("participant ") {
            let (name, shown) = rest.split_once(" as ").unwrap_or((rest, rest));
            self.columns.push((name.to_owned(), shown.to_owned()));
        } else if let Some(rest) = line.strip_prefix("state \"") {
            let (shown, name) = rest.split_once("\" as ")?;
            self.columns.push((name.to_owned(), shown.to_owned()));
        } else if let Some(rest) = line.strip_prefix("Note over ") {
            let (over, text) = rest.split_once(": ")?;
            let (from, to) = over.split_once(',').unwrap_or((over, over));
            let (from, to) = (self.column(from), self.column(to));
            self.rows.push(Row::Note { from, to, text: text.to_owned() });
        } else {
            let (arrow, is_dashed) = ["-->>", "->>", "-->"]
                .iter()
                .find(|arrow| line.contains(**arrow))
                .map(|arrow| (*arrow, *arrow == "-->>"))?;
            let (from, rest) = line.split_once(arrow)?;
            let (to, text) = rest.split_once(": ").unwrap_or((rest, ""));
            let (to, text) = (self.column(to), text.to_owned());
            let row = match from.trim() {
                "[*]" => Row::Begin { at: to, text },
                from => Row::Arrow { from: self.column(from), to, is_dashed, text },
            };
            self.rows.push(row);
        }
        Some(())
    }

    /// The place of a column; a new one if its name is.
    fn column(&mut self, name: &str) -> usize {
        let name = name.trim();
        self.columns.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.columns.push((name.to_owned(), name.to_owned()));
            self.columns.len() - 1
        })
    }

    fn places(&self) -> Vec<usize> {
        let widest = self.columns.iter().map(|(_, shown)| shown.len()).max().unwrap_or(0);
        // Of few columns, arrows are made as long as what they say.
        let texts = self.rows.iter().map(|row| match row {
            Row::Arrow { text, .. } if self.columns.len() <= 3 => text.chars().count(),
            _ => 0,
        });
        let lane = LANE.max(widest * CHARACTER + 30).max(texts.max().unwrap_or(0) * CHARACTER + 30);
        (0..self.columns.len()).map(|column| MARGIN + column * lane).collect()
    }

    fn draw(&self) -> String {
        let places = self.places();
        let height = 60 + self.rows.len() * STEP + 10;
        let mut width = places.last().copied().unwrap_or(0) + MARGIN;
        let mut body = String::new();
        for ((_, shown), x) in self.columns.iter().zip(&places) {
            let text = escaped(shown);
            let _ = write!(
                body,
                "<line x1=\"{x}\" y1=\"34\" x2=\"{x}\" y2=\"{height}\" class=\"life\"/>\
                 <text x=\"{x}\" y=\"24\" class=\"head\">{text}</text>"
            );
        }
        for (row, y) in self.rows.iter().zip((0..).map(|at| 70 + at * STEP)) {
            let (x, text) = match row {
                Row::Arrow { from, to, is_dashed, text } if from == to => {
                    let x = places[*from];
                    let (out, low, class) = (x + 26, y + 10, class(*is_dashed));
                    let _ = write!(
                        body,
                        "<path d=\"M{x} {y}H{out}V{low}H{}\" class=\"{class}\"/>",
                        x + 3
                    );
                    (x + 32, text)
                }
                Row::Arrow { from, to, is_dashed, text } => {
                    let (begin, end) = (places[*from], places[*to]);
                    let tip = if begin < end { end - 3 } else { end + 3 };
                    let class = class(*is_dashed);
                    let _ = write!(body, "<path d=\"M{begin} {y}H{tip}\" class=\"{class}\"/>");
                    (begin.min(end) + 8, text)
                }
                Row::Begin { at, text } => {
                    let x = places[*at];
                    let _ = write!(
                        body,
                        "<circle cx=\"{}\" cy=\"{y}\" r=\"5\"/><path d=\"M{} {y}H{}\" class=\"arrow\"/>",
                        x - 50,
                        x - 45,
                        x - 3
                    );
                    (x + 8, text)
                }
                Row::Note { from, to, text } => {
                    let (begin, end) = (places[*from], places[*to]);
                    let left = begin.min(end).saturating_sub(30);
                    let wide = begin
                        .abs_diff(end)
                        .max((text.chars().count() * CHARACTER).saturating_sub(40))
                        + 60;
                    let _ = write!(
                        body,
                        "<rect x=\"{left}\" y=\"{}\" width=\"{wide}\" height=\"24\" class=\"note\"/>",
                        y - 18
                    );
                    width = width.max(left + wide + 10);
                    (left + 10, text)
                }
            };
            width = width.max(x + text.chars().count() * CHARACTER + 10);
            let raised = if matches!(row, Row::Note { .. }) { y - 2 } else { y - 5 };
            let _ = write!(body, "<text x=\"{x}\" y=\"{raised}\">{}</text>", escaped(text));
        }
        format!(
            "<svg class=\"diagram\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             role=\"img\" xmlns=\"http://www.w3.org/2000/svg\">{ARROW}{body}</svg>"
        )
    }
}

/// The head of an arrow.
const ARROW: &str = "<defs><marker id=\"head\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" \
    markerWidth=\"8\" markerHeight=\"8\" orient=\"auto-start-reverse\">\
    <path d=\"M0 0L8 4L0 8z\" fill=\"currentColor\"/></marker></defs>";

fn class(is_dashed: bool) -> &'static str {
    if is_dashed { "arrow dashed" } else { "arrow" }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_are_drawn() {
        let state = svg("stateDiagram-v2\nstate \"a b\" as c\n[*] --> idle\nidle --> c: x <1>\nc --> c: again\n").unwrap();
        assert!(
            state.contains(">a b<") && state.contains("x &lt;1&gt;") && state.contains("<circle")
        );
        let course = svg("sequenceDiagram\nparticipant S as sender\nparticipant R as receiver\nS->>R: 02\nR-->>S: 10\nNote over S,R: done\n").unwrap();
        assert!(
            course.contains("arrow dashed")
                && course.contains(">sender<")
                && course.contains("<rect")
        );
        let columns = course.matches("class=\"life\"").count();
        assert_eq!(columns, 2);
    }

    #[test]
    fn what_is_not_understood_is_an_error() {
        assert!(svg("pie\n\"a\": 1\n").is_err());
    }
}
