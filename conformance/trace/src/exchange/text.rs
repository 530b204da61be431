//! Reading lines of words, with the place of every fault.

use super::Source;
use super::error::{ImportError, ImportFault, Place};

/// The file as text, without a byte order mark.
pub(super) fn decode(source: Source<'_>) -> Result<&str, ImportError> {
    let text = std::str::from_utf8(source.bytes).map_err(|error| ImportError {
        file: source.name.to_owned(),
        place: Place::Byte(error.valid_up_to()),
        fault: ImportFault::NotUtf8,
    })?;
    Ok(text.strip_prefix('\u{FEFF}').unwrap_or(text))
}

/// A line and how far it is read.
#[derive(Copy, Clone)]
pub(super) struct Cursor<'a> {
    file: &'a str,
    pub(super) line: u32,
    text: &'a str,
    rest: &'a str,
}

/// The lines of a file, without spaces around them.
pub(super) fn lines<'a>(
    source: Source<'a>,
) -> Result<impl Iterator<Item = Cursor<'a>>, ImportError> {
    let text = decode(source)?;
    let cursor = |(line, text): (usize, &'a str)| {
        let mut cursor = Cursor { file: source.name, line: line as u32 + 1, text, rest: text };
        cursor.skip_space();
        cursor
    };
    Ok(text.lines().enumerate().map(cursor))
}

impl<'a> Cursor<'a> {
    pub(super) fn is_at_end(&self) -> bool {
        self.rest.is_empty()
    }

    pub(super) fn rest(&self) -> &'a str {
        self.rest
    }

    /// The fault is here.
    pub(super) fn fault(&self, fault: ImportFault) -> ImportError {
        let before = &self.text[..self.text.len() - self.rest.len()];
        let column = before.chars().count() as u32 + 1;
        let place = Place::Line { line: self.line, column };
        ImportError { file: self.file.to_owned(), place, fault }
    }

    pub(super) fn expected<T>(&self, what: &'static str) -> Result<T, ImportError> {
        Err(self.fault(ImportFault::Expected(what)))
    }

    pub(super) fn skip_space(&mut self) {
        self.rest = self.rest.trim_start_matches([' ', '\t', '\r']);
    }

    /// Takes this text, if it stands here.
    pub(super) fn take(&mut self, what: &str) -> bool {
        let rest = self.rest.strip_prefix(what);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    /// Takes characters as long as they are such; perhaps none.
    pub(super) fn take_while(&mut self, such: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(|c| !such(c)).unwrap_or(self.rest.len());
        let (taken, rest) = self.rest.split_at(end);
        self.rest = rest;
        taken
    }

    /// Takes a number of seconds.
    pub(super) fn seconds(&mut self) -> Result<i64, ImportError> {
        let here = *self;
        let word = self.take_while(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '+' | '-'));
        micros(word).map_err(|fault| here.fault(fault))
    }

    /// Takes a hex digit, if one stands here.
    pub(super) fn hex_digit(&mut self) -> Option<u8> {
        let digit = self.rest.chars().next()?.to_digit(16)?;
        self.rest = &self.rest[1..];
        Some(digit as u8)
    }

    /// Takes two hex digits, if they stand here.
    pub(super) fn hex_pair(&mut self) -> Option<u8> {
        let pair = self.rest.get(..2).filter(|pair| pair.bytes().all(|c| c.is_ascii_hexdigit()))?;
        self.rest = &self.rest[2..];
        u8::from_str_radix(pair, 16).ok()
    }
}

/// A decimal number of seconds as whole µs, rounded.
pub(super) fn micros(text: &str) -> Result<i64, ImportFault> {
    const SECONDS: ImportFault = ImportFault::Expected("a time in seconds like 1.500000");
    // Beyond these a time has no meaning, and the arithmetic below no room.
    const DIGITS: usize = 24;
    const EXPONENT: i32 = 40;
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().map_err(|_| SECONDS)?),
        None => (text, 0),
    };
    let (negative, mantissa) = match mantissa.strip_prefix('-') {
        Some(mantissa) => (true, mantissa),
        None => (false, mantissa),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = || whole.bytes().chain(fraction.bytes());
    if whole.is_empty() || !digits().all(|c| c.is_ascii_digit()) {
        return Err(SECONDS);
    }
    if digits().count() > DIGITS || !(-EXPONENT..=EXPONENT).contains(&exponent) {
        return Err(ImportFault::Time);
    }
    let number = digits().fold(0_i128, |number, c| number * 10 + i128::from(c - b'0'));
    let scale = 6 + exponent - fraction.len() as i32;
    let power = |exponent: u32| 10_i128.checked_pow(exponent);
    let micros = if scale >= 0 {
        power(scale as u32).and_then(|power| number.checked_mul(power))
    } else {
        // A power beyond all numbers leaves nothing of them.
        Some(power(scale.unsigned_abs()).map_or(0, |power| (number + power / 2) / power))
    };
    micros
        .and_then(|micros| i64::try_from(micros).ok())
        .filter(|micros| *micros <= LATEST)
        .map(|micros| if negative { -micros } else { micros })
        .ok_or(ImportFault::Time)
}

/// The latest time in µs that any format may name: far from where counting ends.
pub(super) const LATEST: i64 = i64::MAX / 4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_exactly() {
        let cases = [
            ("0", 0),
            ("1.5", 1_500_000),
            ("0.0000005", 1),
            ("0.00000049", 0),
            ("-0.001", -1_000),
            ("1e-6", 1),
            ("2.5E+1", 25_000_000),
            ("1636745605.123456789", 1_636_745_605_123_457),
            ("1e-40", 0),
        ];
        for (text, time) in cases {
            assert_eq!(micros(text), Ok(time), "{text}");
        }
        for bad in ["", ".", "-", "1.5s", "1,5", "0x10", "1e", "--1", "nan", "2021-11-12T19:53:25"]
        {
            assert!(matches!(micros(bad), Err(ImportFault::Expected(_))), "{bad}");
        }
        for bad in ["1e40", "1e400", "99999999999999999999", &"9".repeat(500)] {
            assert!(micros(bad).is_err(), "{bad}");
        }
    }
}
