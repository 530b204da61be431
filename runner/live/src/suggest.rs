//! Baud rate and parity from what was heard, without knowing what was said.
//!
//! A line is listened to with 8 data bits and no parity at a few rates. At a
//! wrong rate stop bits are missing and bytes are no text. At the right rate,
//! a parity bit shows: of 7 data bits and parity it is bit 7, of 8 data bits
//! and parity it stands where the stop bit is expected.

use softplug_abi::{LineParameters, Parity};

/// Bytes below which a sample proves little.
const ENOUGH_BYTES: usize = 16;
/// Score from which on a suggestion is worth following.
const GOOD_SCORE: u32 = 700;
/// Bytes of the sample that are shown.
const EXCERPT_BYTES: usize = 48;

/// What was heard with 8 data bits and no parity at one rate.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Sample {
    /// The rate; 0 where the port has none.
    pub baud: u32,
    /// Bytes with their stop bit.
    pub good: Vec<u8>,
    /// Bytes without.
    pub bad: Vec<u8>,
    /// Breaks.
    pub breaks: u32,
    /// Reads in which characters were lost in the port.
    pub overruns: u32,
}

/// Settings that a sample speaks for.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Suggestion {
    /// The settings. How many stop bits there are cannot be heard.
    pub line: LineParameters,
    /// From 0 to 1000: share of the characters that are good and typical of
    /// NC programs if read so.
    pub score: u32,
    /// Characters that it rests on.
    pub characters: usize,
    /// The beginning of what was heard, read so; controls as dots.
    pub excerpt: String,
}

impl Suggestion {
    /// Whether it is worth following.
    pub fn is_good(&self) -> bool {
        self.score >= GOOD_SCORE
    }
}

/// Ways to read what was heard as 8N1, the simplest first.
const READINGS: [Reading; 6] = [
    Reading { data_bits: 8, parity: Parity::None },
    Reading { data_bits: 7, parity: Parity::Even },
    Reading { data_bits: 7, parity: Parity::Odd },
    // Seen as 8N1, two stop bits and a parity bit of 1 are the same.
    Reading { data_bits: 7, parity: Parity::Mark },
    Reading { data_bits: 8, parity: Parity::Even },
    Reading { data_bits: 8, parity: Parity::Odd },
];

/// The settings that the samples speak for, the likeliest first, one for each
/// rate at which anything was heard.
pub fn suggest(samples: &[Sample]) -> Vec<Suggestion> {
    let mut suggestions: Vec<_> = samples.iter().filter_map(best_reading).collect();
    // Stable: of equals, the one that was listened to first.
    suggestions.sort_by_key(|suggestion| std::cmp::Reverse(suggestion.score));
    suggestions
}

fn best_reading(sample: &Sample) -> Option<Suggestion> {
    let heard = sample.good.len() + sample.bad.len();
    if heard == 0 {
        return None;
    }
    let scored = READINGS.iter().map(|reading| (reading.score(sample), reading));
    // Of equals the simplest: the first.
    let (score, reading) = scored.reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    let line = LineParameters {
        data_bits: reading.data_bits,
        parity: reading.parity,
        ..LineParameters::new(sample.baud)
    };
    let excerpt = sample.good.iter().take(EXCERPT_BYTES).map(|byte| reading.shown(*byte));
    Some(Suggestion { line, score, characters: heard, excerpt: excerpt.collect() })
}

struct Reading {
    data_bits: u8,
    parity: Parity,
}

impl Reading {
    fn score(&self, sample: &Sample) -> u32 {
        let heard = sample.good.len() + sample.bad.len();
        let fitting = sample.good.iter().filter(|byte| self.fits(**byte, true)).count()
            + sample.bad.iter().filter(|byte| self.fits(**byte, false)).count();
        let all_bytes = sample.good.iter().chain(self.bad_bytes(sample));
        let typical = typical(all_bytes.map(|byte| byte & self.mask()));
        let sure = heard.min(ENOUGH_BYTES) as u64 * 1_000 / ENOUGH_BYTES as u64;
        let fitting = fitting as u64 * 1_000 / heard as u64;
        (u64::from(typical) * fitting * sure / 1_000_000) as u32
    }

    /// Whether a character sent so can have been heard as this byte.
    fn fits(&self, byte: u8, good: bool) -> bool {
        let odd = byte.count_ones() % 2 == 1;
        match (self.data_bits, self.parity) {
            // The parity bit was taken for the stop bit.
            (8, Parity::Even) => good == odd,
            (8, Parity::Odd) => good != odd,
            (7, Parity::Even) => good && !odd,
            (7, Parity::Odd) => good && odd,
            (7, Parity::Mark) => good && byte & 0x80 != 0,
            _ => good,
        }
    }

    /// Bytes without a stop bit count as text only where that is a parity bit.
    fn bad_bytes<'a>(&self, sample: &'a Sample) -> &'a [u8] {
        if self.data_bits == 8 && self.parity != Parity::None { &sample.bad } else { &[] }
    }

    fn mask(&self) -> u8 {
        if self.data_bits == 7 { 0x7F } else { 0xFF }
    }

    fn shown(&self, byte: u8) -> char {
        match byte & self.mask() {
            byte @ 0x20..=0x7E => byte as char,
            _ => '·',
        }
    }
}

/// How typical of NC programs the bytes are, 0 to 1000. Leaders and control
/// codes of flow control say nothing, unless there is nothing else.
fn typical(bytes: impl Iterator<Item = u8>) -> u32 {
    let (mut sum, mut count, mut neutral) = (0_u64, 0_u64, 0_u64);
    for byte in bytes {
        let weight = match byte {
            0 | 0x11..=0x14 | 0x7F => {
                neutral += 1;
                continue;
            }
            b'0'..=b'9' | b'A'..=b'Z' | b' ' | b'\r' | b'\n' => 1_000,
            byte if b".-+%()/:;#=*[],".contains(&byte) => 1_000,
            b'!'..=b'~' | b'\t' => 500,
            _ => 0,
        };
        sum += weight;
        count += 1;
    }
    match (count, neutral) {
        (0, 0) => 0,
        (0, _) => 300,
        (count, _) => (sum / count) as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROGRAM: &str = "%\r\nO1234 (COVER PLATE)\r\nN10 G21 G90 G17\r\nN20 T1 M6\r\n\
        N30 G0 X-12.5 Y40. S3000 M3\r\nN40 G1 Z-2.75 F120\r\nN50 M30\r\n%\r\n";

    /// The line's level, bit after bit.
    fn send(text: &[u8], line: LineParameters) -> Vec<bool> {
        let mut bits = vec![true; 20];
        for byte in text {
            bits.push(false);
            let data = (0..line.data_bits).map(|bit| byte >> bit & 1 == 1);
            bits.extend(data.clone());
            let odd = data.filter(|bit| *bit).count() % 2 == 1;
            match line.parity {
                Parity::None => {}
                Parity::Even => bits.push(odd),
                Parity::Odd => bits.push(!odd),
                Parity::Mark => bits.push(true),
                Parity::Space => bits.push(false),
            }
            bits.extend(vec![true; usize::from(line.stop_half_bits / 2)]);
        }
        bits
    }

    /// A UART set to 8N1 that samples bits in their middle and after a missing
    /// stop bit waits for the line to rest.
    fn hear(bits: &[bool], sent_baud: u32, baud: u32) -> Sample {
        // A step is a sixteenth of a bit of the listener.
        let level = |step: u64| {
            let bit = step * u64::from(sent_baud) / (16 * u64::from(baud));
            bits.get(bit as usize).copied()
        };
        let mut sample = Sample { baud, ..Sample::default() };
        let mut step = 0;
        while let Some(high) = level(step) {
            if high || level(step + 8) != Some(false) {
                step += 1;
                continue;
            }
            let middle = |bit: u64| level(step + 8 + 16 * bit).unwrap_or(true);
            let byte = (0..8).fold(0, |byte, bit| byte | u8::from(middle(bit + 1)) << bit);
            if middle(9) {
                sample.good.push(byte);
                step += 8 + 16 * 9;
            } else {
                sample.bad.push(byte);
                step += 8 + 16 * 9;
                while level(step) == Some(false) {
                    step += 1;
                }
            }
        }
        sample
    }

    fn line(baud: u32, data_bits: u8, parity: Parity) -> LineParameters {
        LineParameters { data_bits, parity, ..LineParameters::new(baud) }
    }

    #[test]
    fn rate_and_parity_are_found_among_the_common_ones() {
        let rates = [300, 1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200];
        for sent_baud in [300, 2_400, 4_800, 9_600, 19_200, 115_200] {
            for (data_bits, parity) in [
                (8, Parity::None),
                (7, Parity::Even),
                (7, Parity::Odd),
                (8, Parity::Even),
                (8, Parity::Odd),
            ] {
                let sent = line(sent_baud, data_bits, parity);
                let bits = send(PROGRAM.as_bytes(), sent);
                let samples: Vec<_> =
                    rates.iter().map(|baud| hear(&bits, sent_baud, *baud)).collect();
                let found = suggest(&samples);
                assert_eq!(found[0].line, sent, "{found:?}");
                assert!(found[0].is_good(), "{found:?}");
                assert!(found[1..].iter().all(|other| !other.is_good()), "{sent:?}: {found:?}");
            }
        }
    }

    #[test]
    fn the_excerpt_reads_as_text() {
        let sent = line(9_600, 7, Parity::Even);
        let found = suggest(&[hear(&send(PROGRAM.as_bytes(), sent), 9_600, 9_600)]);
        assert_eq!(found[0].excerpt, "%··O1234 (COVER PLATE)··N10 G21 G90 G17··N20 T1 ");
        assert_eq!(found[0].characters, PROGRAM.len());
    }

    #[test]
    fn two_stop_bits_after_seven_data_bits_are_a_mark() {
        let sent = LineParameters { stop_half_bits: 4, ..line(9_600, 7, Parity::None) };
        let found = suggest(&[hear(&send(PROGRAM.as_bytes(), sent), 9_600, 9_600)]);
        assert_eq!(found[0].line, line(9_600, 7, Parity::Mark));
    }

    #[test]
    fn little_or_noise_convinces_nobody() {
        assert_eq!(suggest(&[Sample { baud: 9_600, ..Sample::default() }]), []);
        let few = Sample { baud: 9_600, good: b"G1X2".to_vec(), ..Sample::default() };
        assert!(!suggest(&[few])[0].is_good());
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let good = (0..500).map(|_| random()).collect();
        let noise = Sample { baud: 9_600, good, ..Sample::default() };
        assert!(!suggest(&[noise])[0].is_good());
        let leader = Sample { baud: 9_600, good: vec![0; 200], ..Sample::default() };
        assert!(!suggest(&[leader])[0].is_good());
    }
}
