//! What is wrong in `unit.toml`, where, and what to do.

use std::error::Error;
use std::ops::Range;

use softplug_live::place::line_and_column;
use softplug_live::{guess, plain_text};

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
        let sentence = match (guess::of_parser(message), message.rsplit_once(", expected ")) {
            (Some(hint), Some((what, _))) => format!("{what}; {hint}"),
            (Some(hint), None) => format!("{message}; {hint}"),
            (None, _) => message.to_owned(),
        };
        Self { span: error.span().unwrap_or(0..0), sentence: plain_text(&sentence) }
    }

    /// A sentence about this place.
    pub(crate) fn at<E: Error>(span: Range<usize>) -> impl FnOnce(E) -> Self {
        move |error| Self { span, sentence: error.to_string() }
    }

    /// Line, and column in characters, both from 1.
    pub(crate) fn place(&self, text: &str) -> (usize, usize) {
        line_and_column(text, self.span.start)
    }
}
