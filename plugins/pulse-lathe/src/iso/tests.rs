//! ISO code, held against what it commands in whole numbers.

use super::Iso;
use crate::block::{Block, Motion, Next};
use crate::codes;
use crate::cut::Cut;
use crate::settings::Settings;
use softplug_plugin::SettingSet;

struct Chance(u64);

impl Chance {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % bound
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 40) as f64 / (1_u64 << 40) as f64
    }
}

fn settings(diameter: bool) -> Settings {
    Settings { diameter, start_block: 1, spindle_increments: 1_024, ..Settings::UNSET }
}

fn blocks(text: &str, settings: &Settings) -> Result<Vec<Block>, (u16, u32, u32)> {
    let mut iso = Iso::new();
    iso.clear(0, 0);
    let mut rest = text.as_bytes();
    let mut blocks = Vec::new();
    loop {
        match iso.next(settings).map_err(|bad| (bad.status, bad.line, bad.column))? {
            Next::Block(block) => blocks.push(block),
            Next::Nothing => {}
            Next::Text if rest.is_empty() => iso.text_ended(),
            Next::Text => {
                let (some, after) = rest.split_at(rest.len().min(iso.room()).min(7));
                iso.take_text(some);
                rest = after;
            }
            Next::End => return Ok(blocks),
        }
    }
}

/// Follows the cuts of blocks; `at` has the block's number and the place in pulses of x and z.
fn follow(blocks: &[Block], mut at: impl FnMut(usize, i64, i64)) -> Vec<(i64, i64)> {
    let (mut x, mut z) = (0, 0);
    let mut ends = Vec::new();
    for (number, block) in blocks.iter().enumerate() {
        if let Motion::Cut(path) = block.motion {
            let mut cut = Cut::new(path, crate::cut::FASTEST);
            while let Some(byte) = cut.period() {
                let (by_x, by_z) = codes::pulses(byte);
                (x, z) = (x + by_x, z + by_z);
                at(number, x, z);
            }
        }
        ends.push((x, z));
    }
    ends
}

/// Millimetres with four decimals, of 0.1 µm.
fn mm(value: i64) -> String {
    let sign = if value < 0 { "-" } else { "" };
    format!("{sign}{}.{:04}", value.abs() / 10_000, value.abs() % 10_000)
}

/// The pulse that is nearest to a place in so many parts of it, half away from 0.
fn nearest(value: i64, parts: i64) -> i64 {
    let (whole, rest) = (value.abs().div_euclid(parts), value.abs().rem_euclid(parts));
    (whole + i64::from(2 * rest >= parts)) * value.signum()
}

/// 0.01 mm in 0.05 µm.
const STEP: f64 = 200.0;
/// What numbers of 53 bits leave of distances below 1 m, and more.
const ROUNDED: f64 = 1e-6;
/// The centre of an arc by its radius is rounded to 0.05 µm on each axis, once or twice, and both
/// circles go through the beginning: 2 · √(1² + 1.5²).
const CENTRE: f64 = 3.6;

/// An arc from a place on a circle to another one, at any angle.
struct Drawn {
    clockwise: bool,
    /// In 0.1 µm, x as a diameter.
    from: (i64, i64),
    to: (i64, i64),
    /// From `from` to the centre, in 0.1 µm of radius.
    i: i64,
    k: i64,
    /// In degrees.
    angle: f64,
    radius: i64,
}

fn draw(chance: &mut Chance) -> Drawn {
    let decade = chance.unit() * 3.699;
    let radius = (1_000.0 * 10_f64.powf(decade)).round() as i64;
    let begin = match chance.below(4) {
        // On an axis.
        0 => chance.below(4) as f64 * 90.0,
        _ => chance.unit() * 360.0,
    };
    let clockwise = chance.below(2) == 1;
    let angle = 3.0 + chance.unit() * 350.0;
    let end = (if clockwise { begin - angle } else { begin + angle }).to_radians();
    let begin = begin.to_radians();
    let r = radius as f64;
    let on_circle =
        |angle: f64| ((r * angle.cos()).round() as i64, (r * angle.sin()).round() as i64);
    let (begin_z, begin_x) = on_circle(begin);
    let (end_z, end_x) = on_circle(end);
    let (from_x, from_z) =
        (chance.below(200_000) as i64 * 2, chance.below(200_000) as i64 - 100_000);
    let to = (from_x + 2 * (end_x - begin_x), from_z + end_z - begin_z);
    Drawn { clockwise, from: (from_x, from_z), to, i: -begin_x, k: -begin_z, angle, radius }
}

/// A circle in 0.05 µm: z and x of its centre, and its radius.
struct Circle {
    centre: (f64, f64),
    radius: f64,
}

impl Circle {
    /// Around the commanded centre through the commanded beginning.
    fn by_centre(drawn: &Drawn) -> Self {
        let (i, k) = (2.0 * drawn.i as f64, 2.0 * drawn.k as f64);
        let (x, z) = (drawn.from.0 as f64, 2.0 * drawn.from.1 as f64);
        Self { centre: (z + k, x + i), radius: i.hypot(k) }
    }

    /// Of the commanded radius through both ends; none where they are farther apart.
    fn by_radius(drawn: &Drawn) -> Option<Self> {
        let (from, to) = (drawn.from, drawn.to);
        let way = (2 * i128::from(to.1 - from.1), i128::from(to.0 - from.0));
        let length = way.0 * way.0 + way.1 * way.1;
        let beyond = 16 * i128::from(drawn.radius).pow(2) - length;
        let aside = (u128::try_from(beyond).ok()? as f64 / length as f64).sqrt() / 2.0;
        let side = if drawn.clockwise == (drawn.angle > 180.0) { aside } else { -aside };
        let (z, x) = (way.0 as f64, way.1 as f64);
        let middle = (2.0 * from.1 as f64 + z / 2.0, from.0 as f64 + x / 2.0);
        let centre = (middle.0 - side * x, middle.1 + side * z);
        Some(Self { centre, radius: 2.0 * drawn.radius as f64 })
    }
}

/// Follows one arc, each of its pulses. Returns how far from the circle they are at most, in
/// 0.05 µm.
fn farthest(drawn: &Drawn, text: &str, circle: &Circle) -> f64 {
    let blocks = blocks(text, &settings(true)).unwrap_or_else(|bad| panic!("{text}: {bad:?}"));
    let mut pulses = (0_i64, 0_i64);
    let mut last = (nearest(drawn.from.0, 100), nearest(drawn.from.1, 100));
    let mut most = 0.0_f64;
    let ends = follow(&blocks, |number, x, z| {
        if number == 1 {
            pulses.0 += (x - last.0).abs();
            pulses.1 += (z - last.1).abs();
            last = (x, z);
            let (dz, dx) = (z as f64 * 200.0 - circle.centre.0, x as f64 * 100.0 - circle.centre.1);
            most = most.max((dz.hypot(dx) - circle.radius).abs());
        }
    });
    let expected = (nearest(drawn.to.0, 100), nearest(drawn.to.1, 100));
    assert_eq!(ends[1], expected, "{text}");
    // The way is that of the angle and not of what is left of the circle: its pulses are those of
    // the parts between turning points, in steps of 0.01 mm. One turn has eight radii.
    let steps = (pulses.0 / 2 + pulses.1) as f64;
    let expected = way(drawn);
    assert!((steps - expected).abs() <= 12.0, "{text}: {steps} steps, not {expected}");
    most
}

/// The steps of both axes, from the angles.
fn way(drawn: &Drawn) -> f64 {
    let begin = (-drawn.i as f64).atan2(-drawn.k as f64).to_degrees().rem_euclid(360.0);
    let r = drawn.radius as f64 / 100.0;
    // From the beginning to each axis that is passed.
    let first = if drawn.clockwise { begin % 90.0 } else { 90.0 - begin % 90.0 };
    let mut corners: Vec<f64> = (0..5)
        .map(|corner| first + f64::from(corner) * 90.0)
        .filter(|turned| *turned > 0.0 && *turned < drawn.angle)
        .collect();
    corners.insert(0, 0.0);
    corners.push(drawn.angle);
    let place = |turned: f64| {
        let angle = if drawn.clockwise { begin - turned } else { begin + turned };
        (r * angle.to_radians().cos(), r * angle.to_radians().sin())
    };
    corners
        .windows(2)
        .map(|pair| {
            let ((z, x), (to_z, to_x)) = (place(pair[0]), place(pair[1]));
            (to_z - z).abs() + (to_x - x).abs()
        })
        .sum()
}

#[test]
fn ten_thousand_arcs_end_on_their_pulse_and_are_never_a_step_from_their_circle() {
    let mut chance = Chance(7);
    for _ in 0..10_000 {
        let drawn = draw(&mut chance);
        let code = if drawn.clockwise { 2 } else { 3 };
        let text = format!(
            "G00 X{} Z{}\nG0{code} X{} Z{} I{} K{} F100\n",
            mm(drawn.from.0),
            mm(drawn.from.1),
            mm(drawn.to.0),
            mm(drawn.to.1),
            mm(drawn.i),
            mm(drawn.k)
        );
        let most = farthest(&drawn, &text, &Circle::by_centre(&drawn));
        assert!(most <= STEP + ROUNDED, "{text}: {most}");
    }
}

/// Half circles, too: there a hair of the radius moves the centre far.
#[test]
fn an_arc_by_its_radius_is_never_a_step_from_the_circle_of_that_radius() {
    let mut chance = Chance(8);
    let mut tried = 0;
    while tried < 2_000 {
        let drawn = draw(&mut chance);
        let Some(circle) = Circle::by_radius(&drawn) else { continue };
        tried += 1;
        let code = if drawn.clockwise { 2 } else { 3 };
        let radius = if drawn.angle > 180.0 { -drawn.radius } else { drawn.radius };
        let text = format!(
            "G00 X{} Z{}\nG0{code} X{} Z{} R{} F100\n",
            mm(drawn.from.0),
            mm(drawn.from.1),
            mm(drawn.to.0),
            mm(drawn.to.1),
            mm(radius)
        );
        let most = farthest(&drawn, &text, &circle);
        assert!(most <= STEP + CENTRE + ROUNDED, "{text}: {most}");
    }
}

/// As a program with four decimals has them.
#[test]
fn half_a_circle_whose_ends_were_rounded_apart_is_one() {
    for text in ["G02 Z1.0001 R0.5 F9\n", "G03 X1 Z0.0002 R0.5 F9\n", "G02 Z-1.01 R0.5 F9\n"] {
        let blocks = blocks(text, &settings(false)).expect("it is good");
        let mut farthest = 0;
        let ends = follow(&blocks, |_, x, z| farthest = farthest.max(x.abs() + z.abs()));
        assert!(farthest > 120, "{text}");
        assert!(ends[0].0.abs() + ends[0].1.abs() >= 100, "{text}");
    }
}

#[test]
fn lines_end_on_the_commanded_pulse_and_increments_do_not_add_up_their_rounding() {
    let mut chance = Chance(9);
    for diameter in [true, false] {
        let scale = if diameter { 1 } else { 2 };
        let mut text = String::from("G91 F300\n");
        let (mut x, mut z) = (0, 0);
        let mut expected = Vec::new();
        for _ in 0..1_000 {
            let (u, w) =
                (chance.below(30_000) as i64 - 14_000, chance.below(30_000) as i64 - 15_500);
            (x, z) = (x + u * scale, z + w);
            text.push_str(&["G01 X", &mm(u), " Z", &mm(w), "\n"].concat());
            expected.push((nearest(x, 100), nearest(z, 100)));
        }
        let blocks = blocks(&text, &settings(diameter)).expect("it is good");
        let ends = follow(&blocks, |_, _, _| {});
        assert_eq!(ends[1..], expected);
    }
}

#[test]
fn a_whole_circle_comes_back() {
    for (i, k) in [("-5", "0"), ("0", "7.5"), ("3", "-4"), ("0.0250", "0.02")] {
        for code in ["G02", "G03"] {
            let text = format!("{code} I{i} K{k} F10\n");
            let blocks = blocks(&text, &settings(true)).expect("it is good");
            let (mut most, mut count) = (0, 0);
            let ends = follow(&blocks, |_, x, z| {
                most = most.max(x.abs() / 2 + z.abs());
                count += 1;
            });
            assert_eq!(ends, [(0, 0)], "{text}");
            assert!(most >= 4 && count > 15, "{text}");
        }
    }
}

/// n · F / (L · 240,000) steps a period, rounded half up in parts of 2²⁰.
#[test]
fn feeds_are_those_of_the_path() {
    for (text, steps, length) in [
        ("G01 Z-10 F120\n", 1_000_u128, 100_000_u128),
        ("G01 X20 F120\n", 2_000, 100_000),
        // 3, 4, 5: 6 mm of diameter.
        ("G01 X6 Z4 F120\n", 600, 50_000),
        ("G01 Z0.01 F0.001\n", 1, 100),
        ("G01 Z1 F9999\n", 100, 10_000),
    ] {
        let block = blocks(text, &settings(true)).expect("it is good")[0];
        let feed: u128 = match text {
            _ if text.contains("F120") => 1_200_000,
            _ if text.contains("F9999") => 99_990_000,
            _ => 10,
        };
        let exact = ((steps * feed) << 21) / (length * 240_000);
        let rounded = exact.div_ceil(2).clamp(1, 1 << 20) as u32;
        assert_eq!(block.feed, rounded, "{text}");
    }
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    for (text, expected) in [
        ("G01 X1\n", (15, 1, 1)),
        ("G33 Z-1\n", (15, 1, 1)),
        ("F10\nG05 X1\n", (13, 2, 1)),
        ("G00 Q1\n", (13, 1, 5)),
        ("G00 X\n", (12, 1, 5)),
        ("G00 X1 #\n", (12, 1, 8)),
        ("G00 X1 (to the\n", (12, 1, 8)),
        ("G00 X1 U2\n", (17, 1, 8)),
        ("G00 X1 X2\n", (17, 1, 8)),
        ("G00 G01 X1\n", (17, 1, 5)),
        ("G00 X10000\n", (14, 1, 5)),
        ("G00 X0.00001\n", (14, 1, 5)),
        ("G00 Z1 I2\n", (17, 1, 8)),
        ("G01 F0 Z1\n", (14, 1, 5)),
        ("S64\n", (14, 1, 1)),
        ("T8\n", (14, 1, 1)),
        ("M16\n", (14, 1, 1)),
        ("G90 X1 G91\n", (17, 1, 8)),
        ("G91 G91 X1\n", (17, 1, 5)),
        // Half a circle whose ends are a hair too far apart is one; 0.0102 mm are none.
        ("F9\nG02 Z1.0102 R0.5\n", (16, 2, 13)),
        ("M1.5\n", (14, 1, 1)),
        ("F1\nG02 Z1\n", (16, 2, 1)),
        ("F1\nG02 Z1 R0.4\n", (16, 2, 8)),
        ("F1\nG02 Z1 K1\n", (16, 2, 8)),
        ("F1\nG02 Z1 K0.5 R1\n", (17, 2, 13)),
        ("G28 X1\n", (14, 1, 5)),
        ("G04\n", (13, 1, 1)),
        ("G33 X1 Z1 F1\n", (17, 1, 1)),
        (&format!("G00 Z1{}\n", " ".repeat(195)), (18, 1, 201)),
    ] {
        assert_eq!(blocks(text, &settings(true)), Err(expected), "{text}");
    }
}

#[test]
fn lines_are_read_in_every_form() {
    for text in [
        "g1z-1.5f60\n",
        "N10 G01 Z-1.5000 F60.\r\n",
        "%\nO1234\n( a comment ) G01 (another) Z-1.5 F60 ; the rest\n",
        "G1 Z-001.5 F+60",
        "G91 G1 W-1.5 F60",
    ] {
        let blocks = blocks(text, &settings(true)).unwrap_or_else(|bad| panic!("{text}: {bad:?}"));
        assert_eq!(blocks.len(), 1, "{text}");
        assert_eq!(follow(&blocks, |_, _, _| {}), [(0, -150)], "{text}");
    }
}
