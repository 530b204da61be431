//! Names and versions on top of the modules: `names/NAME/VERSION`, a text file with
//! a digest.

use std::path::{Path, PathBuf};

use softplug_host::Digest;
use thiserror::Error;

use super::reference::is_version;
use super::{LibraryError, Reference, Which};
use crate::disk::{self, DiskError, make_folder};

/// A digest, its algorithm, and an end of line.
const MOST_BYTES: usize = 256;
const ALGORITHM: &str = "sha256:";

/// What a name and a version mean.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct Named {
    pub(super) name: String,
    pub(super) version: String,
    pub(super) digest: Digest,
}

/// Why a version means no module.
#[derive(Debug, Error)]
enum NoDigest {
    #[error(transparent)]
    Disk(#[from] DiskError),
    #[error("{} holds no digest", .0.display())]
    Other(PathBuf),
}

pub(super) struct Index {
    folder: PathBuf,
}

impl Index {
    pub(super) fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// All plug-ins by name.
    pub(super) fn names(&self) -> Result<Vec<String>, LibraryError> {
        let mut names = disk::names_in(&self.folder)?;
        names.retain(|name| is_name(name) && self.folder.join(name).is_dir());
        Ok(names)
    }

    /// The versions of a name; what is no such file is logged and left out.
    pub(super) fn versions(&self, name: &str) -> Result<Vec<Named>, LibraryError> {
        let folder = self.folder.join(name);
        let versions = match disk::names_in(&folder) {
            Err(error) if error.is_missing() => return Ok(Vec::new()),
            versions => versions?,
        };
        let named =
            versions.into_iter().filter(|version| is_version(version)).filter_map(|version| {
                match read(&folder.join(&version)) {
                    Ok(digest) => Some(Named { name: name.to_owned(), version, digest }),
                    Err(error) => {
                        let error = error.to_string();
                        tracing::warn!(plugin = name, version, error, "a version is left out");
                        None
                    }
                }
            });
        Ok(named.collect())
    }

    pub(super) fn all(&self) -> Result<Vec<Named>, LibraryError> {
        let mut all = Vec::new();
        for name in self.names()? {
            all.extend(self.versions(&name)?);
        }
        Ok(all)
    }

    /// Lets name and version mean this module; tells what they meant before.
    pub(super) fn point(
        &self,
        name: &str,
        version: &str,
        digest: Digest,
    ) -> Result<Option<Digest>, LibraryError> {
        let folder = self.folder.join(name);
        make_folder(&folder)?;
        let path = folder.join(version);
        let before = read(&path).ok();
        if before != Some(digest) {
            disk::write_whole(&path, format!("{ALGORITHM}{digest}\n").as_bytes())?;
        }
        Ok(before)
    }

    pub(super) fn forget(&self, name: &str, version: &str) -> Result<(), LibraryError> {
        let folder = self.folder.join(name);
        disk::remove(&folder.join(version))?;
        // Fails as long as there are other versions.
        let _ = std::fs::remove_dir(folder);
        Ok(())
    }
}

fn read(path: &Path) -> Result<Digest, NoDigest> {
    let bytes = disk::read_small(path, MOST_BYTES)?;
    let digest = str::from_utf8(&bytes).ok().and_then(|text| {
        let digits = text.trim_end().strip_prefix(ALGORITHM)?;
        digits.parse().ok()
    });
    digest.ok_or_else(|| NoDigest::Other(path.to_owned()))
}

fn is_name(name: &str) -> bool {
    name.parse::<Reference>().is_ok_and(|reference| reference.which == Which::Newest)
}
