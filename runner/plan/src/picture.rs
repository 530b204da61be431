//! Levels over time as a picture: SVG, for people, in light and in dark.
//!
//! Each machine has a row: its unit above, its control below, each from empty to full. Where it ran
//! dry the row is red.

use std::fmt::Write as _;

use crate::planning::Plan;
use crate::shop::{Shop, is_nothing};
use crate::simulation::{Discipline, MachineOutcome, Options, Outcome, Sample, simulate};

/// Most machines that are drawn. Of more, the first ones are, and those that ran dry before others.
const MOST_ROWS: usize = 12;
/// Most characters of a name that are drawn.
const MOST_NAME: usize = 18;
/// Widest name that is drawn, in parts of the size of its letters. Of wider ones the end is cut.
const MOST_NAME_WIDTH: f64 = 10.5;

/// Rounds that are drawn of a shop with its plan.
const ROUNDS: f64 = 3.0;
/// Rounds in which a dry spell is looked for.
const MOST_ROUNDS: f64 = 40.0;
/// Fills that are simulated for a picture at most: the rounds of the largest shop.
const MOST_SERVICES: u64 = 40_000;

const WIDTH: f64 = 820.0;
const LEFT: f64 = 150.0;
const RIGHT: f64 = 130.0;
const TOP: f64 = 58.0;
const UNIT: f64 = 40.0;
const CONTROL: f64 = 16.0;
const GAP: f64 = 4.0;
const ROW: f64 = UNIT + GAP + CONTROL + 16.0;
const BOTTOM: f64 = 48.0;

const STYLE: &str = "\
.page{fill:#fff}.ink{fill:#1c2733}.faint{fill:#51606f}.axis{stroke:#8a97a4;fill:none}.grid{stroke:#dde3e9}\
.frame{fill:#f2f5f8}.unit{fill:#3b82c4;fill-opacity:.35;stroke:#2468a5}.control{fill:#3c9a6a;fill-opacity:.45;stroke:#277a50}\
.dry{fill:#d33a2f;fill-opacity:.75}\
@media(prefers-color-scheme:dark){.page{fill:#14191f}.ink{fill:#e6ebf0}.faint{fill:#a3b0bd}.axis{stroke:#76838f}\
.grid{stroke:#2b343d}.frame{fill:#1d242c}.unit{stroke:#6db0ec}.control{stroke:#62c795}.dry{fill:#ff6a5e}}";

/// Draws the first rounds of a shop with its plan, from full buffers, as the model serves them. Of
/// a shop that is not feasible it is what comes of the largest buffers that constraint 3 allows, up
/// to the first dry spell.
pub fn picture_of(shop: &Shop, plan: &Plan) -> String {
    let service = plan.service();
    let round = service.round_seconds(shop.bus());
    let run = |seconds: f64, keeps_levels: bool| {
        let feeds_while_filled = plan.must_feed_while_filled();
        let options = Options {
            seconds,
            feeds_while_filled,
            keeps_levels,
            most_services: MOST_SERVICES,
            ..Options::default()
        };
        simulate(shop, &service, Discipline::Slots, &options)
    };
    let first_dry = |outcome: &Outcome| {
        let dry = outcome.machines.iter().filter_map(|machine| machine.dry.first());
        dry.map(|dry| dry.from + dry.seconds).min_by(f64::total_cmp)
    };
    let dry = if plan.feasible { None } else { first_dry(&run(MOST_ROUNDS * round, false)) };
    picture(&run(dry.map_or(ROUNDS * round, |dry| 1.1 * dry), true))
}

/// Draws what came of a simulation whose levels were kept, as an SVG document. Names are escaped.
/// Of more than 12 machines 12 are drawn.
pub fn picture(outcome: &Outcome) -> String {
    let rows = rows(outcome);
    let left_out = outcome.machines.len() - rows.len();
    let height = TOP + ROW * rows.len() as f64 + BOTTOM;
    let scale = Scale { seconds: outcome.seconds.max(f64::MIN_POSITIVE) };

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         role=\"img\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <title>Levels of the buffers of units and controls over time</title>\n\
         <style>{STYLE}</style>\n\
         <rect class=\"page\" width=\"{WIDTH}\" height=\"{height}\" rx=\"8\"/>\n"
    );
    legend(&mut svg, outcome);
    grid(&mut svg, &scale, rows.len());
    for (index, machine) in rows.iter().enumerate() {
        row(&mut svg, machine, &scale, TOP + ROW * index as f64);
    }
    if left_out > 0 {
        let y = height - 12.0;
        let plural = if left_out == 1 { "" } else { "s" };
        let text = format!(
            "and {left_out} more machine{plural}; those that ran dry are drawn first, then the others, \
             in their order"
        );
        put(&mut svg, 16.0, y, "faint", "start", &text);
    }
    svg.push_str("</svg>\n");
    svg
}

/// The machines that are drawn, in their order.
fn rows(outcome: &Outcome) -> Vec<&MachineOutcome> {
    let mut indices: Vec<_> = (0..outcome.machines.len()).collect();
    indices.sort_by_key(|index| outcome.machines[*index].times_dry == 0);
    indices.truncate(MOST_ROWS);
    indices.sort_unstable();
    indices.into_iter().map(|index| &outcome.machines[index]).collect()
}

struct Scale {
    seconds: f64,
}

impl Scale {
    fn x(&self, at: f64) -> f64 {
        LEFT + (WIDTH - LEFT - RIGHT) * (at / self.seconds).clamp(0.0, 1.0)
    }

    /// 1, 2 or 5 times a power of ten, so that there are five to ten of them.
    fn step(&self) -> f64 {
        let rough = self.seconds / 8.0;
        let power = 10f64.powf(rough.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
        steps.into_iter().find(|step| *step >= rough).unwrap_or(10.0 * power)
    }
}

fn legend(svg: &mut String, outcome: &Outcome) {
    let entries = [("unit", "buffer of the unit"), ("control", "the control's own buffer")];
    let dry = outcome.ran_dry().then_some(("dry", "the machine is dry"));
    for (index, (class, text)) in entries.into_iter().chain(dry).enumerate() {
        let x = LEFT + 200.0 * index as f64;
        let _ = writeln!(
            svg,
            "<rect class=\"{class}\" x=\"{x}\" y=\"19\" width=\"14\" height=\"12\" rx=\"2\"/>"
        );
        put(svg, x + 20.0, 30.0, "ink", "start", text);
    }
}

fn grid(svg: &mut String, scale: &Scale, rows: usize) {
    let bottom = TOP + ROW * rows as f64;
    let step = scale.step();
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let ticks = (scale.seconds / step + 1e-9) as usize;
    for tick in 0..=ticks {
        let at = step * tick as f64;
        let x = scale.x(at);
        let _ = writeln!(svg, "<path class=\"grid\" d=\"M{x:.1} {:.1}V{bottom:.1}\"/>", TOP - 6.0);
        put(svg, x, bottom + 16.0, "faint", "middle", &format!("{at:.decimals$}"));
    }
    let (from, to) = (scale.x(0.0), scale.x(scale.seconds));
    let _ = writeln!(svg, "<path class=\"axis\" d=\"M{from:.1} {bottom:.1}H{to:.1}\"/>");
    put(svg, f64::midpoint(from, to), bottom + 34.0, "ink", "middle", "time in seconds");
}

fn row(svg: &mut String, machine: &MachineOutcome, scale: &Scale, top: f64) {
    let control_top = top + UNIT + GAP;
    let name = short(&machine.name);
    put(svg, LEFT - 12.0, top + UNIT / 2.0 + 5.0, "ink", "end", &name);
    for (y, height) in [(top, UNIT), (control_top, CONTROL)] {
        let (x, width) = (scale.x(0.0), scale.x(scale.seconds) - scale.x(0.0));
        let _ = writeln!(
            svg,
            "<rect class=\"frame\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        );
    }
    let (unit, control) = (machine.unit_size_bits, machine.control_size_bits);
    area(svg, "unit", &machine.levels, scale, top + UNIT, |sample| UNIT * part(sample.unit, unit));
    area(svg, "control", &machine.levels, scale, control_top + CONTROL, |sample| {
        CONTROL * part(sample.control, control)
    });
    for dry in &machine.dry {
        let (from, to) = (scale.x(dry.from), scale.x(dry.from + dry.seconds));
        let _ = writeln!(
            svg,
            "<rect class=\"dry\" x=\"{from:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            (to - from).max(1.0),
            UNIT + GAP + CONTROL
        );
    }
    let right = WIDTH - RIGHT + 10.0;
    put(svg, right, top + 11.0, "faint", "start", &format!("{} bit", whole(unit)));
    put(svg, right, top + UNIT, "faint", "start", "0");
    put(svg, right, control_top + CONTROL, "faint", "start", &format!("{} bit", whole(control)));
}

fn area(
    svg: &mut String,
    class: &str,
    levels: &[Sample],
    scale: &Scale,
    bottom: f64,
    height: impl Fn(&Sample) -> f64,
) {
    let (Some(first), Some(last)) = (levels.first(), levels.last()) else { return };
    let _ = write!(svg, "<path class=\"{class}\" d=\"M{:.1} {bottom:.1}", scale.x(first.at));
    for sample in levels {
        let _ = write!(svg, "L{:.1} {:.1}", scale.x(sample.at), bottom - height(sample));
    }
    let _ = writeln!(svg, "L{:.1} {bottom:.1}z\"/>", scale.x(last.at));
}

fn part(level: f64, size: f64) -> f64 {
    if size > 0.0 { (level / size).clamp(0.0, 1.0) } else { 0.0 }
}

fn put(svg: &mut String, x: f64, y: f64, class: &str, anchor: &str, text: &str) {
    let text = escaped(text);
    let _ = writeln!(
        svg,
        "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{text}</text>"
    );
}

fn short(name: &str) -> String {
    let width = |text: &str| text.chars().map(width_of).sum::<f64>();
    if name.chars().count() <= MOST_NAME && width(name) <= MOST_NAME_WIDTH {
        return name.to_owned();
    }
    let mut left = MOST_NAME_WIDTH - width_of('…');
    let fits = |c: &char| {
        left -= width_of(*c);
        left >= 0.0
    };
    name.chars().take(MOST_NAME - 1).take_while(fits).chain(['…']).collect()
}

/// How wide a character is at most, in parts of its size: as in DejaVu Sans, a wide font.
fn width_of(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | 'I' | '\'' | '|' | '.' | ',' => 0.34,
        ' ' | '/' | '\\' | '-' | 'f' | 't' => 0.4,
        'r' | '(' | ')' | '[' | ']' | '!' | ':' | ';' => 0.42,
        '"' => 0.46,
        'c' | 's' | 'z' => 0.56,
        'm' | 'w' | 'W' | 'M' | '@' | '%' | '\u{80}'..='\u{10ff}' => 1.0,
        '<' | '>' | '=' | '+' | '~' | '^' | '#' => 0.84,
        '&' | 'A'..='Z' => 0.8,
        ' '..='~' => 0.65,
        _ => 1.1,
    }
}

fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            c if c.is_control() || is_nothing(c) => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// A whole number with commas.
fn whole(number: f64) -> String {
    let digits = format!("{number:.0}");
    let mut text = String::new();
    for (at, digit) in digits.char_indices() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
