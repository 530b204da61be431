//! A sequence diagram for the terminal: who did what, and what came of each character.

use std::fmt::Write as _;

use softplug_report::{Drawn, Side};

/// Width of what each end says beside its line.
const SIDE: usize = 34;

/// The way that an exploration found, from the top down.
pub(crate) fn drawn(rows: &[Drawn]) -> String {
    let has_second = rows.iter().any(|row| row.side == Side::Partner);
    let head = if has_second { "second plug-in (1)" } else { "partner (1)" };
    let mut drawing = format!("  {:>10}  {:<SIDE$}|{head:>SIDE$}\n", "s", "plug-in (0)");
    for Drawn { at_us, side, text } in rows {
        let time = *at_us as f64 / 1e6;
        let _ = match side {
            Side::Plugin => writeln!(drawing, "  {time:>10.6}  {text:<SIDE$}|"),
            Side::Partner => writeln!(drawing, "  {time:>10.6}  {:<SIDE$}|{text:>SIDE$}", ""),
            Side::Line => {
                let text = format!(" {text} ");
                writeln!(drawing, "  {time:>10.6}  {text:*^width$}", width = 2 * SIDE + 1)
            }
        };
    }
    drawing.truncate(drawing.trim_end().len());
    drawing
}
