//! Traces from files and folders.

use super::ledger::SettingUse;
use super::neighbours::find_neighbours;
use sha2::{Digest as _, Sha256};
use softplug_abi::manifest::Manifest;
use softplug_trace::{Assignment, Digest, FileNameError, Files, ParseError, Trace, limits};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read};
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

fn find_attached(attached: &Attached, digest: &Digest) -> Result<Vec<u8>, String> {
    let name = digest.to_string();
    let bytes = attached.get(&name);
    let bytes = bytes.ok_or_else(|| format!("the corpus has no file files/{name}"))?;
    checked(&Path::new("files").join(name), bytes.clone(), digest)
}

fn read(folder: &Path, digest: &Digest) -> Result<Vec<u8>, String> {
    let name = digest.to_string();
    let beside = folder.join("files").join(&name);
    let above = folder.join("../files").join(&name);
    let path = if beside.is_file() { beside } else { above };
    let bytes = read_bytes(&path, limits::ITEM_BYTES)
        .map_err(|error| format!("{}: {error}", path.display()))?;
    checked(&path, bytes, digest)
}

fn checked(path: &Path, bytes: Vec<u8>, digest: &Digest) -> Result<Vec<u8>, String> {
    if Sha256::digest(&bytes)[..] == digest.0 {
        Ok(bytes)
    } else {
        Err(format!("{} has another digest than its name says", path.display()))
    }
}

/// Traces that cannot be read.
///
/// ```
/// use softplug_conformance::{LoadError, load};
///
/// let error = load(["benches"]).unwrap_err();
/// assert!(matches!(error, LoadError::Nothing { .. }));
/// assert_eq!(error.report(), "error: benches holds no trace (*.spt)");
/// ```
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A file or folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A file is no trace.
    #[error("{}:{}:{}: {}", path.display(), source.line, source.column, source.kind)]
    Parse {
        /// The file.
        path: PathBuf,
        /// The fault, with its place.
        source: Box<ParseError>,
    },
    /// A file is not where its id says.
    #[error(transparent)]
    Name(#[from] FileNameError),
    /// Two files hold the same case.
    #[error("{} and {} both hold the case \"{id}\": remove one", first.display(), second.display())]
    Twice {
        /// The case.
        id: String,
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// There is nothing to run.
    #[error("{} holds no trace (*.spt)", path.display())]
    Nothing {
        /// Where it was looked.
        path: PathBuf,
    },
}

impl LoadError {
    /// Several lines for people, with the line of the file and a caret where
    /// the fault is in one.
    pub fn report(&self) -> String {
        match self {
            Self::Parse { path, source } => source.report(&path.display().to_string()),
            other => format!("error: {other}"),
        }
    }
}

/// Reads traces: files whatever they are called, folders with all `.spt` files in and
/// below them. The result is sorted by id.
///
/// ```
/// use softplug_conformance::load;
///
/// let cases = load(["../../fixtures/traces/r3964", "../../fixtures/traces/rk512"])?;
/// assert!(cases.is_sorted_by_key(|case| case.trace.front.id.clone()));
/// assert!(cases.iter().any(|case| case.trace.front.profile == "rk512"));
/// # Ok::<(), softplug_conformance::LoadError>(())
/// ```
///
/// # Errors
/// The first file that cannot be read, is no trace, holds a case that another one holds, or, in
/// a folder, does not stand where its id says.
pub fn load<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Vec<Case>, LoadError> {
    let mut cases: BTreeMap<String, Case> = BTreeMap::new();
    for path in paths {
        let path = path.as_ref();
        let mut files = Vec::new();
        find(path, &mut files)?;
        if files.is_empty() {
            return Err(LoadError::Nothing { path: path.to_owned() });
        }
        let is_file = files[0] == path;
        for path in files {
            let case = load_file(path)?;
            if !is_file {
                case.trace.front.check_path(&case.path)?;
            }
            let id = case.trace.front.id.clone();
            // The same file twice is no contradiction.
            match cases.get(&id) {
                Some(first) if !is_same(&first.path, &case.path) => {
                    let (first, second) = (first.path.clone(), case.path);
                    return Err(LoadError::Twice { id, first, second });
                }
                _ => drop(cases.insert(id, case)),
            }
        }
    }
    let mut cases: Vec<Case> = cases.into_values().collect();
    find_neighbours(&mut cases);
    Ok(cases)
}

fn is_same(first: &Path, second: &Path) -> bool {
    match (first.canonicalize(), second.canonicalize()) {
        (Ok(first), Ok(second)) => first == second,
        _ => first == second,
    }
}

fn load_file(path: PathBuf) -> Result<Case, LoadError> {
    let text = read_text(&path, limits::FILE_BYTES as u64)
        .map_err(|source| LoadError::Io { path: path.clone(), source })?;
    let trace = Trace::parse(&text)
        .map_err(|source| LoadError::Parse { path: path.clone(), source: Box::new(source) })?;
    Ok(Case::new(path, trace))
}

/// A file of text, of so many bytes at most.
pub(crate) fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let mut text = String::new();
    read_bytes(path, most)?.as_slice().read_to_string(&mut text)?;
    Ok(text)
}

/// A file of so many bytes at most: one that is longer is not read to its end.
fn read_bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let kind = io::ErrorKind::FileTooLarge;
        return Err(io::Error::new(kind, format!("it has more than {most} bytes")));
    }
    Ok(bytes)
}

/// A folder's traces; a file is taken whatever its name.
fn find(path: &Path, files: &mut Vec<PathBuf>) -> Result<(), LoadError> {
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    if !fs::metadata(path).map_err(io)?.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    let entries: Result<Vec<_>, _> =
        fs::read_dir(path).map_err(io)?.map(|entry| entry.map(|entry| entry.path())).collect();
    let mut entries = entries.map_err(io)?;
    entries.sort();
    for entry in entries {
        let is_trace = entry.extension().is_some_and(|extension| extension == "spt");
        if is_trace || entry.is_dir() {
            find(&entry, files)?;
        }
    }
    Ok(())
}
