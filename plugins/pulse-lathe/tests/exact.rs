//! Where the pulses are, held against whole numbers and other formulas than the plug-in's.

use pulse_lathe::{Arc, Cut, FASTEST, Line, Thread, codes, feed_of_word};

/// Numbers by chance that are the same each time.
struct Chance(u64);

impl Chance {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % bound
    }

    /// Small ones as often as large ones.
    fn sized(&mut self, most: u64) -> u64 {
        let bits = 64 - most.leading_zeros();
        let shift = self.below(u64::from(bits));
        self.below((most >> shift).max(1)) + 1
    }
}

/// Follows a line and calls `at` with its place behind each pulse of the main axis.
fn follow(mut line: Line, mut at: impl FnMut(i64, i64)) -> (i64, i64) {
    let (mut x, mut z) = (0, 0);
    while let Some(bits) = line.step() {
        let (by_x, by_z) = codes::pulses(bits);
        (x, z) = (x + by_x, z + by_z);
        at(x, z);
    }
    (x, z)
}

/// The distance of a place from the line through 0 and the end is at most half a pulse of the
/// minor axis, measured along it: |minor · main_end − main · minor_end| ≤ main_end / 2.
fn assert_line(x: i64, z: i64) {
    let main = x.abs().max(z.abs());
    let ended = follow(Line::between(x as i32, z as i32), |at_x, at_z| {
        let aside = i128::from(at_x) * i128::from(z) - i128::from(at_z) * i128::from(x);
        assert!(2 * aside.abs() <= i128::from(main), "({x}, {z}) at ({at_x}, {at_z})");
    });
    assert_eq!(ended, (x, z));
}

#[test]
fn every_small_line_ends_on_its_pulse_and_is_straight() {
    for x in -40..=40 {
        for z in -40..=40 {
            assert_line(x, z);
        }
    }
}

#[test]
fn lines_of_any_length_end_on_their_pulse_and_are_straight() {
    let mut chance = Chance(1);
    for _ in 0..300 {
        let (x, z) = (chance.sized(200_000) as i64, chance.sized(200_000) as i64);
        let sign = |value: i64, bit: u64| if bit == 0 { value } else { -value };
        let (x, z) = (sign(x, chance.below(2)), sign(z, chance.below(2)));
        assert_line(x, z);
    }
    assert_line(4_000_000, 1_999_999);
    assert_line(-1, 8_388_607);
}

#[test]
fn a_taper_rounds_its_minor_pulses_to_the_nearest() {
    let mut chance = Chance(2);
    for _ in 0..400 {
        let main = chance.sized(30_000) as u32;
        let alpha = chance.below(4_096) as u16;
        let slope = if alpha == 0 { 4_096 } else { i64::from(alpha) };
        let line = Line::taper(true, true, false, main, alpha);
        let total = line.rest();
        let ended = follow(line, |x, z| {
            // |−x − z · α / 4096| ≤ 1/2, and where it is a half it is rounded up.
            let aside = -x * 4_096 - z * slope;
            assert!((-2_048 < aside) && (aside <= 2_048), "α {alpha:04o} at ({x}, {z})");
        });
        assert_eq!(ended.1, i64::from(main));
        assert_eq!(ended, total, "what is left is told before");
    }
}

/// With α as the nearest of 4,096 parts, a taper of fewer main pulses than that ends on the minor
/// pulse that was meant.
#[test]
fn a_taper_of_less_than_4096_pulses_ends_where_it_is_meant_to() {
    let mut chance = Chance(3);
    for _ in 0..2_000 {
        let main = chance.below(4_095) + 1;
        let minor = chance.below(main) + 1;
        let alpha = (2 * 4_096 * minor + main) / (2 * main) % 4_096;
        if alpha == 0 && minor < main {
            continue;
        }
        let line = Line::taper(false, false, true, main as u32, alpha as u16);
        assert_eq!(follow(line, |_, _| {}), (main as i64, -(minor as i64)), "{minor} / {main}");
    }
}

/// |√d² − √r²| ≤ 1 without a root.
fn is_within_a_step(d2: i64, r2: i64) -> bool {
    let (d2, r2) = (i128::from(d2), i128::from(r2));
    let sum = d2 + r2 - 1;
    sum <= 0 || sum * sum <= 4 * d2 * r2
}

/// Signs of z and x in a quadrant, and the directions that a way around goes in it.
const SIGNS: [(i64, i64); 4] = [(1, 1), (-1, 1), (-1, -1), (1, -1)];

#[test]
fn ten_thousand_arcs_are_never_more_than_a_step_from_their_circle() {
    let mut chance = Chance(4);
    let mut quadrants_seen = [0_u32; 8];
    for number in 0..10_000_u64 {
        let quadrant = (number % 4) as u8;
        let clockwise = number / 4 % 2 == 1;
        // 0.1 mm to 500 mm.
        let radius = 9 + chance.sized(49_991);
        let nz = chance.below(radius + 1);
        let nx = ((radius * radius - nz * nz) as f64).sqrt().round() as u64;
        let r2 = (nz * nz + nx * nx) as i64;
        let steps = chance.below(9 * radius) + 1;
        let (sign_z, sign_x) = SIGNS[usize::from(quadrant)];
        let (mut z, mut x) = (sign_z * nz as i64, sign_x * nx as i64);
        let mut arc = Arc::steps(clockwise, quadrant, nz as u32, nx as u32, steps as u32);
        let mut done = 0;
        while let Some(bits) = arc.step() {
            let (by_x, by_z) = codes::pulses(bits);
            assert_eq!(by_x.abs() + by_z.abs(), 1, "one axis a step");
            let turn = z * by_x - x * by_z;
            assert!(if clockwise { turn <= 0 } else { turn >= 0 }, "it turns back");
            (z, x) = (z + by_z, x + by_x);
            done += 1;
            assert!(is_within_a_step(z * z + x * x, r2), "arc {number} at ({z}, {x}), {r2}");
        }
        assert_eq!(done, steps);
        quadrants_seen[(steps / (2 * radius)).min(7) as usize] += 1;
    }
    assert!(quadrants_seen[..4].iter().all(|seen| *seen > 500), "{quadrants_seen:?}");
}

/// From axis to axis a quarter has radius steps of both axes, so the commanded end is exact.
#[test]
fn quarters_and_whole_circles_end_on_the_axes() {
    for radius in (2_u32..200).chain([999, 4_000, 25_000, 50_000]) {
        for quarters in 1..=9 {
            for clockwise in [false, true] {
                let quadrant = if clockwise { 3 } else { 0 };
                let mut arc = Arc::steps(clockwise, quadrant, radius, 0, 2 * radius * quarters);
                let (mut z, mut x) = (i64::from(radius), 0);
                while let Some(bits) = arc.step() {
                    let (by_x, by_z) = codes::pulses(bits);
                    (z, x) = (z + by_z, x + by_x);
                }
                let r = i64::from(radius);
                let around = [(r, 0), (0, r), (-r, 0), (0, -r)];
                let place = if clockwise { (4 - quarters % 4) % 4 } else { quarters % 4 };
                assert_eq!((z, x), around[place as usize], "r {radius}, {quarters} quarters");
            }
        }
    }
}

/// The paper's f, kept from step to step, against the one that is computed anew.
#[test]
fn the_deviation_decides_as_the_square_of_the_distance_does() {
    for radius in 2..120_u32 {
        let r2 = i64::from(radius * radius);
        let mut arc = Arc::steps(false, 0, radius, 0, 2 * radius);
        let (mut z, mut x) = (i64::from(radius), 0_i64);
        while let Some(bits) = arc.step() {
            let is_outside = z * z + x * x >= r2;
            assert_eq!(bits & codes::Z != 0, is_outside, "r {radius} at ({z}, {x})");
            let (by_x, by_z) = codes::pulses(bits);
            (z, x) = (z + by_z, x + by_x);
        }
    }
}

/// A step of the main axis leaves in the period in which its number times 4,096 is reached.
#[test]
fn the_feed_is_exact_in_every_period() {
    for word in [0o0000_u16, 0o0001, 0o0777, 0o1000, 0o3777, 0o5252, 0o7776, 0o7777] {
        let mut cut = Cut::line(Line::between(0, 30), feed_of_word(word));
        let mut period = 0_u64;
        let mut steps = 0_u64;
        while let Some(byte) = cut.period() {
            period += 1;
            let had = steps;
            steps += u64::from(byte & codes::Z != 0);
            assert_eq!(steps, period * (u64::from(word) + 1) / 4_096, "F {word:04o}");
            assert_eq!(byte & codes::FOLLOWS != 0, steps < 30);
            assert!(steps - had <= 1);
        }
        assert_eq!(steps, 30);
        assert_eq!(period, (30 * 4_096_u64).div_ceil(u64::from(word) + 1));
    }
}

/// Each step of x on an arc is two pulses in two periods, in the same direction.
#[test]
fn a_step_of_x_on_an_arc_is_two_pulses() {
    let mut steps = Arc::steps(true, 1, 40, 30, 200);
    let mut cut = Cut::arc(steps, FASTEST);
    let mut bytes = std::iter::from_fn(|| cut.period().map(|byte| byte & !codes::FOLLOWS));
    while let Some(step) = steps.step() {
        assert_eq!(bytes.next(), Some(step));
        if step & codes::X != 0 {
            assert_eq!(bytes.next(), Some(step));
        }
    }
    assert_eq!(bytes.next(), None);
}

#[test]
fn the_pitch_is_exact_over_ten_thousand_turns_at_any_speed() {
    let mut chance = Chance(5);
    for (pitch, increments) in [(15_000, 1_024), (23_091, 1_000), (1, 65_535), (409_600, 4_093)] {
        let mut thread = Thread::new(false, u32::MAX, pitch, increments);
        let (mut turned, mut pulses, mut speed) = (0_i128, 0_i128, 1_i64);
        while turned < 10_000 * i128::from(increments) {
            // It speeds up and slows down, and stands still now and then.
            speed = (speed + chance.below(9) as i64 - 4).clamp(0, 63);
            turned += i128::from(speed);
            let now = thread.turned(speed as u32);
            pulses += i128::from(now);
            let exact = turned * i128::from(pitch);
            let unit = i128::from(increments) * 100;
            // No more than has been turned, and less than a pulse behind.
            assert!(pulses * unit <= exact && exact < (pulses + 1) * unit);
        }
    }
}

#[test]
fn a_thread_ends_after_its_pulses() {
    let mut thread = Thread::new(true, 1_000, 10_000, 64);
    let pulses: u32 = (0..100).map(|_| thread.turned(63)).sum();
    assert_eq!(pulses, 1_000);
    assert!(thread.is_over());
}
