//! `attestation.json`: what the report says of a module, signed.
//!
//! An in-toto statement with the predicate [test-result v0.1][predicate], in a
//! [DSSE] envelope, signed with Ed25519. The module's SHA-256 is its subject, and the
//! report's own SHA-256 stands in it: the report itself stays a file that can be read.
//!
//! [predicate]: https://github.com/in-toto/attestation/blob/main/spec/predicates/test-result.md
//! [DSSE]: https://github.com/secure-systems-lab/dsse

mod envelope;
mod key;
mod statement;

pub use self::key::{KeyError, PrivateKey, PublicKey};
pub use self::statement::{PREDICATE, STATEMENT};

use self::envelope::Envelope;
use self::statement::Statement;
use crate::{Inconsistency, Report, check, json, text};
use std::path::{Path, PathBuf};

/// Bytes that an attestation may have.
///
/// The example of [`VerifyError`] shows it.
pub const LARGEST: usize = 16 << 20;

/// A file's name, for errors, and its content.
///
/// The example of [`sign`] shows two.
#[derive(Copy, Clone, Debug)]
pub struct Source<'a> {
    /// The file.
    pub file: &'a Path,
    /// What is in it.
    pub text: &'a str,
}

/// The signed statement on a report, to be kept beside the report as
/// [`json::write`] gives it. The same report and key give the same bytes.
///
/// Any verdict can be signed; only a conformant plug-in's result is `PASSED`. A report
/// that contradicts itself is not signed.
///
/// ```
/// use softplug_report::attest::{self, PrivateKey, Source};
/// use softplug_report::json;
/// use std::path::Path;
///
/// let pem = std::fs::read_to_string("tests/keys/private.pem")?;
/// let key = PrivateKey::read(Path::new("private.pem"), &pem)?;
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let report = Source { file: Path::new("conformance.json"), text: &text };
/// let envelope = attest::sign(&json::read(report.file, report.text)?, &key)?;
///
/// let envelope = Source { file: Path::new("attestation.json"), text: &envelope };
/// let judged = attest::verify(envelope, report, &key.public())?;
/// assert!(judged.verdict.is_conformant());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The report contradicts itself.
pub fn sign(report: &Report, key: &PrivateKey) -> Result<String, Inconsistency> {
    check(report)?;
    let statement = Statement::of(report, &json::write(report));
    Ok(Envelope::sign(&statement.write(), key).write())
}

/// Holds an attestation against the report that it was made of, and against the key of
/// whom it is trusted to come from; gives the report.
///
/// That the report is true is another matter: running the suite again shows that.
///
/// The example of [`sign`] shows it.
///
/// # Errors
/// The attestation is damaged, signed with another key, or about another report; or the
/// report cannot be taken.
pub fn verify(
    envelope: Source<'_>,
    report: Source<'_>,
    key: &PublicKey,
) -> Result<Report, VerifyError> {
    let file = || envelope.file.to_owned();
    let payload = Envelope::read(envelope)?.open(envelope.file, key)?;
    let said = Statement::read(&payload)
        .map_err(|error| text::line(&error.to_string()))
        .map_err(|message| VerifyError::Statement { file: file(), message })?;
    let judged = json::read(report.file, report.text)?;
    let expected = Statement::of(&judged, report.text);
    said.must_equal(&expected, envelope.file, report.file)?;
    Ok(judged)
}

/// Why an attestation does not hold.
///
/// ```
/// use softplug_report::attest::{LARGEST, PublicKey, Source, VerifyError, verify};
/// use std::path::Path;
///
/// let pem = std::fs::read_to_string("tests/keys/public.pem")?;
/// let key = PublicKey::read(Path::new("public.pem"), &pem)?;
/// let report = Source { file: Path::new("conformance.json"), text: "{}" };
/// let refused = |text: &str| {
///     verify(Source { file: Path::new("attestation.json"), text }, report, &key).unwrap_err()
/// };
/// let error = refused("{\n}");
/// assert!(matches!(error, VerifyError::Malformed { line: 2, .. }));
/// assert!(error.to_string().starts_with("attestation.json:2:"));
/// assert!(matches!(refused(&" ".repeat(LARGEST + 1)), VerifyError::TooLarge { .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// It is larger than [`LARGEST`].
    #[error("{}: an attestation has at most {} MiB", .file.display(), LARGEST >> 20)]
    TooLarge {
        /// The attestation.
        file: PathBuf,
    },
    /// It is no JSON, or no envelope.
    #[error("{}:{line}:{column}: {message}", .file.display())]
    Malformed {
        /// The attestation.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 1, in bytes.
        column: usize,
        /// What is wrong there.
        message: String,
    },
    /// The envelope holds something else than a statement.
    #[error(
        "{}: payloadType is {}, and that of an attestation is \"{}\"",
        .file.display(), text::quoted(.found), envelope::PAYLOAD
    )]
    PayloadType {
        /// The attestation.
        file: PathBuf,
        /// What it names.
        found: String,
    },
    /// A text that must be base64 is not.
    #[error("{}: {field} is no base64: the file is damaged", .file.display())]
    Base64 {
        /// The attestation.
        file: PathBuf,
        /// `payload` or `sig`.
        field: &'static str,
    },
    /// There is no signature by this key.
    #[error(
        "{}: is not signed with the key {expected}, but with {}",
        .file.display(), envelope::listed(.found)
    )]
    OtherKey {
        /// The attestation.
        file: PathBuf,
        /// Id of the key that was given.
        expected: String,
        /// Ids of the keys that it names.
        found: Vec<String>,
    },
    /// The signature does not fit key and payload.
    #[error(
        "{}: the signature does not fit: payload or signature were changed after signing, or \
         another key made it", .file.display()
    )]
    Signature {
        /// The attestation.
        file: PathBuf,
    },
    /// What was signed is no statement on a test result.
    #[error("{}: the signed statement is not one that softplug makes: {message}", .file.display())]
    Statement {
        /// The attestation.
        file: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// The statement is about another module than the report.
    #[error(
        "{}: the statement is about the module {found}, and {} about {expected}",
        .file.display(), .report.display()
    )]
    Subject {
        /// The attestation.
        file: PathBuf,
        /// The report.
        report: PathBuf,
        /// Name and digest of the statement's subject.
        found: String,
        /// Those of the report's plug-in.
        expected: String,
    },
    /// The report is not the one that was signed.
    #[error(
        "{}: the statement was made of a report with SHA-256 {}, and {} has {expected}: the report \
         was changed, or is another one", .file.display(), text::quoted(.found), .report.display()
    )]
    ReportDigest {
        /// The attestation.
        file: PathBuf,
        /// The report.
        report: PathBuf,
        /// What the statement says.
        found: String,
        /// The report's digest.
        expected: String,
    },
    /// The result does not follow from the report.
    #[error(
        "{}: the result is {}, but from {} follows {expected}",
        .file.display(), text::quoted(.found), .report.display()
    )]
    Result {
        /// The attestation.
        file: PathBuf,
        /// The report.
        report: PathBuf,
        /// What the statement says.
        found: String,
        /// What follows from the report.
        expected: String,
    },
    /// Another field does not follow from the report.
    #[error("{}: {field} does not follow from {}", .file.display(), .report.display())]
    Field {
        /// The attestation.
        file: PathBuf,
        /// The report.
        report: PathBuf,
        /// The field of the statement.
        field: &'static str,
    },
    /// The report cannot be taken.
    #[error(transparent)]
    Report(#[from] json::ReadError),
}
