//! The manifest: what a plug-in says of itself, as JSON in the custom section
//! `softplug.manifest`. A host reads it without instantiating the plug-in.

mod fields;
mod line;
mod settings;

pub use fields::FieldError;
pub use line::{BadLine, LineCase, ProtocolLine};
use settings::list;
pub use settings::{OwnedValue, SettingError, SettingValues};

use crate::VERSION;
use crate::limits::{FIELDS, MANIFEST_BYTES, MEMORY_PAGES, SETTINGS, VALUE_BYTES};
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;
use thiserror::Error;

/// The minor version that brought keys of its own.
const SINCE: u16 = 1;

/// A plug-in's manifest.
///
/// ```
/// use softplug_abi::manifest::Manifest;
///
/// let manifest = Manifest::parse(br#"{
///     "abi": "1.0", "name": "echo", "version": "1.0.0", "licence": "MIT",
///     "protocol": "none", "description": "Sends back what it receives."
/// }"#)?;
/// assert_eq!(manifest.name, "echo");
/// # Ok::<(), softplug_abi::manifest::ManifestError>(())
/// ```
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the ABI that it speaks, `major.minor`.
    pub abi: String,
    /// Name: lower-case letters, digits and hyphens, at most 40.
    pub name: String,
    /// The plug-in's own version.
    pub version: String,
    /// Licence as an SPDX expression.
    pub licence: String,
    /// The protocol, as people call it.
    pub protocol: String,
    /// One or two sentences for people.
    pub description: String,
    /// Settings, in the order in which their values arrive.
    #[serde(default)]
    pub settings: Vec<Setting>,
    /// Named sets of settings.
    #[serde(default)]
    pub presets: Vec<Preset>,
    /// Kinds of job that it takes, numbered from 0.
    #[serde(default)]
    pub jobs: Vec<Kind>,
    /// Kinds of request that it makes, numbered from 0.
    #[serde(default)]
    pub requests: Vec<Kind>,
    /// Conformance profiles that it claims.
    #[serde(default)]
    pub profiles: Vec<Profile>,
    /// The protocol's own status codes.
    #[serde(default)]
    pub status: Vec<StatusCode>,
    /// What it needs of the link.
    #[serde(default)]
    pub needs: Needs,
    /// Formats of saved state.
    #[serde(default)]
    pub state: StateFormats,
    /// The protocol's line; since ABI 1.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<ProtocolLine>,
    /// Settings for which it is another one; the first that holds counts. Since ABI 1.1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub line_when: Vec<LineCase>,
    /// Bytes of its memory that it uses, from address 0 on: where memory is little, no more is there.
    /// Without it, all that the module declares. Since ABI 1.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<u32>,
}

/// A setting.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// Name: lower-case letters, digits and underscores.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: ValueType,
    /// Value if nothing is said: a JSON boolean, number or string; bytes are a
    /// string of hex pairs.
    pub default: Json,
    /// Smallest value (int), or least length in bytes (text, bytes).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<i64>,
    /// Largest value (int), or greatest length in bytes (text, bytes).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<i64>,
    /// Unit of an int: `ms`, `bytes`, `characters` …; empty without.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// The choices of a choice.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<String>,
    /// What it does, for people.
    pub text: String,
}

/// Type of a value.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ValueType {
    /// Yes or no.
    Bool,
    /// A whole number.
    Int,
    /// UTF-8 text.
    Text,
    /// Bytes.
    Bytes,
    /// One of a list of names.
    Choice,
}

impl ValueType {
    /// The name in the manifest.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Int => "int",
            Self::Text => "text",
            Self::Bytes => "bytes",
            Self::Choice => "choice",
        }
    }
}

/// A named set of settings.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub text: String,
    /// Settings by name, with values as in a setting's `default`.
    pub values: BTreeMap<String, Json>,
}

/// A kind of job or request.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// Its name.
    pub name: String,
    /// What it does.
    pub text: String,
    /// Its fields, numbered from 0.
    #[serde(default)]
    pub fields: Vec<Field>,
}

/// A field of a job or request.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: ValueType,
    /// It must be there.
    #[serde(default)]
    pub required: bool,
    /// What it means.
    pub text: String,
}

/// A conformance profile that is claimed.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Its name.
    pub name: String,
    /// Optional features of it.
    #[serde(default)]
    pub features: Vec<String>,
}

/// A status code of the protocol.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatusCode {
    /// The number, as it stands in actions.
    pub code: u16,
    /// How the manuals write it.
    pub name: String,
    /// What it means.
    pub text: String,
}

/// Whether the link must have something.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Need {
    /// Not looked at.
    #[default]
    No,
    /// Used where the link has it.
    Used,
    /// The plug-in cannot work without it.
    Required,
}

/// What a plug-in needs of the link.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Needs {
    /// Reports of damaged characters.
    pub line_errors: Need,
    /// Modem lines.
    pub modem_lines: Need,
    /// The plug-in makes and checks parity itself, on an 8-bit line.
    pub software_parity: bool,
    /// A job's data is fed once as a check before it is sent.
    pub check_pass: bool,
}

/// Formats of saved state.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StateFormats {
    /// The format that it saves; none: it cannot be swapped in the middle.
    pub saves: Option<u16>,
    /// The formats that it can restore.
    pub accepts: Vec<u16>,
}

/// What is wrong with a manifest.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum ManifestError {
    /// Larger than [`MANIFEST_BYTES`].
    #[error("the manifest has {0} bytes, at most {MANIFEST_BYTES} are allowed")]
    TooLarge(usize),
    /// Not JSON of the right shape.
    #[error("the manifest is not valid: {0}")]
    Json(String),
    /// It speaks a version of the ABI that this host does not serve.
    #[error("the plug-in speaks ABI {0}, this host serves {host}", host = HostVersion)]
    Version(String),
    /// An entry breaks a rule.
    #[error("{entry}: {rule}")]
    Entry {
        /// The entry, as a path into the JSON.
        entry: String,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// A default or a preset's value does not fit its setting.
    #[error("{entry}: {source}")]
    Value {
        /// The entry, as a path into the JSON.
        entry: String,
        /// Why it does not fit.
        source: SettingError,
    },
}

struct HostVersion;

impl core::fmt::Display for HostVersion {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}.0 to {}.{}", VERSION.0, VERSION.0, VERSION.1)
    }
}

impl Manifest {
    /// Parses and checks a manifest.
    pub fn parse(json: &[u8]) -> Result<Self, ManifestError> {
        if json.len() > MANIFEST_BYTES {
            return Err(ManifestError::TooLarge(json.len()));
        }
        let manifest: Self =
            serde_json::from_slice(json).map_err(|error| ManifestError::Json(error.to_string()))?;
        manifest.check()?;
        Ok(manifest)
    }

    /// Place of the kind of job with this name.
    pub fn job_kind(&self, name: &str) -> Option<u16> {
        self.jobs.iter().position(|kind| kind.name == name).map(|at| at as u16)
    }

    /// The formats in which this plug-in takes over the state of `other`: none where that has
    /// another name. The number of a format means something within one plug-in only.
    ///
    /// ```
    /// use softplug_abi::manifest::Manifest;
    ///
    /// let named = |name: &str| {
    ///     Manifest::parse(format!(r#"{{
    ///         "abi": "1.0", "name": "{name}", "version": "1.0.0", "licence": "MIT", "protocol": "none",
    ///         "description": "An example.", "state": {{"saves": 1, "accepts": [1]}}
    ///     }}"#).as_bytes())
    /// };
    /// assert_eq!(named("lathe")?.accepts_of(&named("lathe")?), [1]);
    /// assert!(named("lathe")?.accepts_of(&named("press")?).is_empty());
    /// # Ok::<(), softplug_abi::manifest::ManifestError>(())
    /// ```
    pub fn accepts_of(&self, other: &Self) -> &[u16] {
        if self.name == other.name { &self.state.accepts } else { &[] }
    }

    /// The protocol's own status with this code, if it is listed.
    pub fn status(&self, code: u16) -> Option<&StatusCode> {
        self.status.iter().find(|status| status.code == code)
    }

    fn check(&self) -> Result<(), ManifestError> {
        self.check_version()?;
        check_name("name", &self.name, '-')?;
        if self.settings.len() > SETTINGS {
            return entry("settings", "more settings than the ABI allows");
        }
        for (at, setting) in self.settings.iter().enumerate() {
            self.check_setting(at, setting)?;
        }
        for (at, preset) in self.presets.iter().enumerate() {
            self.check_preset(at, preset)?;
        }
        for (list, kinds) in [("jobs", &self.jobs), ("requests", &self.requests)] {
            for (at, kind) in kinds.iter().enumerate() {
                let path = alloc::format!("{list}[{at}]");
                check_name(&path, &kind.name, '-')?;
                if kind.fields.len() > FIELDS {
                    return entry(&path, "more fields than the ABI allows");
                }
                if kinds[..at].iter().any(|other| other.name == kind.name) {
                    return entry(&path, "the name stands twice");
                }
                for (at, field) in kind.fields.iter().enumerate() {
                    check_name(&path, &field.name, '_')?;
                    if kind.fields[..at].iter().any(|other| other.name == field.name) {
                        return entry(&path, "the name of a field stands twice");
                    }
                }
            }
        }
        self.check_line()?;
        self.check_memory()
    }

    fn check_version(&self) -> Result<(), ManifestError> {
        let number = |text: &str| {
            let digits = text.bytes().all(|byte| byte.is_ascii_digit());
            digits.then(|| text.parse::<u16>().ok()).flatten()
        };
        let served = self
            .abi
            .split_once('.')
            .and_then(|(major, minor)| Some((number(major)?, number(minor)?)));
        match served {
            Some((major, minor)) if major == VERSION.0 && minor <= VERSION.1 => Ok(()),
            _ => Err(ManifestError::Version(self.abi.clone())),
        }
    }

    fn check_setting(&self, at: usize, setting: &Setting) -> Result<(), ManifestError> {
        let path = alloc::format!("settings[{at}]");
        check_name(&path, &setting.name, '_')?;
        if setting.name == "preset" {
            return entry(&path, "\"preset\" is the host's own word");
        }
        if self.settings[..at].iter().any(|other| other.name == setting.name) {
            return entry(&path, "the name stands twice");
        }
        if (setting.kind == ValueType::Choice) == setting.choices.is_empty() {
            return entry(&path, "choices belong to a choice, and only to one");
        }
        let mut choices = setting.choices.iter().enumerate();
        if choices.any(|(at, choice)| setting.choices[..at].contains(choice)) {
            return entry(&path, "a choice stands twice");
        }
        if let (Some(min), Some(max)) = (setting.min, setting.max)
            && min > max
        {
            return entry(&path, "min is over max");
        }
        let longest = setting.max.unwrap_or(0);
        let has_length = matches!(setting.kind, ValueType::Text | ValueType::Bytes);
        if has_length && !(0..=VALUE_BYTES as i64).contains(&longest) {
            return entry(&path, "max is over what a value may hold");
        }
        setting
            .value_from_json(&setting.default)
            .map(drop)
            .map_err(|source| ManifestError::Value { entry: path, source })
    }

    fn check_memory(&self) -> Result<(), ManifestError> {
        let Some(bytes) = self.memory_bytes else { return Ok(()) };
        if self.minor() < Some(SINCE) {
            return entry("memory_bytes", "it came with ABI 1.1: write that as `abi`");
        }
        if bytes == 0 || u64::from(bytes) > MEMORY_PAGES * 65_536 {
            return entry("memory_bytes", "it is 1 to 262144");
        }
        Ok(())
    }

    fn minor(&self) -> Option<u16> {
        self.abi.split_once('.').and_then(|(_, minor)| minor.parse().ok())
    }

    fn check_preset(&self, at: usize, preset: &Preset) -> Result<(), ManifestError> {
        let path = alloc::format!("presets[{at}]");
        check_name(&path, &preset.name, '-')?;
        if self.presets[..at].iter().any(|other| other.name == preset.name) {
            return entry(&path, "the name stands twice");
        }
        for (name, json) in &preset.values {
            let Some(setting) = self.settings.iter().find(|setting| setting.name == *name) else {
                return entry(&path, "it sets what is no setting");
            };
            setting.value_from_json(json).map_err(|source| ManifestError::Value {
                entry: alloc::format!("{path}.{name}"),
                source,
            })?;
        }
        Ok(())
    }
}

fn entry<T>(path: &str, rule: &'static str) -> Result<T, ManifestError> {
    Err(ManifestError::Entry { entry: path.to_string(), rule })
}

fn check_name(path: &str, name: &str, joint: char) -> Result<(), ManifestError> {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == joint;
    if name.is_empty() || name.len() > 40 || !name.chars().all(fits) {
        return entry(
            path,
            "a name is 1 to 40 of a-z, 0-9 and a joint (- or, in settings and fields, _)",
        );
    }
    Ok(())
}
