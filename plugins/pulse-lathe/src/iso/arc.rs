//! Arcs of ISO code: where the centre is, and how many quadrants they go through.

use super::number::root;
use super::words::{Refused, Words};
use super::{PULSE, Place};
use crate::arc::{Arc, STEP};
use crate::status;

/// A point seen from the centre, in 0.05 µm.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
struct Point {
    z: i64,
    x: i64,
}

impl Point {
    /// The square of its distance.
    fn square(self) -> i64 {
        self.z * self.z + self.x * self.x
    }

    /// The quadrant that a way around the centre goes into at this point.
    fn quadrant_ahead(self, clockwise: bool) -> u8 {
        let (z, x) = (self.z, self.x);
        if clockwise {
            match () {
                () if z >= 0 && x > 0 => 0,
                () if z < 0 && x >= 0 => 1,
                () if z <= 0 && x < 0 => 2,
                () => 3,
            }
        } else {
            match () {
                () if z > 0 && x >= 0 => 0,
                () if z <= 0 && x > 0 => 1,
                () if z < 0 && x <= 0 => 2,
                () => 3,
            }
        }
    }
}

/// The arc of a line, from one place to another.
pub(crate) fn read(
    words: &mut Words,
    clockwise: bool,
    from: Place,
    to: Place,
) -> Result<Arc, Refused> {
    let (i, k, radius) = (words.take(b'I'), words.take(b'K'), words.take(b'R'));
    let column = |word: Option<(i64, u32)>| word.map_or(1, |(_, column)| column);
    let chord = Point { z: 2 * (to.z - from.z), x: to.x - from.x };
    let (centre, at) = match radius {
        Some((_, column)) if i.or(k).is_some() => return Err((status::CONFLICT, column)),
        Some((radius, column)) => (by_radius(chord, clockwise, 2 * radius), column),
        None => (Some(by_centre(i, k)), column(i.or(k))),
    };
    let refused = Err((status::NO_ARC, at));
    let Some(centre) = centre else { return refused };
    let begin = Point { z: -centre.z, x: -centre.x };
    let end = Point { z: chord.z - centre.z, x: chord.x - centre.x };
    if begin.square() < 4 * STEP * STEP || !is_on_circle(begin, end) {
        return refused;
    }
    Ok(between(clockwise, from, to, begin, end))
}

/// From the beginning to the centre.
fn by_centre(i: Option<(i64, u32)>, k: Option<(i64, u32)>) -> Point {
    let value = |word: Option<(i64, u32)>| 2 * word.map_or(0, |(value, _)| value);
    Point { z: value(k), x: value(i) }
}

/// The centre is beside the middle of the chord, by `chord · √(4r² − chord²) / (2 · chord)`. Both
/// roots are of the same multiple, as large as there is room for.
fn by_radius(chord: Point, clockwise: bool, radius: i64) -> Option<Point> {
    let square = chord.square().cast_unsigned();
    let across = (2 * radius).unsigned_abs();
    let most = across + STEP.cast_unsigned();
    if square == 0 || square > most * most {
        return None;
    }
    // Half a circle whose ends were rounded apart is one about the middle between them.
    let beyond = (across * across).saturating_sub(square);
    let shift = (beyond | square).leading_zeros() / 2 * 2;
    let (beyond, length) = (root(beyond << shift), root(square << shift));
    let aside = |chord: i64| {
        let size = chord.unsigned_abs() * beyond / (2 * length);
        size.cast_signed() * chord.signum()
    };
    let (z, x) = (aside(chord.z), aside(chord.x));
    // Left of the way, counter-clockwise and the shorter way.
    let side = if clockwise == (radius < 0) { 1 } else { -1 };
    Some(Point { z: chord.z / 2 - side * x, x: chord.x / 2 + side * z })
}

/// Whether the end is at most a step nearer or farther than the beginning.
fn is_on_circle(begin: Point, end: Point) -> bool {
    let distance = |point: Point| root(point.square().cast_unsigned());
    distance(begin).abs_diff(distance(end)) <= STEP.cast_unsigned()
}

fn between(clockwise: bool, from: Place, to: Place, begin: Point, end: Point) -> Arc {
    let quadrant = begin.quadrant_ahead(clockwise);
    // At its end it comes out of the quadrant that the other way would go into.
    let last = end.quadrant_ahead(!clockwise);
    let mut changes =
        if clockwise { quadrant.wrapping_sub(last) } else { last.wrapping_sub(quadrant) } & 3;
    let ahead = begin.z * end.x - begin.x * end.z;
    if changes == 0 && (if clockwise { -ahead } else { ahead }) <= 0 {
        changes = 4;
    }
    // The pulses are where the places were rounded to.
    let (from_pulses, to_pulses) = (from.pulses(), to.pulses());
    let z = begin.z + 2 * (i64::from(from_pulses.1) * PULSE - from.z);
    let x = begin.x + i64::from(from_pulses.0) * PULSE - from.x;
    let z_end = z + i64::from(to_pulses.1 - from_pulses.1) * STEP;
    let x_end = x + i64::from((to_pulses.0 - from_pulses.0) / 2) * STEP;
    Arc::to(clockwise, quadrant, (z, x), begin.square(), changes, (z_end, x_end))
}
