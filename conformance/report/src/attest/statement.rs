//! The in-toto statement: what follows from a report, in the words of others.

use super::VerifyError;
use crate::{Outcome, Report, VerdictKind, text};
use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// The type of the statement.
///
/// ```
/// use base64::Engine;
/// use base64::prelude::BASE64_STANDARD;
/// use serde_json::Value;
/// use softplug_report::attest::{PREDICATE, PrivateKey, STATEMENT, sign};
/// use softplug_report::json;
/// use std::path::Path;
///
/// let pem = std::fs::read_to_string("tests/keys/private.pem")?;
/// let key = PrivateKey::read(Path::new("private.pem"), &pem)?;
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let envelope = sign(&json::read(Path::new("conformance.json"), &text)?, &key)?;
/// // As other tools take it apart.
/// let envelope: Value = serde_json::from_str(&envelope)?;
/// let payload = BASE64_STANDARD.decode(envelope["payload"].as_str().unwrap_or_default())?;
/// let statement: Value = serde_json::from_slice(&payload)?;
/// assert_eq!((&statement["_type"], &statement["predicateType"]), (&STATEMENT.into(), &PREDICATE.into()));
/// assert_eq!(statement["predicate"]["result"], "PASSED");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const STATEMENT: &str = "https://in-toto.io/Statement/v1";
/// The type of its predicate.
///
/// The example of [`STATEMENT`] shows it.
pub const PREDICATE: &str = "https://in-toto.io/attestation/test-result/v0.1";

#[derive(PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Statement {
    #[serde(rename = "_type")]
    kind: String,
    subject: Vec<Descriptor>,
    #[serde(rename = "predicateType")]
    predicate_type: String,
    predicate: Predicate,
}

#[derive(PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Predicate {
    result: String,
    configuration: Vec<Descriptor>,
    passed_tests: Vec<String>,
    warned_tests: Vec<String>,
    failed_tests: Vec<String>,
}

#[derive(PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Descriptor {
    name: String,
    digest: Digests,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    media_type: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    annotations: Option<Annotations>,
}

#[derive(PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Digests {
    sha256: String,
}

/// What the suite was asked for, beside its corpus.
#[derive(PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Annotations {
    suite: String,
    profile: String,
    revision: u32,
    features: Vec<String>,
    strict: bool,
}

impl Statement {
    /// What follows from a report and its text.
    pub(super) fn of(report: &Report, text: &str) -> Self {
        let name = &report.plugin.name;
        let subject = if name.is_empty() { "plug-in" } else { name };
        let tests = |wanted: &[Outcome]| {
            let cases = report.cases.iter().filter(|case| wanted.contains(&report.outcome(case)));
            cases.map(|case| case.id.clone()).collect()
        };
        Self {
            kind: STATEMENT.to_owned(),
            subject: vec![Descriptor::new(subject, &report.plugin.sha256)],
            predicate_type: PREDICATE.to_owned(),
            predicate: Predicate {
                result: result(report.verdict).to_owned(),
                configuration: configuration(report, text),
                passed_tests: tests(&[Outcome::Passed]),
                warned_tests: tests(&[Outcome::Warned]),
                // The baseline excuses a failure, but does not undo it.
                failed_tests: tests(&[Outcome::Failed, Outcome::ExpectedFailure]),
            },
        }
    }

    pub(super) fn write(&self) -> String {
        serde_json::to_string(self).expect("a statement is texts, numbers and lists of them")
    }

    pub(super) fn read(payload: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(payload)
    }

    /// Names the first thing in which it does not follow from the report.
    pub(super) fn must_equal(
        &self,
        expected: &Self,
        file: &Path,
        report: &Path,
    ) -> Result<(), VerifyError> {
        let (file, report) = (file.to_owned(), report.to_owned());
        for (said, expected, what) in [
            (&self.kind, &expected.kind, "_type"),
            (&self.predicate_type, &expected.predicate_type, "predicateType"),
        ] {
            if said != expected {
                let message = format!("{what} is {}, and not {expected}", text::quoted(said));
                return Err(VerifyError::Statement { file, message });
            }
        }
        if self.subject != expected.subject {
            let (found, expected) = (listed(&self.subject), listed(&expected.subject));
            return Err(VerifyError::Subject { file, report, found, expected });
        }
        let (said, expected) = (&self.predicate, &expected.predicate);
        let digest = |predicate: &Predicate| {
            predicate
                .configuration
                .first()
                .map_or_else(String::new, |first| first.digest.sha256.clone())
        };
        if digest(said) != digest(expected) {
            let (found, expected) = (digest(said), digest(expected));
            return Err(VerifyError::ReportDigest { file, report, found, expected });
        }
        if said.result != expected.result {
            let (found, expected) = (said.result.clone(), expected.result.clone());
            return Err(VerifyError::Result { file, report, found, expected });
        }
        let fields = [
            ("configuration", said.configuration == expected.configuration),
            ("passedTests", said.passed_tests == expected.passed_tests),
            ("warnedTests", said.warned_tests == expected.warned_tests),
            ("failedTests", said.failed_tests == expected.failed_tests),
        ];
        match fields.into_iter().find(|(_, is_equal)| !is_equal) {
            Some((field, _)) => Err(VerifyError::Field { file, report, field }),
            None => Ok(()),
        }
    }
}

/// Whatever is not wholly conformant is not passed.
const fn result(verdict: VerdictKind) -> &'static str {
    match verdict {
        VerdictKind::Conformant => "PASSED",
        VerdictKind::ConformantWithWarnings => "WARNED",
        VerdictKind::Partial | VerdictKind::NotConformant | VerdictKind::NotJudged => "FAILED",
    }
}

/// The report first: it has all the rest.
fn configuration(report: &Report, text: &str) -> Vec<Descriptor> {
    let (suite, profile) = (&report.suite, &report.profile);
    let mut configuration = vec![
        Descriptor {
            media_type: Some("application/json".to_owned()),
            ..Descriptor::new("conformance.json", &HEXLOWER.encode(&Sha256::digest(text)))
        },
        Descriptor {
            annotations: Some(Annotations {
                suite: format!("{} {}", suite.name, suite.version),
                profile: profile.name.clone(),
                revision: profile.revision,
                features: profile.features.clone(),
                strict: report.selection.strict,
            }),
            ..Descriptor::new("corpus", &suite.corpus)
        },
    ];
    if let Some(baseline) = &report.selection.baseline {
        configuration.push(Descriptor::new("baseline", baseline));
    }
    configuration
}

impl Descriptor {
    fn new(name: &str, sha256: &str) -> Self {
        Self {
            name: name.to_owned(),
            digest: Digests { sha256: sha256.to_owned() },
            media_type: None,
            annotations: None,
        }
    }
}

/// Name and digest of each.
fn listed(descriptors: &[Descriptor]) -> String {
    let names =
        descriptors.iter().map(|one| text::line(&format!("{} {}", one.name, one.digest.sha256)));
    names.collect::<Vec<_>>().join(", ")
}
