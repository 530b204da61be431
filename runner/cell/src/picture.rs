//! A chart as a picture: SVG, for people, in light and in dark.

use std::fmt::Write as _;

use crate::chart::{Chart, Doing};
use crate::setup::Setup;

const WIDTH: f64 = 860.0;
const LEFT: f64 = 150.0;
const TOP: f64 = 20.0;
const ROW: f64 = 34.0;
const BOTTOM: f64 = 46.0;
/// Most spans of a channel that are drawn.
const MOST_SPANS: usize = 2_000;
/// Marks on the axis of time.
const TICKS: u32 = 6;

const STYLE: &str = "\
.page{fill:#fff}.ink{fill:#1c2733}.faint{fill:#51606f}.grid{stroke:#dde3e9}.runs{fill:#2468a5}\
.waits{fill:#f6d9a8;stroke:#8a5300}.stands{fill:#fdecea;stroke:#b3201d}\
@media(prefers-color-scheme:dark){.page{fill:#14191f}.ink{fill:#e6ebf0}.faint{fill:#a3b0bd}\
.grid{stroke:#2b343d}.runs{fill:#6db0ec}.waits{fill:#5c4518;stroke:#ffc266}.stands{fill:#3a1c1b;stroke:#ff8a80}}";

/// Draws who ran and who waited from 0 to `end`, in milliseconds.
///
/// ```
/// use softplug_cell::{Cell, Chart, Setup, draw};
///
/// let setup = Setup::new(&["A", "B"], &[], &[])?;
/// let mut chart = Chart::new(10);
/// chart.look(0, &Cell::new(setup.clone()));
/// assert!(draw(&setup, &chart, 1_000).starts_with("<svg "));
/// # Ok::<(), softplug_cell::SetupError>(())
/// ```
pub fn draw(setup: &Setup, chart: &Chart, end: u64) -> String {
    let rows = setup.channels().count() as f64;
    let height = TOP + rows * ROW + BOTTOM;
    let x = |time: u64| LEFT + (WIDTH - LEFT - 20.0) * time as f64 / end.max(1) as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"system-ui, sans-serif\" font-size=\"14\" role=\"img\" \
         aria-label=\"Who ran and who waited\"><style>{STYLE}</style>\
         <rect class=\"page\" width=\"{WIDTH}\" height=\"{height}\"/>"
    );
    let bottom = TOP + rows * ROW;
    for tick in 0..=TICKS {
        let time = end * u64::from(tick) / u64::from(TICKS);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/>\
             <text class=\"faint\" x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\">{2:.1} s</text>",
            x(time),
            bottom + 18.0,
            time as f64 / 1_000.0
        );
    }
    for (row, channel) in setup.channels().enumerate() {
        let y = TOP + row as f64 * ROW;
        let _ = write!(
            svg,
            "<text class=\"ink\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            LEFT - 10.0,
            y + 22.0,
            setup.channel_name(channel)
        );
        for span in chart.spans(channel).take(MOST_SPANS) {
            let (class, text) = match &span.doing {
                Doing::Runs(program) => ("runs", program),
                Doing::Waits(text) => ("waits", text),
                Doing::Stands(text) => ("stands", text),
                Doing::Idle => continue,
            };
            let (from, to) = (x(span.from), x(span.to.unwrap_or(end)));
            let _ = write!(
                svg,
                "<rect class=\"{class}\" x=\"{from:.2}\" y=\"{}\" width=\"{:.2}\" height=\"{}\">\
                 <title>{}</title></rect>",
                y + 6.0,
                (to - from).max(0.5),
                ROW - 12.0,
                escaped(text)
            );
        }
    }
    let legend = [("runs", "runs"), ("waits", "waits"), ("stands", "stands")];
    for (at, (class, text)) in legend.into_iter().enumerate() {
        let left = LEFT + 90.0 * at as f64;
        let _ = write!(
            svg,
            "<rect class=\"{class}\" x=\"{left}\" y=\"{}\" width=\"18\" height=\"10\"/>\
             <text class=\"ink\" x=\"{}\" y=\"{}\">{text}</text>",
            bottom + 28.0,
            left + 24.0,
            bottom + 38.0
        );
    }
    svg.push_str("</svg>\n");
    svg
}

fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            c if c.is_control() => escaped.push('?'),
            c => escaped.push(c),
        }
    }
    escaped
}
