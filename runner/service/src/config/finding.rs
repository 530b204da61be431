//! What is wrong with a configuration: each problem with its place and a hint.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Serialize;
use softplug_live::guess;
use softplug_live::place::line_and_column;
use thiserror::Error;

/// A place in a file.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// One thing that a configuration cannot have, or should not.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ConfigFinding {
    /// Where.
    #[serde(flatten)]
    pub place: Place,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub hint: String,
}

impl fmt::Display for ConfigFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}", self.place, self.message, self.hint)
    }
}

/// Why there is no configuration.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{} cannot be read: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// A file that had links has nothing in it any more.
    #[error("{} is empty, as if it could not be written: write it again", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// It can be read, and says what cannot be done.
    #[error("{}", list(.0))]
    Wrong(Vec<ConfigFinding>),
}

fn list(problems: &[ConfigFinding]) -> String {
    let lines: Vec<_> = problems.iter().map(ConfigFinding::to_string).collect();
    lines.join("\n")
}

/// Collects problems of one file.
#[derive(Debug)]
pub(super) struct ConfigFindings<'a> {
    file: &'a Path,
    text: &'a str,
    found: Vec<ConfigFinding>,
}

impl<'a> ConfigFindings<'a> {
    pub(super) fn new(file: &'a Path, text: &'a str) -> Self {
        Self { file, text, found: Vec::new() }
    }

    pub(super) fn place(&self, span: Range<usize>) -> Place {
        let (line, column) = line_and_column(self.text, span.start);
        Place { file: self.file.to_owned(), line, column }
    }

    pub(super) fn add(
        &mut self,
        span: Range<usize>,
        message: impl fmt::Display,
        hint: impl fmt::Display,
    ) {
        let place = self.place(span);
        self.found.push(ConfigFinding {
            place,
            message: message.to_string(),
            hint: hint.to_string(),
        });
    }

    /// What the parser found.
    pub(super) fn syntax(&mut self, error: &toml::de::Error) {
        let message = error.message().lines().next().unwrap_or_default();
        let hint = guess::of_parser(message);
        let hint = hint.as_deref().unwrap_or("see docs/gateway/config.md for what may stand here");
        self.add(error.span().unwrap_or(0..0), message, hint);
    }

    /// In the order of their places.
    pub(super) fn end(mut self) -> Result<(), ConfigError> {
        if self.found.is_empty() {
            return Ok(());
        }
        self.found.sort_by_key(|problem| (problem.place.line, problem.place.column));
        // What the defaults have wrong is found at each link.
        self.found.dedup();
        Err(ConfigError::Wrong(self.found))
    }
}
