//! Requests from the control's panel: a punched program of a certain number,
//! whose comment names the program that is wanted.

use crate::Settings;
use crate::punch::Title;
use crate::short::trimmed;
use softplug_plugin::{Context, Failure, NoteLevel, RequestId, Value, ValueWriter, Values};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The most requests that may be unanswered.
const MOST_OPEN: u8 = 4;
/// Room for the two fields of a request.
const FIELDS: usize = 160;
/// The most digits of a number behind zeros.
const DIGITS: usize = 18;

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Requests {
    last: u32,
    open: u8,
    spare: [u8; 3],
}

impl Requests {
    /// Asks for the program that a good capture names, if it is a request.
    pub(crate) fn look(&mut self, link: &mut Context<'_>, settings: &Settings, title: &Title) {
        let digits = title.number().and_then(|number| number.get(1..));
        if digits.and_then(number) != Some(settings.request_program) {
            return;
        }
        let Some(name) = wanted(settings, title.asking()) else { return };
        if self.open == MOST_OPEN {
            link.note(NoteLevel::Warning, 0, "too many requests");
            return;
        }
        let mut buffer = [0; FIELDS];
        let mut fields = ValueWriter::new(&mut buffer);
        // Both fit: a comment has at most 128 bytes.
        let _ = fields.push_ascii(0, name);
        if let Some(number) = number(name) {
            let _ = fields.push(1, Value::Int(number));
        }
        self.open += 1;
        self.last = self.last.wrapping_add(1).max(1);
        link.request(RequestId(self.last), 0, Values::new(fields.written()));
    }

    /// The host's answer: it sends the program by a job of its own, or will not.
    pub(crate) fn answered(
        &mut self,
        link: &mut Context<'_>,
        refused: Option<Failure>,
        more: bool,
    ) {
        if more {
            return;
        }
        self.open = self.open.saturating_sub(1);
        if let Some(failure) = refused {
            link.note(NoteLevel::Warning, failure.code(), "request refused");
        }
    }
}

/// The name of the program that a comment asks for.
pub(crate) fn wanted<'a>(settings: &Settings, comment: &'a [u8]) -> Option<&'a [u8]> {
    matched(settings.request_pattern.as_bytes(), comment)
}

/// What the `*` of a pattern stands for in a text that fits it, without the
/// spaces around it; it must be something. An empty pattern fits nothing.
fn matched<'a>(mut pattern: &[u8], mut text: &'a [u8]) -> Option<&'a [u8]> {
    while let Some((own, rest)) = pattern.split_first() {
        if *own == b'*' {
            break;
        }
        (pattern, text) = (rest, text.split_first().filter(|(first, _)| *first == own)?.1);
    }
    while let Some((own, rest)) = pattern.split_last() {
        if *own == b'*' {
            let name = trimmed(text);
            return (!name.is_empty()).then_some(name);
        }
        (pattern, text) = (rest, text.split_last().filter(|(last, _)| *last == own)?.1);
    }
    None
}

/// The number that a text of digits alone stands for.
#[inline(never)]
fn number(text: &[u8]) -> Option<i64> {
    let zeros = text.iter().take_while(|digit| **digit == b'0').count();
    if text.is_empty() || text.len() - zeros > DIGITS {
        return None;
    }
    text.iter().try_fold(0, |number: i64, digit| {
        let digit = digit.wrapping_sub(b'0');
        (digit < 10).then(|| number * 10 + i64::from(digit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns() {
        let fit = |pattern: &str, text: &'static str| {
            matched(pattern.as_bytes(), text.as_bytes())
                .map(|name| String::from_utf8_lossy(name).into_owned())
        };
        assert_eq!(fit("(SEND *)", "(SEND 1234)").as_deref(), Some("1234"));
        assert_eq!(fit("(SEND *)", "(SEND  HOUSING 2 )").as_deref(), Some("HOUSING 2"));
        assert_eq!(fit("(SEND *)", "(SEND )"), None);
        assert_eq!(fit("(SEND *)", "(SEND)"), None);
        assert_eq!(fit("(SEND *)", "(LOAD 1)"), None);
        assert_eq!(fit("(SEND *)", "(SEND 1"), None);
        assert_eq!(fit("*", "(A)").as_deref(), Some("(A)"));
        assert_eq!(fit("(A*A)", "(A)"), None, "the two parts do not overlap");
        assert_eq!(fit("", ""), None);
        assert_eq!(fit("(SEND)", "(SEND)"), None, "it names nothing");
    }

    #[test]
    fn numbers() {
        assert_eq!(number(b"0012"), Some(12));
        assert_eq!(number(b"999999999999999999"), Some(999_999_999_999_999_999));
        assert_eq!(number(b"1000000000000000000"), None);
        assert_eq!(number(b"00000000000000000000009999"), Some(9_999));
        assert_eq!(number(b""), None);
        assert_eq!(number(b"12A"), None);
        assert_eq!(number(b"-1"), None);
    }
}
