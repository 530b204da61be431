//! A line of ISO code as letters with numbers.

use crate::status;

/// Letters that have one number a line.
pub(crate) const LETTERS: &[u8; 12] = b"XZUWIKRFSTMP";
/// The unit of a number, of which one is 0.0001.
pub(crate) const ONE: i64 = 10_000;
/// Numbers are smaller than this.
const LIMIT: i64 = 10_000 * ONE;
/// G codes of a line at most.
const CODES: usize = 4;

/// Why a line is refused: a status, and the column from 1.
pub(crate) type Refused = (u16, u32);

/// The words of a line.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Words {
    values: [i64; LETTERS.len()],
    /// Of each letter; 0: it is not there, or was used.
    columns: [u32; LETTERS.len()],
    codes: [(i64, u32); CODES],
    count: usize,
    /// Whether there is any word, N aside.
    pub(crate) is_block: bool,
}

impl Words {
    /// Reads a line without its end.
    pub(crate) fn read(line: &[u8]) -> Result<Self, Refused> {
        let mut words = Self::default();
        if matches!(line.first(), Some(b'%' | b'O' | b':')) {
            return Ok(words);
        }
        let mut rest = Text { line, at: 0 };
        while let Some(letter) = rest.letter()? {
            let column = rest.at as u32;
            let number = rest.number().map_err(|status| (status, column))?;
            words.put(letter, number, column)?;
        }
        Ok(words)
    }

    fn put(&mut self, letter: u8, number: i64, column: u32) -> Result<(), Refused> {
        if letter == b'N' {
            return Ok(());
        }
        self.is_block = true;
        if letter == b'G' {
            let Some(code) = self.codes.get_mut(self.count) else {
                return Err((status::CONFLICT, column));
            };
            *code = (number, column);
            self.count += 1;
            return Ok(());
        }
        let Some((value, own)) = self.of(letter) else { return Err((status::UNKNOWN, column)) };
        if *own != 0 {
            return Err((status::CONFLICT, column));
        }
        (*value, *own) = (number, column);
        Ok(())
    }

    /// Value and column of a letter.
    #[inline(never)]
    fn of(&mut self, letter: u8) -> Option<(&mut i64, &mut u32)> {
        let place = LETTERS.iter().position(|own| *own == letter)?;
        Some((self.values.get_mut(place)?, self.columns.get_mut(place)?))
    }

    /// The G codes and their columns.
    pub(crate) fn codes(&self) -> impl Iterator<Item = (i64, u32)> {
        self.codes.into_iter().take(self.count)
    }

    /// The number of a letter and its column. It then counts as used.
    #[inline(never)]
    pub(crate) fn take(&mut self, letter: u8) -> Option<(i64, u32)> {
        let (value, column) = self.of(letter)?;
        let column = core::mem::take(column);
        (column != 0).then_some((*value, column))
    }

    /// A whole number of a letter, of at most `most`. It then counts as used.
    pub(crate) fn take_whole(&mut self, letter: u8, most: i64) -> Result<Option<i64>, Refused> {
        match self.take(letter) {
            None => Ok(None),
            Some((value, _)) if value % ONE == 0 && (0..=most).contains(&(value / ONE)) => {
                Ok(Some(value / ONE))
            }
            Some((_, column)) => Err((status::OUT_OF_RANGE, column)),
        }
    }

    /// Whether the letter is there and not used.
    pub(crate) fn has(&mut self, letter: u8) -> bool {
        self.of(letter).is_some_and(|(_, column)| *column != 0)
    }

    /// Refuses what nobody has used, from the left.
    pub(crate) fn none_left(&self) -> Result<(), Refused> {
        let columns = self.columns.iter().copied().filter(|column| *column != 0);
        columns.min().map_or(Ok(()), |column| Err((status::CONFLICT, column)))
    }
}

struct Text<'a> {
    line: &'a [u8],
    /// Characters that were read.
    at: usize,
}

impl Text<'_> {
    fn next(&mut self) -> Option<u8> {
        let byte = self.line.get(self.at).copied()?;
        self.at += 1;
        Some(byte)
    }

    /// The next letter, past blanks and comments; `None`: the line is over.
    #[inline(never)]
    fn letter(&mut self) -> Result<Option<u8>, Refused> {
        while let Some(byte) = self.next() {
            match byte.to_ascii_uppercase() {
                b' ' | b'\t' => {}
                b';' => return Ok(None),
                b'(' => {
                    let column = self.at as u32;
                    while self.next().ok_or((status::UNREADABLE, column))? != b')' {}
                }
                letter @ b'A'..=b'Z' => return Ok(Some(letter)),
                _ => return Err((status::UNREADABLE, self.at as u32)),
            }
        }
        Ok(None)
    }

    /// A number of 0.0001.
    #[inline(never)]
    fn number(&mut self) -> Result<i64, u16> {
        let is_minus = self.line.get(self.at) == Some(&b'-');
        if is_minus || self.line.get(self.at) == Some(&b'+') {
            self.at += 1;
        }
        let (mut value, mut digits, mut decimals) = (0_i64, 0, None);
        while let Some(byte) = self.line.get(self.at).copied() {
            match (byte, decimals) {
                (b'0'..=b'9', _) => {
                    digits += 1;
                    decimals = decimals.map(|count| count + 1);
                    value = value * 10 + i64::from(byte - b'0');
                }
                (b'.', None) => decimals = Some(0),
                _ => break,
            }
            if value >= LIMIT || decimals > Some(4) {
                return Err(status::OUT_OF_RANGE);
            }
            self.at += 1;
        }
        if digits == 0 {
            return Err(status::UNREADABLE);
        }
        for _ in decimals.unwrap_or(0)..4 {
            value *= 10;
        }
        if value >= LIMIT {
            return Err(status::OUT_OF_RANGE);
        }
        Ok(if is_minus { -value } else { value })
    }
}
