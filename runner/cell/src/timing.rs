//! How long the blocks of a program take, as far as the program tells.
//!
//! The path of G00 to G03 at feed F, dwell G04, and the time on the line: a block takes the longer of
//! moving and sending. What a block does not tell, such as the time of a tool change, is not counted.

/// What is known of a machine beside its program.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct Machine {
    /// Bytes per second on its line.
    pub bytes_per_second: f64,
    /// Rapid traverse, in mm/min.
    pub rapid: f64,
}

impl Default for Machine {
    /// A line of 9600 bit/s and 10 m/min.
    fn default() -> Self {
        Self { bytes_per_second: 960.0, rapid: 10_000.0 }
    }
}

/// Reads blocks one after the other, and says how long each takes.
///
/// ```
/// use softplug_cell::{BlockTimes, Machine};
///
/// let mut times = BlockTimes::new(Machine { bytes_per_second: 1e9, rapid: 6_000.0 });
/// assert!((times.seconds(b"G1 X60 F600") - 6.0).abs() < 1e-6);
/// assert!((times.seconds(b"G0 X0") - 0.6).abs() < 1e-6);
/// assert!((times.seconds(b"G4 P500") - 0.5).abs() < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct BlockTimes {
    machine: Machine,
    motion: Motion,
    is_relative: bool,
    is_inch: bool,
    /// Feed in mm per revolution, not per minute.
    is_per_turn: bool,
    feed: f64,
    speed: f64,
    at: [f64; 3],
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Motion {
    Rapid,
    Line,
    Arc,
}

impl BlockTimes {
    /// From the beginning of a program, at the origin.
    pub fn new(machine: Machine) -> Self {
        Self {
            machine,
            motion: Motion::Rapid,
            is_relative: false,
            is_inch: false,
            is_per_turn: false,
            feed: 0.0,
            speed: 0.0,
            at: [0.0; 3],
        }
    }

    /// Seconds that the next block takes.
    pub fn seconds(&mut self, block: &[u8]) -> f64 {
        let line = (block.len() as f64) / self.machine.bytes_per_second;
        let moves = self.moves(&words(block));
        line.max(moves)
    }

    fn moves(&mut self, words: &[(u8, f64)]) -> f64 {
        let (mut dwells, mut is_home) = (false, false);
        for (_, code) in words.iter().filter(|(letter, _)| *letter == b'G') {
            match (code * 10.0).round() as i64 {
                0 => self.motion = Motion::Rapid,
                10 | 320 | 330 => self.motion = Motion::Line,
                20 | 30 => self.motion = Motion::Arc,
                40 => dwells = true,
                200 | 700 => self.is_inch = true,
                210 | 710 => self.is_inch = false,
                280 => is_home = true,
                900 => self.is_relative = false,
                910 => self.is_relative = true,
                940 | 980 => self.is_per_turn = false,
                950 | 990 => self.is_per_turn = true,
                _ => {}
            }
        }
        let value =
            |wanted: u8| words.iter().find(|(letter, _)| *letter == wanted).map(|(_, v)| *v);
        if dwells {
            // P is in milliseconds, X, U and F are in seconds.
            let seconds = [b'X', b'U', b'F'].into_iter().find_map(value);
            let dwell = seconds.or_else(|| Some(value(b'P')? / 1_000.0)).unwrap_or(0.0);
            return dwell.clamp(0.0, 86_400.0);
        }
        if let Some(feed) = value(b'F') {
            self.feed = feed;
        }
        if let Some(speed) = value(b'S') {
            self.speed = speed;
        }
        if is_home {
            return 0.0;
        }
        let scale = if self.is_inch { 25.4 } else { 1.0 };
        let from = self.at;
        for (axis, (absolute, relative)) in
            [(b'X', b'U'), (b'Y', b'V'), (b'Z', b'W')].into_iter().enumerate()
        {
            if let Some(to) = value(absolute) {
                let base = if self.is_relative { self.at[axis] } else { 0.0 };
                self.at[axis] = base + to * scale;
            } else if let Some(by) = value(relative) {
                self.at[axis] += by * scale;
            }
        }
        let chord: f64 =
            (0..3).map(|axis| (self.at[axis] - from[axis]).powi(2)).sum::<f64>().sqrt();
        let radius = value(b'R').map_or_else(
            || {
                let part = |letter| value(letter).unwrap_or(0.0).powi(2);
                (part(b'I') + part(b'J') + part(b'K')).sqrt()
            },
            f64::abs,
        );
        let length = match self.motion {
            Motion::Arc => arc(chord, radius * scale),
            Motion::Rapid | Motion::Line => chord,
        };
        let speed = match self.motion {
            Motion::Rapid => self.machine.rapid,
            _ if self.is_per_turn => self.feed * self.speed * scale,
            _ => self.feed * scale,
        };
        let seconds = length / speed * 60.0;
        if seconds.is_finite() { seconds.clamp(0.0, 86_400.0) } else { 0.0 }
    }
}

/// The shorter way round; the whole circle where it ends where it began.
fn arc(chord: f64, radius: f64) -> f64 {
    if radius <= 0.0 {
        return chord;
    }
    if chord < 1e-9 {
        return std::f64::consts::TAU * radius;
    }
    2.0 * radius * (chord / (2.0 * radius)).clamp(0.0, 1.0).asin()
}

/// Letters with their numbers; comments are none.
fn words(block: &[u8]) -> Vec<(u8, f64)> {
    let (mut words, mut at, mut depth) = (Vec::new(), 0, 0_usize);
    while at < block.len() {
        let byte = block[at].to_ascii_uppercase();
        at += 1;
        match byte {
            b'(' => depth += 1,
            b')' => depth = depth.saturating_sub(1),
            b';' if depth == 0 => break,
            b'A'..=b'Z' if depth == 0 => {
                let rest = &block[at..];
                let gap = rest.iter().take_while(|byte| **byte == b' ').count();
                let is_number = |byte: &&u8| byte.is_ascii_digit() || b"+-.".contains(byte);
                let digits = rest[gap..].iter().take_while(is_number).count();
                let text = std::str::from_utf8(&rest[gap..gap + digits]).unwrap_or_default();
                if let Ok(number) = text.trim_end_matches('.').parse::<f64>() {
                    words.push((byte, number));
                    at += gap + digits;
                }
            }
            _ => {}
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(program: &[&str]) -> Vec<f64> {
        let machine = Machine { bytes_per_second: 1e9, rapid: 6_000.0 };
        let mut times = BlockTimes::new(machine);
        let seconds = program.iter().map(|block| times.seconds(block.as_bytes()));
        seconds.map(|seconds| (seconds * 1_000.0).round() / 1_000.0).collect()
    }

    #[test]
    fn paths_take_their_length_at_their_feed() {
        let program =
            ["G90 G1 X30 Y40 F3000", "G91 G1 X-30.", "U10", "(G1 X999)", "G3 X20 R10", "G3 I5 J0"];
        // 50 mm, 30 mm, 10 mm, nothing, half a circle of 10 mm, a whole one of 5 mm.
        assert_eq!(taken(&program), [1.0, 0.6, 0.2, 0.0, 0.628, 0.628]);
        assert_eq!(taken(&["G20 G1 X1 F60"]), [1.0]);
        assert_eq!(taken(&["G95 S1000 G1 Z-50 F0.5"]), [6.0]);
        assert_eq!(taken(&["G04 X2.5", "G4 P250", "G04 U1"]), [2.5, 0.25, 1.0]);
    }

    #[test]
    fn nonsense_takes_no_time() {
        for block in [
            "G1 X1e9",
            "F0",
            "G1 X",
            "X-",
            "G99999999999999999999",
            "G1 X99999 F-5",
            "\u{fc}(",
            "G2 R0 X5 F0",
        ] {
            let seconds = taken(&[block])[0];
            assert!((0.0..=86_400.0).contains(&seconds), "{block}: {seconds}");
        }
    }

    #[test]
    fn a_slow_line_is_what_takes_time() {
        let mut times = BlockTimes::new(Machine { bytes_per_second: 10.0, rapid: 1e9 });
        assert!((times.seconds(b"G0 X1 Y1 Z") - 1.0).abs() < 1e-9);
    }
}
