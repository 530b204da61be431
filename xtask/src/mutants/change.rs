//! The catalogues' changes: which code of a plug-in becomes what.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use serde::Deserialize;

/// One change of a mutant.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Change {
    /// The mutant.
    pub(super) id: String,
    /// Whole lines of the file, as they are but for their indentation.
    pub(super) code: String,
    /// The lines in their place.
    pub(super) becomes: String,
    /// It is made whichever mutant is on: what others of the mutant's changes build on, and
    /// what does nothing by itself.
    pub(super) is_always: bool,
}

/// A catalogue cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CatalogueError {
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("{}: {cause}", path.display())]
    Toml { path: PathBuf, cause: Box<toml::de::Error> },
    #[error("{}: \"{id}\" changes nothing: add a [[mutant.change]]", path.display())]
    Nothing { path: PathBuf, id: String },
}

/// The changes of all catalogues in a folder, by file below `plugins/`.
pub(super) fn read(folder: &Path) -> Result<BTreeMap<String, Vec<Change>>, CatalogueError> {
    let file_error = |path: &Path, cause| CatalogueError::File { path: path.to_owned(), cause };
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.map_err(|cause| file_error(folder, cause))?;
    let mut paths: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    paths.retain(|path| path.file_name() != Some("matrix.toml".as_ref()));
    paths.sort();
    let mut changes = BTreeMap::new();
    for path in paths {
        let text = fs::read_to_string(&path).map_err(|cause| file_error(&path, cause))?;
        let catalogue: Catalogue = toml::from_str(&text)
            .map_err(|cause| CatalogueError::Toml { path: path.clone(), cause: cause.into() })?;
        for Mutant { id, change } in catalogue.mutant {
            if change.is_empty() {
                return Err(CatalogueError::Nothing { path, id });
            }
            for RawChange { file, code, becomes, always } in change {
                let change = Change { id: id.clone(), code, becomes, is_always: always };
                changes.entry(file).or_insert_with(Vec::new).push(change);
            }
        }
    }
    Ok(changes)
}

/// What is needed here of a catalogue; the suite reads the rest.
#[derive(Deserialize)]
struct Catalogue {
    #[serde(default)]
    mutant: Vec<Mutant>,
}

#[derive(Deserialize)]
struct Mutant {
    id: String,
    #[serde(default)]
    change: Vec<RawChange>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawChange {
    file: String,
    code: String,
    becomes: String,
    #[serde(default)]
    always: bool,
}
