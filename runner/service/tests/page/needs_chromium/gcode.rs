//! The page's reader of G-code against programs whose ways are known otherwise.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};

use crate::common::bench::Bench;
use crate::page::browser::Browser;

/// The reader in a browser.
struct Reader {
    browser: Browser,
    _bench: Bench,
}

impl Reader {
    fn open() -> Self {
        let bench = Bench::new();
        let mut browser = Browser::open();
        browser.go(&bench.url("/"));
        browser.until("document.activeElement?.name === 'token'");
        browser.value(
            "Promise.all(['gcode', 'lines'].map((name) => import(`/page/${name}.js`)))\
             .then(([gcode, lines]) => { window.readAll = (programs, options) => programs.map((text) => {\
                 const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));\
                 const read = gcode.read(bytes, lines.index(bytes), options);\
                 return { ...read, points: [...read.points.slice(-3)], kinds: read.kinds.length, pointLines: 0 };\
             }) })",
        );
        Self { browser, _bench: bench }
    }

    fn read_all<T: AsRef<[u8]>>(&mut self, programs: &[T], options: &Value) -> Vec<Value> {
        let texts: Vec<_> = programs.iter().map(|program| BASE64.encode(program)).collect();
        let read = self.browser.value(&format!("readAll({}, {options})", json!(texts)));
        read.as_array().unwrap().clone()
    }

    fn read(&mut self, program: &str) -> Value {
        self.read_with(program, &json!({}))
    }

    fn read_with(&mut self, program: &str, options: &Value) -> Value {
        self.read_all(&[program], options).remove(0)
    }
}

#[track_caller]
fn close(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap_or_else(|| panic!("{value} is no number"));
    let most = 1e-3_f64.max(expected.abs() * 1e-6);
    assert!((value - expected).abs() <= most, "{value} instead of {expected}");
}

#[track_caller]
fn is_at(read: &Value, expected: [f64; 3]) {
    for (axis, expected) in expected.into_iter().enumerate() {
        close(&read["points"][axis], expected);
    }
}

#[track_caller]
fn says(read: &Value, list: &str, expected: &[(&str, u64, u64)]) {
    let of = |remark: &Value| {
        let what = remark["what"].as_str().unwrap().to_owned();
        (what, remark["count"].as_u64().unwrap(), remark["line"].as_u64().unwrap() + 1)
    };
    let found: Vec<_> = read[list].as_array().unwrap().iter().map(of).collect();
    let found: Vec<_> = found.iter().map(|(what, n, line)| (what.as_str(), *n, *line)).collect();
    assert_eq!(found, expected);
}

#[test]
fn ways_are_as_long_as_geometry_has_them() {
    let mut reader = Reader::open();
    let quarter = PI / 2.0;
    // Program, length of the cut, where it ends.
    let cases: &[(&str, f64, [f64; 3])] = &[
        ("G1 X3. Y4. F60", 5.0, [3.0, 4.0, 0.0]),
        ("g01x3.y4.", 5.0, [3.0, 4.0, 0.0]),
        ("N1G91G1X3.\nN2 Y4.\nN3 Y-4.", 11.0, [3.0, 0.0, 0.0]),
        ("G20 G1 X1.", 25.4, [25.4, 0.0, 0.0]),
        ("G1 X+.5 (G1 X9.) Y-.5 ; X9.", 0.5_f64.sqrt(), [0.5, -0.5, 0.0]),
        // A quarter either way, by centre and by radius.
        ("G3 X-10. Y10. I-10. J0.", 10.0 * quarter, [-10.0, 10.0, 0.0]),
        ("G2 X10. Y10. J10.", 10.0 * 3.0 * quarter, [10.0, 10.0, 0.0]),
        ("G2 X10. Y10. R10.", 10.0 * quarter, [10.0, 10.0, 0.0]),
        ("G2 X10. Y10. R-10.", 10.0 * 3.0 * quarter, [10.0, 10.0, 0.0]),
        ("G3 X10. Y10. R10.", 10.0 * quarter, [10.0, 10.0, 0.0]),
        ("G2 X20. R10.", 10.0 * PI, [20.0, 0.0, 0.0]),
        // Full circles, alone and as a thread.
        ("G2 I5.", 5.0 * TAU, [0.0, 0.0, 0.0]),
        ("G3 I3. J4. Z-2.", (5.0 * TAU).hypot(2.0), [0.0, 0.0, -2.0]),
        ("G18 G2 I5. Y3.", (5.0 * TAU).hypot(3.0), [0.0, 3.0, 0.0]),
        ("G18 G3 X10. Z10. K10.", 10.0 * 3.0 * quarter, [10.0, 0.0, 10.0]),
        ("G18 G2 X10. Z10. K10.", 10.0 * quarter, [10.0, 0.0, 10.0]),
        ("G19 G3 Y10. Z10. K10.", 10.0 * quarter, [0.0, 10.0, 10.0]),
        ("G19 G2 Y10. Z10. K10.", 10.0 * 3.0 * quarter, [0.0, 10.0, 10.0]),
        ("G1 X5.\nG90.1\nG3 X0. Y5. I0. J0.", 5.0 + 5.0 * quarter, [0.0, 5.0, 0.0]),
        ("G1 X5.\nG90.1 G91.1\nG3 X0. Y5. I-5. J0.", 5.0 + 5.0 * quarter, [0.0, 5.0, 0.0]),
    ];
    let programs: Vec<_> = cases.iter().map(|(program, ..)| program).collect();
    let read = reader.read_all(&programs, &json!({}));
    for ((program, length, end), read) in cases.iter().zip(&read) {
        assert_eq!(read["remarks"], json!([]), "{program}");
        close(&read["length"]["cut"], *length);
        is_at(read, *end);
    }
}

#[test]
fn sizes_have_the_outermost_points_of_arcs() {
    let mut reader = Reader::open();
    let read = reader.read("G0 X10. Y0.\nG1 Z-1.\nG3 X0. Y10. I-10.\nG3 X10. Y0. J-10.\n");
    assert_eq!(read["size"], json!({ "least": [-10, -10, -1], "most": [10, 10, 0] }));
    let read = reader.read("G19 G2 J-4.\n");
    assert_eq!(read["size"], json!({ "least": [0, -8, -4], "most": [0, 0, 4] }));
}

#[test]
fn times_are_those_of_the_feeds() {
    let mut reader = Reader::open();
    for (program, cut, dwell, unfed) in [
        ("G1 X100. F200", 30.0, 0.0, 0.0),
        ("G1 X100. F200\nF400 X0.", 45.0, 0.0, 0.0),
        ("G20 G1 X1. F10.", 6.0, 0.0, 0.0),
        ("G95 S500 G1 X100. F.2", 60.0, 0.0, 0.0),
        ("G93 G1 X100. F2.", 30.0, 0.0, 0.0),
        ("G1 X100.\nG1 X0. F100", 60.0, 0.0, 100.0),
        // A constant speed of the surface has no constant speed of the spindle.
        ("G95 G96 S200 G1 X100. F.2", 0.0, 0.0, 100.0),
        ("G1 X10. F600\nG4 P1500\nG4 X2.5\nG4 P1.", 1.0, 5.0, 0.0),
    ] {
        let read = reader.read(program);
        close(&read["seconds"]["cut"], cut);
        close(&read["seconds"]["dwell"], dwell);
        close(&read["length"]["unfed"], unfed);
    }
}

#[test]
fn what_a_setting_says_is_read_so() {
    let mut reader = Reader::open();
    let lathe = json!({ "isLathe": true });
    let read =
        reader.read_with("G0 X40. Z2.\nG97 S1000 G99\nG1 Z-10. F.1\nG2 X60. W-10. R10.\n", &lathe);
    is_at(&read, [30.0, 0.0, -20.0]);
    close(&read["length"]["cut"], 12.0 + 5.0 * PI);
    close(&read["seconds"]["cut"], (12.0 + 5.0 * PI) * 60.0 / 100.0);
    let thousandths = json!({ "isThousandths": true });
    let read = reader.read_with("G1 X1500 Y2. F100\n", &thousandths);
    is_at(&read, [1.5, 2.0, 0.0]);
    says(&read, "assumed", &[("numbers without a point", 1, 1)]);
    is_at(&reader.read("G1 X1500 Y2. F100\n"), [1500.0, 2.0, 0.0]);
}

#[test]
fn what_is_not_understood_is_counted_and_not_drawn() {
    let mut reader = Reader::open();
    let program = "%\nO1\nG0 X0. Y0. Z5.\nG81 X10. Y10. Z-5. R2. F100\nX20.\nG80\nG0 X30.\nG1 X40.\n\
                   #100=5\nG1 X#100\nG1 X50.\nM98 P1000\nG65 P9010 X1.\nG1 X60.\n\
                   IF [#1 EQ 2] GOTO 5\nG28 Z0.\nG1 A10. X70.\nG5.1 Q1\nG68 X1. R30.\nM30\nG1 X99.\n";
    let read = reader.read(program);
    says(
        &read,
        "remarks",
        &[
            ("cycles (G81)", 2, 4),
            ("variables and formulas", 2, 9),
            ("subprograms (M98)", 1, 12),
            ("G65", 1, 13),
            ("words without a number", 1, 15),
            ("ways over the reference point (G28)", 1, 16),
            ("the axis or word A", 1, 17),
            ("G5.1, drawn as if it were not there", 1, 18),
            ("G68, drawn as if it were not there", 1, 19),
            ("text behind the end of the program (M30, M2, M99 or %)", 1, 21),
        ],
    );
    // Between what is not understood, from a place that is known to another: once.
    close(&read["length"]["cut"], 10.0);
}

#[test]
fn arcs_that_cannot_be_are_no_arcs() {
    let mut reader = Reader::open();
    for (program, remark) in [
        ("G2 X10. Y10.", "arcs without centre and radius"),
        ("G2 X100. R10.", "arcs whose radius is too small for their ends"),
        ("G2 X0. Y0. R10.", "full turns by radius, which have no centre"),
        ("G2 X10. I0. J0.", "arcs without a radius"),
        ("G2 X10. I2.", "arcs whose end is not on their circle, drawn as spirals"),
        ("G2 I5. P3", "arcs of several turns (P), drawn as one"),
        ("G1 X5. R2.", "corners with R, drawn sharp"),
        ("X5.", "moves before the first G0 to G3"),
        ("G1 X99999999.", "measures beyond 10 km"),
        ("G1 XNaN", "words without a number"),
        ("G1 X=5", "variables and formulas"),
        ("G1 \u{202e}X5", "signs that are no words"),
    ] {
        says(&reader.read(program), "remarks", &[(remark, 1, 1)]);
    }
}

#[test]
fn hostile_programs_are_read_within_bounds() {
    let mut reader = Reader::open();
    let digits = format!("G1 X{}\nG1 Y5.", "9".repeat(5_000));
    let words = "G1".to_owned() + &" X1.".repeat(200_000);
    let arcs = "G91 G2 I5.\n".repeat(30_000);
    let kinds = (0..500).fold(String::new(), |mut text, n| {
        let _ = writeln!(text, "G{}.{}", 100 + n, n % 10);
        text
    });
    let noise: Vec<u8> =
        (0..300_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let programs =
        [digits.as_bytes(), words.as_bytes(), arcs.as_bytes(), kinds.as_bytes(), &noise, b""];
    let read = reader.read_all(&programs, &json!({}));
    says(&read[0], "remarks", &[("measures beyond 10 km", 1, 1)]);
    says(&read[1], "remarks", &[("blocks of more than 64 words", 1, 1)]);
    // Behind so many points nothing is drawn; the way goes on.
    assert_eq!(read[2]["kinds"], 2_000_000);
    assert_eq!(read[2]["notDrawn"], 30_000 * 96 + 1 - 2_000_000);
    close(&read[2]["length"]["cut"], 30_000.0 * 5.0 * TAU);
    assert!(read[3]["remarks"].as_array().unwrap().len() <= 61, "{}", read[3]["remarks"]);
    for read in &read[4..] {
        for length in ["cut", "rapid"] {
            assert!(read["length"][length].as_f64().unwrap().is_finite(), "{read}");
        }
    }
}

/// Ways made of numbers by chance, written down as a program: what is read must be what was made.
#[test]
fn programs_made_of_known_ways_are_read_as_these_ways() {
    let mut reader = Reader::open();
    let made: Vec<_> = (1..=150).map(Made::new).collect();
    let programs: Vec<_> = made.iter().map(|made| &made.text).collect();
    for (made, read) in made.iter().zip(reader.read_all(&programs, &json!({}))) {
        assert_eq!(read["remarks"], json!([]), "{}", made.text);
        let is_near = |value: &Value, expected: f64| {
            let value = value.as_f64().unwrap();
            // Written with four digits, which the ends of arcs have to meet.
            let most = 0.05_f64.max(expected.abs() * 2e-4);
            assert!(
                (value - expected).abs() <= most,
                "{value} instead of {expected}:\n{}",
                made.text
            );
        };
        is_near(&read["length"]["cut"], made.cut);
        is_near(&read["length"]["rapid"], made.rapid);
        is_near(&read["seconds"]["cut"], made.seconds);
        for axis in 0..3 {
            is_near(&read["points"][axis], made.place[axis]);
            if made.cut > 0.0 {
                is_near(&read["size"]["least"][axis], made.least[axis]);
                is_near(&read["size"]["most"][axis], made.most[axis]);
            }
        }
    }
}

struct Made {
    seed: u32,
    text: String,
    place: [f64; 3],
    cut: f64,
    rapid: f64,
    seconds: f64,
    least: [f64; 3],
    most: [f64; 3],
    is_incremental: bool,
    unit: f64,
    feed: f64,
}

impl Made {
    fn new(seed: u32) -> Self {
        let (least, most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut made = Self {
            seed: seed * 7_919,
            text: "G21 G90 G17 G94 F600.\n".to_owned(),
            place: [0.0; 3],
            cut: 0.0,
            rapid: 0.0,
            seconds: 0.0,
            least,
            most,
            is_incremental: false,
            unit: 1.0,
            feed: 600.0,
        };
        for _ in 0..25 {
            made.block();
        }
        made
    }

    fn chance(&mut self, of: u32) -> u32 {
        self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.seed >> 8) % of
    }

    fn number(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * f64::from(self.chance(10_000)) / 10_000.0
    }

    fn block(&mut self) {
        match self.chance(8) {
            0 => {
                self.is_incremental = !self.is_incremental;
                self.text += if self.is_incremental { "G91\n" } else { "G90\n" };
            }
            1 => {
                self.unit = if self.unit > 1.0 { 1.0 } else { 25.4 };
                self.feed = self.number(100.0, 2_000.0).round();
                let feed = self.feed / self.unit;
                let _ =
                    writeln!(self.text, "G{} F{feed:.5}", if self.unit > 1.0 { 20 } else { 21 });
            }
            2 => self.straight(true),
            3 | 4 => self.straight(false),
            _ => self.arc(),
        }
    }

    fn straight(&mut self, is_rapid: bool) {
        let mut to = self.place;
        for coordinate in &mut to {
            if self.chance(3) > 0 {
                *coordinate = self.number(-200.0, 200.0);
            }
        }
        let words = self.words(to);
        let _ = writeln!(self.text, "G{}{words}", u8::from(!is_rapid));
        let length = distance(self.place, to);
        if words.is_empty() {
            return;
        }
        if is_rapid {
            self.rapid += length;
        } else {
            self.reach(self.place);
            self.reach(to);
            self.fed(length);
        }
        self.place = to;
    }

    /// A part of a circle, walked in small steps.
    fn arc(&mut self) {
        let (code, [a, b, c]) =
            [(17, [0, 1, 2]), (18, [2, 0, 1]), (19, [1, 2, 0])][self.chance(3) as usize];
        let radius = self.number(5.0, 80.0);
        let begin = self.number(0.0, TAU);
        let sweep = self.number(0.3, 5.9) * if self.chance(2) == 0 { 1.0 } else { -1.0 };
        let rise = if self.chance(2) == 0 { 0.0 } else { self.number(-20.0, 20.0) };
        let from = self.place;
        let at = |part: f64| {
            let mut point = from;
            point[a] += radius * ((begin + sweep * part).cos() - begin.cos());
            point[b] += radius * ((begin + sweep * part).sin() - begin.sin());
            point[c] += rise * part;
            point
        };
        let mut words = self.words(at(1.0));
        if self.chance(2) == 0 {
            let is_long = sweep.abs() > PI;
            let _ = write!(words, " R{:.5}", if is_long { -radius } else { radius } / self.unit);
        } else {
            let names = ["I", "J", "K"];
            let (one, other) =
                (-radius * begin.cos() / self.unit, -radius * begin.sin() / self.unit);
            let _ = write!(words, " {}{one:.5} {}{other:.5}", names[a], names[b]);
        }
        let _ = writeln!(self.text, "G{code} G{:02}{words}", if sweep > 0.0 { 3 } else { 2 });
        let steps = 4_000;
        let mut length = 0.0;
        for step in 0..=steps {
            let point = at(f64::from(step) / f64::from(steps));
            self.reach(point);
            length += distance(self.place, point);
            self.place = point;
        }
        self.fed(length);
    }

    /// The words that lead there.
    fn words(&self, to: [f64; 3]) -> String {
        let mut words = String::new();
        for (axis, name) in ["X", "Y", "Z"].iter().enumerate() {
            let from = if self.is_incremental { self.place[axis] } else { 0.0 };
            if (to[axis] - self.place[axis]).abs() > 1e-12 {
                let _ = write!(words, " {name}{:.5}", (to[axis] - from) / self.unit);
            }
        }
        words
    }

    fn fed(&mut self, length: f64) {
        self.cut += length;
        self.seconds += length * 60.0 / self.feed;
    }

    fn reach(&mut self, point: [f64; 3]) {
        for (axis, value) in point.into_iter().enumerate() {
            self.least[axis] = self.least[axis].min(value);
            self.most[axis] = self.most[axis].max(value);
        }
    }
}

fn distance(one: [f64; 3], other: [f64; 3]) -> f64 {
    one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum::<f64>().sqrt()
}
