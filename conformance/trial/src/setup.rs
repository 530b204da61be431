//! What is tried, but for the program.

use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{LineParameters, Micros};

/// When the partner does its first thing: the job has begun then.
pub(crate) const BEGIN: Micros = Micros::from_millis(10);

/// What is tried, but for the program.
#[derive(Copy, Clone, Debug)]
pub struct Setup<'a> {
    /// What the plug-in says of itself.
    pub manifest: &'a Manifest,
    /// A value for each of its settings.
    pub settings: &'a SettingValues,
    /// The line. Its rate is not 0.
    pub line: LineParameters,
    /// Characters that the port holds ahead of the wire, at most; 1 or more.
    pub depth: u32,
    /// The kind of job, by its place in the manifest.
    pub job_kind: u16,
    /// The job's fields as value records.
    pub records: &'a [u8],
    /// The job's fields as texts, each with its name.
    pub fields: &'a [(&'a str, &'a str)],
}

impl<'a> Setup<'a> {
    /// The manifest's first kind of job without fields, on a port that holds one character.
    pub fn new(manifest: &'a Manifest, settings: &'a SettingValues, line: LineParameters) -> Self {
        Self { manifest, settings, line, depth: 1, job_kind: 0, records: &[], fields: &[] }
    }

    /// The fields as value records, but for those that say where in the program to begin: they
    /// belong to the program as a whole.
    pub(crate) fn records_from_its_start(&self) -> Vec<u8> {
        let fields = self.fields.iter().copied().filter(|(name, _)| !is_beginning(name));
        let kind = self.manifest.jobs.get(usize::from(self.job_kind));
        let records = kind.and_then(|kind| kind.records(fields).ok());
        records.unwrap_or_else(|| self.records.to_vec())
    }

    pub(crate) fn field(&self, name: &str) -> Option<&'a str> {
        self.fields.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }
}

/// Whether a field of a job says where in its program it begins, as `from_block` does.
///
/// ```
/// assert!(softplug_trial::is_beginning("from_sequence"));
/// assert!(!softplug_trial::is_beginning("preamble"));
/// ```
pub fn is_beginning(field: &str) -> bool {
    field.starts_with("from_")
}
