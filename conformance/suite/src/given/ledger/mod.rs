//! Requirement ledgers: what a profile demands, one row a clause.
//!
//! ```
//! use softplug_conformance::ledger::Ledger;
//! use std::path::Path;
//!
//! let text = r#"
//! profile = "echo"
//! revision = 1
//! title = "What comes is sent back"
//!
//! [[clause]]
//! id = "echo.tx.at-once"
//! level = "must"
//! sentence = "Every byte is sent back at once"
//! sha256 = "9c8e10d29bfb0437"
//! since = 1
//! "#;
//! let ledger = Ledger::parse(Path::new("echo.toml"), text)?;
//! assert!(ledger.clause("echo.tx.at-once").is_some());
//!
//! let error = Ledger::parse(Path::new("echo.toml"), &text.replace("must", "can")).unwrap_err();
//! assert_eq!((error.line, error.column), (8, 9));
//! # Ok::<(), softplug_conformance::ledger::LedgerError>(())
//! ```

mod hashes;

pub use super::file_error::FileError as LedgerError;
pub use hashes::{Hashed, hashed};

use super::file_error::read_toml;
use serde::Deserialize;
use sha2::{Digest as _, Sha256};
use softplug_abi::manifest::ValueType;
use softplug_report::Level;
use softplug_trace::is_slug;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use toml::Spanned;

/// What a profile demands.
///
/// ```
/// use softplug_conformance::ledger::Ledger;
/// use std::path::Path;
///
/// let text = r#"
/// profile = "echo"
/// revision = 1
/// title = "What comes is sent back"
///
/// [[feature]]
/// name = "upper-case"
/// text = "Letters are sent back in upper case"
///
/// [[setting]]
/// name = "upper_case"
/// type = "bool"
/// off = "off"
///
/// [[clause]]
/// id = "echo.tx.upper-case"
/// level = "must"
/// feature = "upper-case"
/// sentence = "Every letter is sent back in upper case"
/// sha256 = "16a1e2a4ae5f1d02"
/// since = 1
/// "#;
/// let ledger = Ledger::parse(Path::new("echo.toml"), text)?;
/// assert_eq!(ledger.features[0].name, "upper-case");
/// assert_eq!(ledger.settings[0].off.as_deref(), Some("off"));
/// let clause = ledger.clause("echo.tx.upper-case").expect("it stands there");
/// assert_eq!(clause.feature.as_deref(), Some("upper-case"));
/// assert_eq!(ledger.features_of(&[clause.id.clone()]), ["upper-case"].into());
/// # Ok::<(), softplug_conformance::ledger::LedgerError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ledger {
    /// The profile.
    pub profile: String,
    /// The newest revision, from 1. What a revision demands never changes.
    pub revision: u32,
    /// One line for people.
    pub title: String,
    /// Optional features; all else is the core.
    pub features: Vec<Feature>,
    /// Settings that cases use.
    pub settings: Vec<SettingUse>,
    /// The clauses.
    pub clauses: Vec<Clause>,
}

/// An optional part of a profile. A plug-in is held to it if its manifest claims it.
///
/// The example of [`Ledger`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feature {
    /// As it stands in manifests.
    pub name: String,
    /// What it is, for people.
    pub text: String,
}

/// A setting that cases use: its name, type and unit belong to the profile, so that any
/// plug-in can be judged by it.
///
/// The example of [`Ledger`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettingUse {
    /// Its name.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: ValueType,
    /// Unit of an int; empty without.
    #[serde(default)]
    pub unit: String,
    /// The value that asks for nothing. A plug-in without the setting, which lacks the
    /// optional feature that it belongs to, takes a case with this value as it stands.
    #[serde(default)]
    pub off: Option<String>,
}

/// A clause.
///
/// The example of [`Ledger`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clause {
    /// The profile, a dot and more: stable for ever.
    pub id: String,
    /// How much it binds.
    pub level: Level,
    /// What it demands, in the exact words of the protocol's page.
    pub sentence: String,
    /// [`fingerprint`] of the sentence: whoever changes the words must look at the cases too.
    /// Empty: none was written yet.
    #[serde(default)]
    pub sha256: String,
    /// The revision that brought it.
    pub since: u32,
    /// The optional feature that it belongs to; none: the core.
    pub feature: Option<String>,
    /// Why no case can show it; none: it is testable.
    pub excluded: Option<String>,
    /// Why the profile's model does not judge it; none: it does, or there is no model.
    pub unmodelled: Option<String>,
}

impl Ledger {
    /// Reads a ledger. `file` stands in errors.
    ///
    /// # Errors
    /// The first fault, with its place and what to do.
    pub fn parse(file: &Path, text: &str) -> Result<Self, LedgerError> {
        let raw: Raw = read_toml(file, text)?;
        raw.check()
            .map_err(|(place, wrong)| LedgerError::at(file, text, &place, &wrong.to_string()))
    }

    /// The clause with this id.
    pub fn clause(&self, id: &str) -> Option<&Clause> {
        self.clauses.iter().find(|clause| clause.id == id)
    }

    /// The optional features of these clauses, sorted.
    pub fn features_of(&self, clauses: &[String]) -> BTreeSet<&str> {
        let known = clauses.iter().filter_map(|id| self.clause(id));
        known.filter_map(|clause| clause.feature.as_deref()).collect()
    }
}

/// The first 8 bytes of the SHA-256 of a sentence, as 16 hex digits.
///
/// ```
/// use softplug_conformance::ledger::fingerprint;
///
/// assert_eq!(fingerprint("Every byte is sent back at once"), "9c8e10d29bfb0437");
/// ```
pub fn fingerprint(sentence: &str) -> String {
    let digest = Sha256::digest(sentence);
    digest[..8].iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// A ledger as it stands in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    profile: Spanned<String>,
    revision: Spanned<u32>,
    title: String,
    #[serde(default)]
    feature: Vec<Spanned<Feature>>,
    #[serde(default)]
    setting: Vec<Spanned<SettingUse>>,
    #[serde(default)]
    clause: Vec<Spanned<Clause>>,
}

type Fault = (std::ops::Range<usize>, Wrong);

/// What a ledger must not say.
#[derive(Debug, thiserror::Error)]
enum Wrong {
    #[error("\"{0}\" is no name of a profile: lower-case letters, digits and single inner hyphens")]
    Profile(String),
    #[error("revisions count from 1")]
    Revision,
    #[error("the {what} \"{name}\" stands here twice; keep one")]
    Twice { what: &'static str, name: String },
    #[error("the clause \"{id}\" must be a slug that begins with \"{profile}.\"")]
    Clause { id: String, profile: String },
    #[error(
        "{id}: since must be 1 to {revision}, the ledger's revision; a new clause needs a new revision"
    )]
    Since { id: String, revision: u32 },
    #[error("{0}: the sentence is empty; say what the clause demands")]
    NoSentence(String),
    #[error("{id}: {what} needs a reason")]
    NoReason { id: String, what: &'static str },
}

impl Raw {
    fn check(self) -> Result<Ledger, Fault> {
        let profile = self.profile.get_ref();
        if !is_slug(profile) || profile.contains('.') {
            return Err((self.profile.span(), Wrong::Profile(profile.clone())));
        }
        if *self.revision.get_ref() == 0 {
            return Err((self.revision.span(), Wrong::Revision));
        }
        once("feature", &self.feature, |feature| &feature.name)?;
        once("setting", &self.setting, |setting| &setting.name)?;
        once("clause", &self.clause, |clause| &clause.id)?;
        for clause in &self.clause {
            let place = clause.span();
            self.check_clause(clause.get_ref()).map_err(|wrong| (place, wrong))?;
        }
        Ok(Ledger {
            profile: self.profile.into_inner(),
            revision: self.revision.into_inner(),
            title: self.title,
            features: self.feature.into_iter().map(Spanned::into_inner).collect(),
            settings: self.setting.into_iter().map(Spanned::into_inner).collect(),
            clauses: self.clause.into_iter().map(Spanned::into_inner).collect(),
        })
    }

    fn check_clause(&self, clause: &Clause) -> Result<(), Wrong> {
        let (id, profile) = (clause.id.clone(), self.profile.get_ref());
        if !is_slug(&id) || !id.starts_with(&format!("{profile}.")) {
            return Err(Wrong::Clause { id, profile: profile.clone() });
        }
        let revision = *self.revision.get_ref();
        if clause.since == 0 || clause.since > revision {
            return Err(Wrong::Since { id, revision });
        }
        if clause.sentence.trim().is_empty() {
            return Err(Wrong::NoSentence(id));
        }
        if clause.excluded.as_ref().is_some_and(|reason| reason.trim().is_empty()) {
            return Err(Wrong::NoReason { id, what: "excluded" });
        }
        if clause.unmodelled.as_ref().is_some_and(|reason| reason.trim().is_empty()) {
            return Err(Wrong::NoReason { id, what: "unmodelled" });
        }
        Ok(())
    }
}

fn once<T>(
    what: &'static str,
    rows: &[Spanned<T>],
    name: impl Fn(&T) -> &String,
) -> Result<(), Fault> {
    let mut seen = BTreeSet::new();
    for row in rows {
        let name = name(row.get_ref());
        if !seen.insert(name) {
            return Err((row.span(), Wrong::Twice { what, name: name.clone() }));
        }
    }
    Ok(())
}
