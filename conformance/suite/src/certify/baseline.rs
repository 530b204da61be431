//! Baselines: failures that are known and expected. Each entry must fail, for its reason.

use crate::given::file_error::{FileError, read_toml};
use crate::given::read::read_text;
use crate::run::class::Class;
use data_encoding::HEXLOWER;
use serde::Deserialize;
use sha2::{Digest as _, Sha256};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Largest file.
const MOST_BYTES: u64 = 16 << 20;

/// Failures that are expected.
///
/// The example of [`Baseline::parse`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Baseline {
    /// In the order of the file.
    pub expected: Vec<Expected>,
    /// SHA-256 of the file, as 64 hex digits.
    pub digest: String,
}

/// A failure that is expected.
///
/// The example of [`Baseline::parse`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Expected {
    /// The case.
    pub case: String,
    /// Its kind.
    pub class: Class,
    /// Why it is accepted; an entry without a reason is stale.
    pub reason: String,
}

/// A baseline that cannot be read.
///
/// ```
/// use softplug_conformance::certify::{Baseline, BaselineError};
/// use std::path::Path;
///
/// let error = Baseline::read(Path::new("none.toml")).unwrap_err();
/// assert!(matches!(error, BaselineError::Io { .. }));
/// assert!(error.to_string().starts_with("cannot read none.toml: "));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The system does not give it.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// It is damaged.
    #[error(transparent)]
    File(#[from] FileError),
}

impl Baseline {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or is damaged: then with its line and column.
    pub fn read(path: &Path) -> Result<Self, BaselineError> {
        let io = |source| BaselineError::Io { path: path.to_owned(), source };
        Ok(Self::parse(path, &read_text(path, MOST_BYTES).map_err(io)?)?)
    }

    /// Reads its text. `file` stands in errors.
    ///
    /// ```
    /// use softplug_conformance::certify::Baseline;
    /// use std::path::Path;
    ///
    /// let text = r#"
    /// [[expected]]
    /// case = "xon-xoff.tx.hold"
    /// class = "diverged"
    /// reason = "The machine sends XON twice."
    /// "#;
    /// let baseline = Baseline::parse(Path::new("known.toml"), text)?;
    /// assert_eq!(baseline.expected[0].case, "xon-xoff.tx.hold");
    /// # Ok::<(), softplug_conformance::FileError>(())
    /// ```
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn parse(file: &Path, text: &str) -> Result<Self, FileError> {
        let raw: Raw = read_toml(file, text)?;
        let mut seen = BTreeSet::new();
        let mut expected = Vec::new();
        for RawExpected { case, class, reason } in raw.expected {
            let fault = |place, message: String| FileError::at(file, text, &place, &message);
            if !seen.insert(case.get_ref().clone()) {
                let message = format!("\"{}\" stands here twice; keep one", case.get_ref());
                return Err(fault(case.span(), message));
            }
            let known = Class::from_name(class.get_ref()).ok_or_else(|| {
                let names: Vec<_> = Class::all().map(Class::name).collect();
                let message = format!(
                    "there is no failure \"{}\"; there are {}",
                    class.get_ref(),
                    names.join(", ")
                );
                fault(class.span(), message)
            })?;
            expected.push(Expected { case: case.into_inner(), class: known, reason });
        }
        Ok(Self { expected, digest: HEXLOWER.encode(&Sha256::digest(text)) })
    }

    /// The entry of a case.
    pub(super) fn of(&self, case: &str) -> Option<&Expected> {
        self.expected.iter().find(|expected| expected.case == case)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(default)]
    expected: Vec<RawExpected>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawExpected {
    case: Spanned<String>,
    class: Spanned<String>,
    #[serde(default)]
    reason: String,
}
