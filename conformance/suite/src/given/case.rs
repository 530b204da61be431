//! A case: a trace, where it came from, and the files that it names.

use super::ledger::SettingUse;
use super::read::read_bytes;
use sha2::{Digest as _, Sha256};
use softplug_abi::manifest::Manifest;
use softplug_trace::{Assignment, Digest, Files, NoFile, Trace, limits};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A trace and where it came from.
///
/// ```
/// use softplug_conformance::Case;
/// use softplug_trace::Trace;
///
/// # let text = std::fs::read_to_string("../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt")?;
/// let case = Case::new("traces/hold.spt", Trace::parse(&text)?);
/// assert_eq!(case.trace.front.id, "xon-xoff.tx.hold");
/// // The same with another byte; files that it names are still looked for beside it.
/// let other = case.with_trace(Trace::parse(&text.replace("41 42 ", "41 43 "))?);
/// assert_eq!(other.path, case.path);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Case {
    /// The file, as it was found.
    pub path: PathBuf,
    /// What stands in it.
    pub trace: Trace,
    /// What its `file:` items name, by digest, if it is known already.
    attached: Option<Arc<Attached>>,
    /// Settings of the case that a plug-in may lack: they ask for nothing.
    dispensable: Vec<String>,
    /// Cases that may stand before it on one open link.
    pub(crate) before: Vec<Arc<Case>>,
    /// How often it is run behind itself to see long use, if it is one for that.
    pub(crate) long: Option<u32>,
}

/// Contents of files by their digest as hex digits.
pub(crate) type Attached = BTreeMap<String, Vec<u8>>;

impl Case {
    /// A trace that stands in no file; `file:` items are looked for beside `path`.
    pub fn new(path: impl Into<PathBuf>, trace: Trace) -> Self {
        Self {
            path: path.into(),
            trace,
            attached: None,
            dispensable: Vec::new(),
            before: Vec::new(),
            long: None,
        }
    }

    /// A trace of a corpus, which has the files too.
    pub(crate) fn attached(
        path: impl Into<PathBuf>,
        trace: Trace,
        attached: Arc<Attached>,
    ) -> Self {
        Self { attached: Some(attached), ..Self::new(path, trace) }
    }

    /// Another trace in its place: the files beside it, and what its profile says, stay.
    pub fn with_trace(&self, trace: Trace) -> Self {
        Self { trace, ..self.clone() }
    }

    /// Learns which of its settings ask for nothing.
    pub(crate) fn dispense_with(&mut self, settings: &[SettingUse]) {
        let asks_for_nothing = |pair: &&Assignment| {
            let of_profile = settings.iter().find(|setting| setting.name == pair.name);
            of_profile.is_some_and(|setting| setting.off.as_ref() == Some(&pair.value))
        };
        let pairs = self.trace.front.config.iter().filter(asks_for_nothing);
        self.dispensable = pairs.map(|pair| pair.name.clone()).collect();
    }

    /// The settings of the case, for a plug-in with this manifest.
    pub(crate) fn config_for(&self, manifest: &Manifest) -> Vec<(&str, &str)> {
        let is_needless = |name: &String| {
            let has = || manifest.settings.iter().any(|setting| setting.name == *name);
            self.dispensable.contains(name) && !has()
        };
        let pairs = self.trace.front.config.iter().filter(|pair| !is_needless(&pair.name));
        pairs.map(|pair| (pair.name.as_str(), pair.value.as_str())).collect()
    }

    /// Finds what `file:` items name: files called by their digest, in the folder
    /// `files` beside the trace or one above.
    pub fn files(&self) -> impl Files {
        let folder = self.path.parent().unwrap_or(Path::new("")).to_owned();
        let attached = self.attached.clone();
        move |digest: &Digest| match &attached {
            Some(attached) => find_attached(attached, digest),
            None => read(&folder, digest),
        }
    }
}

fn find_attached(attached: &Attached, digest: &Digest) -> Result<Vec<u8>, NoFile> {
    let name = digest.to_string();
    let bytes = attached.get(&name).ok_or(NoFile::NotInCorpus(*digest))?;
    checked(&Path::new("files").join(name), bytes.clone(), digest)
}

fn read(folder: &Path, digest: &Digest) -> Result<Vec<u8>, NoFile> {
    let name = digest.to_string();
    let beside = folder.join("files").join(&name);
    let above = folder.join("../files").join(&name);
    let path = if beside.is_file() { beside } else { above };
    let unreadable =
        |error: io::Error| NoFile::Unreadable { path: path.clone(), reason: error.to_string() };
    let bytes = read_bytes(&path, limits::ITEM_BYTES).map_err(unreadable)?;
    checked(&path, bytes, digest)
}

fn checked(path: &Path, bytes: Vec<u8>, digest: &Digest) -> Result<Vec<u8>, NoFile> {
    if Sha256::digest(&bytes)[..] == digest.0 {
        Ok(bytes)
    } else {
        Err(NoFile::OtherDigest(path.to_owned()))
    }
}
