//! What is wrong in `unit.toml`, where, and what to do.

use std::ops::Range;

use softplug_gateway::guess::nearest;
use softplug_gateway::plain_text;

/// What is wrong, and where.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Mistake {
    /// In bytes of the file; its begin where no place of it is to blame.
    span: Range<usize>,
    /// What it is and what to do, in one line.
    pub(crate) sentence: String,
}

impl Mistake {
    /// What the parser found.
    pub(crate) fn of(error: &toml::de::Error) -> Self {
        let message = error.message().lines().next().unwrap_or_default();
        let sentence = match (hint(message), message.rsplit_once(", expected ")) {
            (Some(hint), Some((what, _))) => format!("{what}; {hint}"),
            (Some(hint), None) => format!("{message}; {hint}"),
            (None, _) => message.to_owned(),
        };
        Self { span: error.span().unwrap_or(0..0), sentence: plain_text(&sentence) }
    }

    /// A sentence about this place.
    pub(crate) fn at(span: Range<usize>) -> impl FnOnce(String) -> Self {
        move |sentence| Self { span, sentence }
    }

    /// Line, and column in characters, both from 1.
    pub(crate) fn place(&self, text: &str) -> (usize, usize) {
        let before = &text[..text.floor_char_boundary(self.span.start)];
        let begin = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[begin..].chars().count() + 1)
    }
}

impl From<String> for Mistake {
    fn from(sentence: String) -> Self {
        Self { span: 0..0, sentence }
    }
}

/// What to do about what the parser says; `None` where that says it itself.
fn hint(message: &str) -> Option<String> {
    let mut names = message.split('`').skip(1).step_by(2);
    if message.starts_with("unknown field") {
        let name = names.next().unwrap_or_default();
        let known: Vec<&str> = names.collect();
        return Some(match nearest(name, known.iter().copied()) {
            Some(meant) => format!("did you mean `{meant}`?"),
            None => format!("known here: {}", known.join(", ")),
        });
    }
    if message.starts_with("missing field") {
        let name = names.next().unwrap_or_default();
        return Some(format!("add a line `{name} = …` to this table"));
    }
    if message.starts_with("duplicate key") {
        return Some("keep one of the two".to_owned());
    }
    if let Some((_, expected)) = message.rsplit_once("expected ") {
        return Some(format!("write {expected} here"));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_told_with_what_was_meant() {
        let told = |message| hint(message).unwrap_or_default();
        assert_eq!(
            told("unknown field `lisen`, expected `listen` or `can`"),
            "did you mean `listen`?"
        );
        assert_eq!(told("missing field `port`"), "add a line `port = …` to this table");
        assert_eq!(told("invalid type: integer `7`, expected a string"), "write a string here");
        assert_eq!(told("write a number of bytes"), "");
    }

    #[test]
    fn places_count_lines_and_characters() {
        let text = "a = 1\nüb = 2\n";
        let place = |at: usize| Mistake::at(at..at)(String::new()).place(text);
        assert_eq!((place(0), place(12), place(99)), ((1, 1), (2, 6), (3, 1)));
    }
}
