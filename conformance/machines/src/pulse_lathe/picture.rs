//! The tool's way and the turned part, as SVG: z to the right, x upwards, in mm.

use super::LatheOptions;
use std::fmt::Write as _;

/// Space around the drawing, in mm.
const MARGIN: f64 = 5.0;
/// Pixels of a mm.
const SCALE: f64 = 8.0;

/// Places of the way that are drawn at most, and how near to each other they are not, in mm.
const DRAWN: usize = 20_000;
const NEAR: f64 = 0.03;

/// A radius in mm.
fn x_mm(pulses: i64) -> f64 {
    pulses as f64 / 200.0
}

fn z_mm(pulses: i64) -> f64 {
    pulses as f64 / 100.0
}

pub(super) fn draw(options: &LatheOptions, contour: &[i64], places: &[(i64, i64)]) -> String {
    let way: Vec<(f64, f64)> = places
        .iter()
        .map(|(x, z)| (z_mm(options.start_z + z), x_mm(options.start_x + x)))
        .collect();
    let radius = x_mm(options.blank_radius);
    let length = z_mm(i64::from(options.blank_length));
    let fold = |first: f64, pick: fn(f64, f64) -> f64, of: fn(&(f64, f64)) -> f64| {
        way.iter().map(of).fold(first, pick)
    };
    let left = fold(-length, f64::min, |place| place.0) - MARGIN;
    let right = fold(0.0, f64::max, |place| place.0) + MARGIN;
    let top = fold(radius, f64::max, |place| place.1) + MARGIN;
    let bottom = fold(-radius, f64::min, |place| place.1) - MARGIN;
    let (width, height) = (right - left, top - bottom);

    let mut svg = String::new();
    // Writing to a string does not fail.
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" \
         viewBox=\"{left:.3} {:.3} {width:.3} {height:.3}\">\n<title>The turned part and the way of \
         the tool, in mm</title>\n<rect x=\"{left:.3}\" y=\"{:.3}\" width=\"{width:.3}\" \
         height=\"{height:.3}\" fill=\"white\"/>\n",
        width * SCALE,
        height * SCALE,
        -top,
        -top
    );
    let _ = writeln!(
        svg,
        "<rect id=\"blank\" x=\"{:.3}\" y=\"{:.3}\" width=\"{length:.3}\" height=\"{:.3}\" \
         fill=\"#eee\" stroke=\"#999\" stroke-width=\"0.1\" stroke-dasharray=\"1 1\"/>",
        -length,
        -radius,
        2.0 * radius
    );
    let _ = writeln!(
        svg,
        "<path id=\"part\" d=\"{}\" fill=\"#b8c4d0\" stroke=\"#345\" stroke-width=\"0.15\"/>",
        part(contour)
    );
    let _ = writeln!(
        svg,
        "<path id=\"axis\" d=\"M{left:.3} 0H{right:.3}\" stroke=\"#345\" stroke-width=\"0.1\" \
         stroke-dasharray=\"3 1 0.5 1\"/>"
    );
    let points: Vec<String> =
        thinned(&way).iter().map(|(z, x)| format!("{z:.2},{:.3}", -x)).collect();
    let _ = writeln!(
        svg,
        "<polyline id=\"way\" points=\"{}\" fill=\"none\" stroke=\"#c00\" stroke-width=\"0.1\"/>",
        points.join(" ")
    );
    svg.push_str("</svg>\n");
    svg
}

/// The way without places that are next to the one before: an arc is made of tiny steps. Of a very
/// long one what is next to each other grows.
fn thinned(way: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut near = NEAR;
    loop {
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for place in way {
            let is_near = |last: &(f64, f64)| (place.0 - last.0).hypot(place.1 - last.1) < near;
            if !kept.last().is_some_and(is_near) {
                kept.push(*place);
            }
        }
        kept.extend(way.last());
        if kept.len() <= DRAWN {
            return kept;
        }
        near *= 2.0;
    }
}

/// The outline of what is left, both halves: corners where the radius changes.
fn part(contour: &[i64]) -> String {
    let mut upper = Vec::new();
    let mut before = None;
    for (depth, radius) in contour.iter().enumerate() {
        if before != Some(*radius) {
            if let Some(before) = before {
                upper.push((-z_mm(depth as i64), x_mm(before)));
            }
            upper.push((-z_mm(depth as i64), x_mm(*radius)));
            before = Some(*radius);
        }
    }
    upper.push((-z_mm(contour.len() as i64), before.map_or(0.0, x_mm)));
    let mut path = String::new();
    let lower = upper.iter().rev().map(|(z, x)| (*z, -x));
    for (nth, (z, x)) in upper.iter().copied().chain(lower).enumerate() {
        let _ = write!(path, "{}{z:.2} {:.3}", if nth == 0 { 'M' } else { 'L' }, -x);
    }
    path.push('Z');
    path
}
