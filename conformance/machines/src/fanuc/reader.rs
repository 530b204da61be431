//! The tape reader: label skip, significant part, TH and TV.

use super::options::{Code, Options, TvCheck};
use super::report::AlarmKind;
use super::tape::{Meaning, Tape};

/// What a character did to the reading.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Finding {
    /// Nothing: leader, or a character without meaning.
    Skipped,
    /// It belongs to a block.
    Text(u8),
    /// It ends a block.
    Block,
    /// The closing `%`.
    End,
    /// The control complains.
    Alarm(AlarmKind),
}

/// Reads one tape from its leader to its closing `%`.
#[derive(Debug)]
pub(super) struct Reader {
    tape: Tape,
    tv: Option<TvCheck>,
    section: Section,
    /// Characters that count in the block's TV check.
    counted: u32,
    in_comment: bool,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Section {
    /// All up to the first end of block is skipped, `%` and what follows it
    /// included.
    Label,
    Significant,
    Closed,
}

impl Reader {
    pub(super) fn new(options: &Options) -> Self {
        Self {
            tape: Tape::new(options),
            tv: options.tv,
            section: Section::Label,
            counted: 0,
            in_comment: false,
        }
    }

    /// A new tape.
    pub(super) fn rewind(&mut self) {
        self.section = Section::Label;
        self.counted = 0;
        self.in_comment = false;
    }

    pub(super) fn take(&mut self, byte: u8) -> Finding {
        let meaning = self.tape.read(byte);
        match self.section {
            Section::Closed => Finding::Skipped,
            Section::Label => {
                if meaning == Meaning::EndOfBlock {
                    self.section = Section::Significant;
                }
                Finding::Skipped
            }
            Section::Significant => self.significant(meaning),
        }
    }

    fn significant(&mut self, meaning: Meaning) -> Finding {
        match meaning {
            Meaning::Text(b'%') => {
                // Also in a comment.
                self.section = Section::Closed;
                Finding::End
            }
            Meaning::Text(character) => {
                self.count_text(character);
                Finding::Text(character)
            }
            Meaning::EndOfBlock => {
                self.in_comment = false;
                let is_odd = (self.counted + 1) % 2 == 1;
                self.counted = 0;
                if self.tv.is_some() && is_odd {
                    return Finding::Alarm(AlarmKind::Tv);
                }
                Finding::Block
            }
            Meaning::Return => {
                self.counted += u32::from(self.tv.is_some_and(|tv| tv.returns));
                Finding::Skipped
            }
            // A hole in the significant part of an EIA tape is an error, and
            // nothing in ISO.
            Meaning::Blank if self.tape.code() == Code::Eia => Finding::Alarm(AlarmKind::Th),
            Meaning::Blank | Meaning::Delete => Finding::Skipped,
            Meaning::BadParity | Meaning::Stray => Finding::Alarm(AlarmKind::Th),
        }
    }

    fn count_text(&mut self, character: u8) {
        let Some(tv) = self.tv else { return };
        let opens = character == b'(';
        if !self.in_comment && !opens || tv.comments {
            self.counted += 1;
        }
        self.in_comment = (self.in_comment || opens) && character != b')';
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fanuc::options::{Parity, eight_none_two};

    fn read(options: &Options, bytes: &[u8]) -> (String, Option<Finding>) {
        let mut reader = Reader::new(options);
        let mut text = String::new();
        for byte in bytes {
            match reader.take(*byte) {
                Finding::Skipped => {}
                Finding::Text(character) => text.push(char::from(character)),
                Finding::Block => text.push('\n'),
                finding => return (text, Some(finding)),
            }
        }
        (text, None)
    }

    #[test]
    fn leader_and_label_are_skipped_and_the_closing_percent_ends() {
        let iso = Options::default();
        let tape = b"\0\0\x1B&HE:\0% lower case!\r\nO1\r\nN1\0G0\x7FX1\r\nM30%";
        assert_eq!(read(&iso, tape), ("O1\nN1G0X1\nM30".into(), Some(Finding::End)));
        let in_comment = b"%\nO1(50%)\n";
        assert_eq!(read(&iso, in_comment), ("O1(50".into(), Some(Finding::End)));
        assert_eq!(read(&iso, b"%\nO1\nM30\n"), ("O1\nM30\n".into(), None));
    }

    #[test]
    fn characters_that_the_control_does_not_know_are_alarm_001() {
        let iso = Options::default();
        for stray in b"!@$^_{}|\\;\"<>?'az\x11\x1B" {
            let tape = [b"%\nO1\nN".as_slice(), &[*stray]].concat();
            assert_eq!(read(&iso, &tape).1, Some(Finding::Alarm(AlarmKind::Th)), "{stray:#04x}");
        }
        let line = eight_none_two(9_600);
        let software = Options { line, parity: Parity::Software, ..Options::default() };
        let tape = [0xA5, 0x0A, 0xCF, 0x31];
        assert_eq!(read(&software, &tape), ("O".into(), Some(Finding::Alarm(AlarmKind::Th))));
    }

    #[test]
    fn a_blank_in_an_eia_program_is_an_alarm_and_13_is_a_digit() {
        let eia = Options { line: eight_none_two(9_600), code: Code::Eia, ..Options::default() };
        let tape = [0x00, 0x00, 0x0B, 0x80, 0x46, 0x13, 0x15, 0x7F, 0x16, 0x80, 0x0B];
        assert_eq!(read(&eia, &tape), ("O356\n".into(), Some(Finding::End)));
        let blank = [0x0B, 0x80, 0x46, 0x00];
        assert_eq!(read(&eia, &blank), ("O".into(), Some(Finding::Alarm(AlarmKind::Th))));
        let even = [0x0B, 0x80, 0x46, 0x03];
        assert_eq!(read(&eia, &even), ("O".into(), Some(Finding::Alarm(AlarmKind::Th))));
    }

    #[test]
    fn tv_counts_from_one_end_of_block_to_the_next() {
        let with = |returns, comments| Options {
            tv: Some(TvCheck { returns, comments }),
            ..Options::default()
        };
        let all = with(true, true);
        // The label's own count does not matter; O12 and its EOB are four.
        assert_eq!(read(&all, b"%\nO12\nM3 \nM30%").1, Some(Finding::End));
        assert_eq!(read(&all, b"%\nO12\nM30 \n").1, Some(Finding::Alarm(AlarmKind::Tv)));
        // CRs behind an LF belong to the next block.
        assert_eq!(read(&all, b"%\n\r\rO12\n\r\rM30\n%").1, Some(Finding::End));
        assert_eq!(read(&all, b"%\r\nO12\r\n").1, Some(Finding::Alarm(AlarmKind::Tv)));
        assert_eq!(read(&with(false, true), b"%\r\nO12\r\n%").1, Some(Finding::End));
        assert_eq!(read(&with(true, false), b"%\nO12(A)\n%").1, Some(Finding::End));
        assert_eq!(read(&all, b"%\nO12(A)\n%").1, Some(Finding::Alarm(AlarmKind::Tv)));
        // What is struck out is not there.
        assert_eq!(read(&all, b"%\nO1\x7F2\0\n%").1, Some(Finding::End));
    }
}
