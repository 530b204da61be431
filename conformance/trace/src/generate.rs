//! The built-in generators: long data from a few characters.
//!
//! Their output is part of the format: it is frozen by tests, and a change
//! would need a new name.

use std::fmt;

/// Every generator.
pub const GENERATORS: &[GeneratorKind] =
    &[GeneratorKind::Nc, GeneratorKind::Bytes, GeneratorKind::Text];

/// What a generator makes.
///
/// ```
/// use softplug_trace::{GENERATORS, Generator, GeneratorKind, Item, NoFiles, Payload};
///
/// let generator = Generator { kind: GeneratorKind::Nc, seed: 1, length: 100 };
/// let program = Payload::new([Item::Generated(generator)]).bytes(&NoFiles)?;
/// assert_eq!(program.len(), 100);
/// assert!(program.starts_with(b"N0010 G1 X"));
/// assert_eq!(GENERATORS.iter().map(|kind| kind.name()).collect::<Vec<_>>(), ["nc", "bytes", "text"]);
/// # Ok::<(), softplug_trace::PayloadError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum GeneratorKind {
    /// An NC program in ASCII, lines that end in LF.
    Nc,
    /// Every byte value: each run of 256 bytes is a permutation of all of them.
    Bytes,
    /// Printable ASCII, space to tilde, without line ends.
    Text,
}

impl GeneratorKind {
    /// The name in a trace.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nc => "nc",
            Self::Bytes => "bytes",
            Self::Text => "text",
        }
    }
}

/// A generator's call: the same bytes for the same call, for ever.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub struct Generator {
    /// What it makes.
    pub kind: GeneratorKind,
    /// Where it starts.
    pub seed: u64,
    /// How many bytes.
    pub length: u64,
}

impl fmt::Display for Generator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "gen:{}({},{})", self.kind.name(), self.seed, self.length)
    }
}

impl Generator {
    /// Appends exactly `length` bytes. The length has been checked.
    pub(crate) fn append(&self, all: &mut Vec<u8>) {
        let mut random = SplitMix(self.seed);
        let length = self.length as usize;
        all.reserve(length);
        match self.kind {
            GeneratorKind::Nc => nc(&mut random, length, all),
            GeneratorKind::Bytes => bytes(&mut random, length, all),
            GeneratorKind::Text => all.extend((0..length).map(|_| b' ' + random.below(95) as u8)),
        }
    }
}

fn nc(random: &mut SplitMix, length: usize, all: &mut Vec<u8>) {
    let end = all.len() + length;
    let mut number = 10;
    while all.len() < end {
        let x = random.below(200_000) as i64 - 100_000;
        let y = random.below(200_000) as i64 - 100_000;
        let line = format!("N{number:04} G1 X{} Y{}\n", Thousandths(x), Thousandths(y));
        number = if number == 9_990 { 10 } else { number + 10 };
        let room = end - all.len();
        if line.len() <= room {
            all.extend_from_slice(line.as_bytes());
        } else {
            last_line(room, all);
        }
    }
}

/// A comment of exactly `room` bytes, the line end included.
fn last_line(room: usize, all: &mut Vec<u8>) {
    if room < 3 {
        all.extend(std::iter::repeat_n(b' ', room - 1));
    } else {
        all.push(b'(');
        all.extend(std::iter::repeat_n(b'-', room - 3));
        all.push(b')');
    }
    all.push(b'\n');
}

fn bytes(random: &mut SplitMix, length: usize, all: &mut Vec<u8>) {
    let mut left = length;
    while left > 0 {
        let mut block: [u8; 256] = std::array::from_fn(|value| value as u8);
        for place in (1..block.len()).rev() {
            block.swap(place, random.below(place as u64 + 1) as usize);
        }
        let taken = left.min(block.len());
        all.extend_from_slice(&block[..taken]);
        left -= taken;
    }
}

/// A number of thousandths with its point.
struct Thousandths(i64);

impl std::fmt::Display for Thousandths {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        write!(f, "{sign}{}.{:03}", self.0.abs() / 1_000, self.0.abs() % 1_000)
    }
}

/// SplitMix64: small, and the same everywhere.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number under `bound`, by the high half of the product.
    fn below(&mut self, bound: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(bound)) >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn make(kind: GeneratorKind, seed: u64, length: u64) -> Vec<u8> {
        let mut all = Vec::new();
        Generator { kind, seed, length }.append(&mut all);
        all
    }

    #[test]
    fn the_random_numbers_are_splitmix64() {
        // The published first outputs for seed 1234567.
        let mut random = SplitMix(1_234_567);
        assert_eq!(random.next(), 6_457_827_717_110_365_317);
        assert_eq!(random.next(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn output_is_frozen() {
        insta::assert_snapshot!(String::from_utf8(make(GeneratorKind::Nc, 7, 90)).unwrap());
        insta::assert_snapshot!(String::from_utf8(make(GeneratorKind::Text, 7, 60)).unwrap());
        insta::assert_snapshot!(format!("{:02X?}", make(GeneratorKind::Bytes, 7, 16)));
    }

    #[test]
    fn nc_programs_have_exactly_the_length_and_whole_lines() {
        for length in 0..300 {
            let program = make(GeneratorKind::Nc, 3, length);
            assert_eq!(program.len() as u64, length);
            assert!(program.is_empty() || program.ends_with(b"\n"));
            assert!(program.iter().all(|byte| *byte == b'\n' || (b' '..=b'~').contains(byte)));
        }
    }

    #[test]
    fn block_numbers_start_again_after_9990() {
        let program = String::from_utf8(make(GeneratorKind::Nc, 1, 60_000)).unwrap();
        let numbers: Vec<&str> =
            program.lines().filter(|line| line.starts_with('N')).map(|line| &line[..5]).collect();
        assert_eq!(numbers[998..1_000], ["N9990", "N0010"]);
    }

    #[test]
    fn bytes_hold_every_value_and_seeds_differ() {
        let mut block = make(GeneratorKind::Bytes, 9, 256);
        assert_ne!(block, make(GeneratorKind::Bytes, 10, 256));
        assert_eq!(make(GeneratorKind::Bytes, 9, 300)[..256], block);
        block.sort_unstable();
        assert_eq!(block, (0..=255).collect::<Vec<u8>>());
    }
}
