//! Milled parts: a finished surface, and holes in patterns.

use super::random::Random;
use super::tape::{Length, Tape};

/// A hill or a hollow of the surface: place, height and width, in mm.
struct Hill {
    x: f64,
    y: f64,
    height: f64,
    width: f64,
}

/// Sums, products and quotients only, so that every machine rounds alike.
fn surface(hills: &[Hill], x: f64, y: f64) -> i64 {
    let height: f64 = hills
        .iter()
        .map(|hill| {
            let (dx, dy) = ((x - hill.x) / hill.width, (y - hill.y) / hill.width);
            hill.height / (1.0 + dx * dx + dy * dy)
        })
        .sum();
    (height * 1_000.0).round() as i64
}

/// Lines to and fro over a surface of hills and hollows, each line's points
/// close enough for a smooth path.
pub(super) fn surfacing(tape: &mut Tape, random: &mut Random) {
    let hills: Vec<_> = (0..6)
        .map(|_| Hill {
            x: random.between(0, 120) as f64,
            y: random.between(0, 80) as f64,
            height: random.between(-12, 9) as f64,
            width: random.between(8, 30) as f64,
        })
        .collect();
    tape.closes_with("G0Z50.\nM9\nM5\nG91G28Z0\nG90\n");
    tape.block(
        "O1000(SURFACE FINISH)\n(BALL NOSE D6 R3)\nG21G17G40G49G80G90\nT6M6\nG54\n\
         G0X0.Y0.S14000M3\nG43Z50.H6\nM8\nG5.1Q1",
    );
    tape.closes_with("G5.1Q0\nG0Z50.\nM9\nM5\nG91G28Z0\nG90\n");
    // One pass after the other, each between the lines of the one before.
    for pass in 0.. {
        let offset = [0, 150, 75, 225][pass % 4];
        for line in 0..266 {
            let y = line * 300 + offset;
            if !surface_line(tape, &hills, y, line % 2 == 1) {
                return;
            }
        }
        if !tape.block("G0Z50.\nX0.Y0.") {
            return;
        }
    }
}

fn surface_line(tape: &mut Tape, hills: &[Hill], y: i64, back: bool) -> bool {
    const STEP: i64 = 400;
    const WIDTH: i64 = 120_000;

    let mut last = None;
    for point in 0..=WIDTH / STEP {
        let x = if back { WIDTH - point * STEP } else { point * STEP };
        let z = surface(hills, x as f64 / 1e3, y as f64 / 1e3);
        let done = match last {
            None => tape.block(format_args!("G1X{}Y{}Z{}F2400", Length(x), Length(y), Length(z))),
            // Words that stay the same are left out, as a post-processor does.
            Some(last) if last == z => tape.block(format_args!("X{}", Length(x))),
            Some(_) => tape.block(format_args!("X{}Z{}", Length(x), Length(z))),
        };
        if !done {
            return false;
        }
        last = Some(z);
    }
    true
}

/// Rows and grids of holes, tool by tool.
pub(super) fn drilling(tape: &mut Tape, random: &mut Random) {
    let closing = "G80\nG0Z100.\nM9\nM5\nG91G28Z0\nG90\n";
    tape.closes_with(closing);
    tape.block("O2000(HOLE PATTERNS)\nG21G17G40G49G80G90");
    for tool in (1..=24).cycle() {
        let (cycle, name) = match tool % 4 {
            0 => ("G84", "TAP"),
            1 => ("G81", "SPOT DRILL"),
            2 => ("G83", "TWIST DRILL, PECKING"),
            _ => ("G73", "TWIST DRILL, CHIP BREAKING"),
        };
        let peck = if matches!(cycle, "G83" | "G73") { "Q2.5" } else { "" };
        let speed = random.between(4, 30) * 100;
        let depth = Length(-random.between(20, 350) * 100);
        let (x, y) = (random.between(-900, 900) * 100, random.between(-600, 600) * 100);
        // A cycle goes on with the places of its holes until G80.
        let started = tape.block(format_args!(
            "(T{tool} {name})\nT{tool}M6\nG54\nG0X{}Y{}S{speed}M3\nG43Z50.H{tool}\nM8\n\
             G98{cycle}Z{depth}R2.{peck}F{}",
            Length(x),
            Length(y),
            random.between(8, 40) * 10,
        ));
        if !started || !holes(tape, random, x, y) {
            return;
        }
        if !tape.block("G80\nG0Z100.\nM9\nM5") {
            return;
        }
    }
}

fn holes(tape: &mut Tape, random: &mut Random, x: i64, y: i64) -> bool {
    let (columns, rows) = (random.between(3, 12), random.between(2, 9));
    let (step_x, step_y) = (random.between(60, 250) * 100, random.between(60, 250) * 100);
    for row in 0..rows {
        // The block of the cycle drills the first.
        for column in i64::from(row == 0)..columns {
            let column = if row % 2 == 1 { columns - 1 - column } else { column };
            let (x, y) = (x + column * step_x, y + row * step_y);
            if !tape.block(format_args!("X{}Y{}", Length(x), Length(y))) {
                return false;
            }
        }
    }
    true
}
