//! Faults in TOML files, with their place.

use serde::de::DeserializeOwned;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The longest TOML file that is read, in bytes.
const FILE_BYTES: usize = 4 << 20;
/// Characters of a message that are kept: it may quote the file.
const MESSAGE: usize = 400;

/// A fault in a file: a ledger, a baseline.
///
/// ```
/// use softplug_conformance::FileError;
/// use softplug_conformance::certify::Baseline;
/// use std::path::Path;
///
/// let text = "[[expected]]\nkase = \"xon-xoff.tx.hold\"\n";
/// let FileError { line, column, message, .. } =
///     Baseline::parse(Path::new("known.toml"), text).unwrap_err();
/// assert_eq!((line, column), (2, 1));
/// assert!(message.starts_with("unknown field `kase`"));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{}:{line}:{column}: {message}", file.display())]
pub struct FileError {
    /// The file, as it was named.
    pub file: PathBuf,
    /// From 1.
    pub line: u32,
    /// In characters, from 1.
    pub column: u32,
    /// What is wrong there and what to do.
    pub message: String,
}

impl FileError {
    /// A fault at a place of the text, given in bytes.
    pub(crate) fn at(file: &Path, text: &str, place: &Range<usize>, message: &str) -> Self {
        let before: String =
            String::from_utf8_lossy(&text.as_bytes()[..place.start.min(text.len())]).into_owned();
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        // Nothing of the file may steer a terminal.
        let printable = |c: char| if c.is_control() { ' ' } else { c };
        Self {
            file: file.to_owned(),
            line: line as u32,
            column: column as u32,
            message: message.trim_end().chars().take(MESSAGE).map(printable).collect(),
        }
    }
}

/// Reads a TOML file's text.
pub(crate) fn read_toml<T: DeserializeOwned>(file: &Path, text: &str) -> Result<T, FileError> {
    if text.len() > FILE_BYTES {
        let message = format!("the file has more than {FILE_BYTES} bytes; split it");
        return Err(FileError::at(file, "", &(0..0), &message));
    }
    toml::from_str(text).map_err(|error| {
        FileError::at(file, text, &error.span().unwrap_or_default(), error.message())
    })
}
