//! `conformance.json`: the report as it is kept. Its shape is in
//! `docs/report/conformance-1.schema.json`.

use crate::{Inconsistency, Report, SCHEMA, check, text};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Bytes that a report may have.
///
/// The example of [`ReadError`] shows it.
pub const LARGEST: usize = 64 << 20;

/// The report as JSON: indented, its keys in a fixed order, a line end at its end.
///
/// ```
/// use softplug_report::json;
///
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// assert_eq!(json::write(&report), text);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(report: &Report) -> String {
    let mut text = serde_json::to_string_pretty(report)
        .expect("a report has only names as keys, and no numbers that JSON lacks");
    text.push('\n');
    text
}

/// Reads a report that anyone may have written: it must have the exact shape, and
/// follow from its own rows. `file` is for errors only.
///
/// ```
/// use softplug_report::json;
///
/// let error = json::read(std::path::Path::new("a.json"), "{\n  \"schema\": x").unwrap_err();
/// assert!(error.to_string().starts_with("a.json:2:13: "), "{error}");
/// ```
///
/// # Errors
/// It is too large, of another schema or shape, or contradicts itself.
pub fn read(file: &Path, text: &str) -> Result<Report, ReadError> {
    if text.len() > LARGEST {
        return Err(ReadError::TooLarge { file: file.to_owned() });
    }
    let report: Report = serde_json::from_str(text).map_err(|error| refusal(file, text, &error))?;
    check(&report).map_err(|source| ReadError::Inconsistent { file: file.to_owned(), source })?;
    Ok(report)
}

/// Why a report cannot be taken.
///
/// ```
/// use softplug_report::json::{LARGEST, ReadError, read};
/// use std::path::Path;
///
/// let file = Path::new("conformance.json");
/// let newer = read(file, "{\"schema\": 2}").unwrap_err();
/// assert!(matches!(newer, ReadError::OtherSchema { schema: 2, .. }));
/// let large = read(file, &" ".repeat(LARGEST + 1)).unwrap_err();
/// assert_eq!(large.to_string(), "conformance.json: a report has at most 64 MiB");
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ReadError {
    /// It is larger than [`LARGEST`].
    #[error("{}: a report has at most {} MiB", .file.display(), LARGEST >> 20)]
    TooLarge {
        /// The file.
        file: PathBuf,
    },
    /// It has another shape than this version knows.
    #[error(
        "{}: is a report of schema {schema}, and this version reads {SCHEMA}: take the softplug \
         that wrote it, or a newer one", .file.display()
    )]
    OtherSchema {
        /// The file.
        file: PathBuf,
        /// Its schema.
        schema: u32,
    },
    /// It is no JSON, or not of a report's shape.
    #[error("{}:{line}:{column}: {message}", .file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 1, in bytes.
        column: usize,
        /// What is wrong there.
        message: String,
    },
    /// It contradicts itself.
    #[error("{}: the report contradicts itself: {source}", .file.display())]
    Inconsistent {
        /// The file.
        file: PathBuf,
        /// Where, and how.
        source: Inconsistency,
    },
}

fn refusal(file: &Path, text: &str, error: &serde_json::Error) -> ReadError {
    /// What reports of all versions have in common.
    #[derive(Deserialize)]
    struct Versioned {
        schema: u32,
    }
    let file = file.to_owned();
    match serde_json::from_str(text) {
        Ok(Versioned { schema }) if schema != SCHEMA => ReadError::OtherSchema { file, schema },
        _ => {
            let (line, column, message) = text::json_error(error);
            ReadError::Malformed { file, line, column, message }
        }
    }
}
