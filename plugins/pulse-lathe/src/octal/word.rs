//! Words of four octal digits in a text.

use softplug_plugin::{StateReader, StateWriter};

/// What a character brings.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Read {
    Nothing,
    Word(u16),
    /// This is no word.
    Bad,
}

/// Reads words, character by character.
#[derive(Copy, Clone, Debug)]
pub(crate) struct WordReader {
    line: u32,
    column: u32,
    /// Where the word began that was read last, or is being read.
    pub(crate) word_line: u32,
    pub(crate) word_column: u32,
    digits: u8,
    value: u16,
    in_comment: bool,
}

impl Default for WordReader {
    fn default() -> Self {
        Self {
            line: 1,
            column: 0,
            word_line: 1,
            word_column: 1,
            digits: 0,
            value: 0,
            in_comment: false,
        }
    }
}

impl WordReader {
    pub(crate) fn character(&mut self, byte: u8) -> Read {
        self.column += 1;
        let read = if self.in_comment {
            self.in_comment = byte != b')';
            Read::Nothing
        } else {
            self.outside(byte)
        };
        if byte == b'\n' {
            self.line += 1;
            self.column = 0;
        }
        read
    }

    fn outside(&mut self, byte: u8) -> Read {
        match byte {
            b'0'..=b'7' if self.digits < 4 => {
                if self.digits == 0 {
                    self.begin();
                }
                self.digits += 1;
                self.value = self.value << 3 | u16::from(byte - b'0');
                Read::Nothing
            }
            b' ' | b'\t' | b'\r' | b'\n' | b';' | b',' | b'%' => self.end(),
            b'(' => {
                self.in_comment = true;
                if self.digits == 0 {
                    self.begin();
                }
                self.end()
            }
            _ => {
                if self.digits == 0 {
                    self.begin();
                }
                Read::Bad
            }
        }
    }

    fn begin(&mut self) {
        (self.word_line, self.word_column) = (self.line, self.column);
        self.value = 0;
    }

    /// What stands there so far is over.
    pub(crate) fn end(&mut self) -> Read {
        match core::mem::take(&mut self.digits) {
            0 => Read::Nothing,
            4 => Read::Word(self.value),
            _ => Read::Bad,
        }
    }

    /// Whether a comment has not ended.
    pub(crate) fn is_in_comment(&self) -> bool {
        self.in_comment
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        for value in [self.line, self.column, self.word_line, self.word_column] {
            state.u32(value);
        }
        state.u8(self.digits);
        state.u16(self.value);
        state.bool(self.in_comment);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        Self {
            line: state.u32(),
            column: state.u32(),
            word_line: state.u32(),
            word_column: state.u32(),
            digits: state.u8(),
            value: state.u16(),
            in_comment: state.bool(),
        }
    }
}
