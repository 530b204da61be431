//! Traces from files and folders.

use super::case::Case;
use super::neighbours::find_neighbours;
use super::read::read_text;
use softplug_trace::{FileNameError, ParseError, Trace, limits};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

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
