//! The library of plug-ins: a folder that people, the command and a running
//! gateway may all use at once.
//!
//! ```text
//! sha256/ab/cdef….wasm   the modules, named by their SHA-256, never changed
//! names/NAME/VERSION     which module a version means: digests, the last one counts
//! signatures/DIGEST.sig  with which units take a module
//! used/LINK              which modules a link runs, and ran well with before
//! incoming/              what is put here is checked and taken
//! ```

mod error;
mod index;
mod reference;
mod signature;
mod used;
mod watch;

pub use error::LibraryError;
pub use reference::{BadReference, Reference, Which};
pub use signature::SIGNATURE_BYTES;
pub use used::Use;
pub use watch::{LibraryNews, Watch};

use std::fmt;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use softplug_abi::limits::MODULE_BYTES;
use softplug_host::{Digest, Inspection, lint};

use crate::disk::{self, DiskError, Object, Objects, make_folder};
use index::Index;
use softplug_live::guess::nearest;

/// A folder of plug-ins.
#[derive(Clone, Debug)]
pub struct Library {
    folder: PathBuf,
    objects: Objects,
    check: Option<Check>,
}

/// What a module must pass to be added, beside the lint.
#[derive(Clone)]
struct Check(Arc<CheckModule>);

type CheckModule = dyn Fn(&[u8]) -> Result<(), LibraryError> + Send + Sync;

impl fmt::Debug for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Check")
    }
}

/// A plug-in in the library.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of the module, 64 hex digits.
    #[serde(rename = "sha256", with = "disk::digest_text")]
    pub digest: Digest,
    /// Bytes of the module.
    pub size: u64,
    /// The protocol, as people call it.
    pub protocol: String,
    /// What it is for.
    pub description: String,
    /// Name and version mean this module; one that is only there by its digest was
    /// replaced or removed.
    pub is_named: bool,
    /// Links that run it, or would go back to it.
    pub used_by: Vec<String>,
}

/// What came of adding a module.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Added {
    /// The plug-in.
    pub entry: Entry,
    /// Its name and version meant this very module before.
    pub was_there: bool,
    /// Its name and version meant this other module before, which stays until garbage is
    /// collected.
    pub replaced: Option<Digest>,
}

impl Library {
    /// The library in `folder`, which is made if need be.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open(folder: &Path) -> Result<Self, LibraryError> {
        let objects = Objects::open(&folder.join("sha256"), ".wasm")?;
        for part in ["names", "used", "incoming"] {
            make_folder(&folder.join(part))?;
        }
        Ok(Self { folder: folder.to_owned(), objects, check: None })
    }

    /// The library in `folder`, if there is one.
    ///
    /// # Errors
    /// There is none.
    pub fn existing(folder: &Path) -> Result<Self, LibraryError> {
        if !folder.join("sha256").is_dir() || !folder.join("names").is_dir() {
            return Err(LibraryError::NoLibrary(folder.to_owned()));
        }
        Self::open(folder)
    }

    /// This library, which takes a module only if it passes this check too. It may take
    /// seconds; the library is not locked meanwhile.
    #[must_use]
    pub fn checking(
        self,
        check: impl Fn(&[u8]) -> Result<(), LibraryError> + Send + Sync + 'static,
    ) -> Self {
        Self { check: Some(Check(Arc::new(check))), ..self }
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Checks a module and keeps it, under its name and version. It is on the disk when
    /// this returns.
    ///
    /// # Errors
    /// It is no plug-in, or the disk would not take it.
    pub fn add(&self, wasm: &[u8]) -> Result<Added, LibraryError> {
        let inspection = lint(wasm)?;
        let version = &inspection.manifest.version;
        if !reference::is_version(version) {
            return Err(LibraryError::Version(version.chars().take(80).collect()));
        }
        if let Some(Check(check)) = &self.check {
            check(wasm)?;
        }
        let _lock = self.lock()?;
        let object = self.objects.put(&mut &*wasm)?;
        let before = self.index().point(&inspection.manifest.name, version, object.digest)?;
        let entry = self.entry(object, &inspection, true)?;
        let was_there = before == Some(object.digest);
        Ok(Added { entry, was_there, replaced: before.filter(|_| !was_there) })
    }

    /// Adds the module in a file.
    ///
    /// # Errors
    /// It cannot be read, is no plug-in, or the disk would not take it.
    pub fn add_file(&self, path: &Path) -> Result<Added, LibraryError> {
        // One byte more than allowed, for the check to find.
        let read = || {
            let mut wasm = Vec::new();
            disk::open(path)?.take(MODULE_BYTES as u64 + 1).read_to_end(&mut wasm)?;
            Ok(wasm)
        };
        self.add(&read().map_err(DiskError::when("read", path))?)
    }

    /// All plug-ins, by name, the newest version first, those without a name last.
    ///
    /// # Errors
    /// The folder cannot be read. A module that cannot be is logged and left out.
    pub fn entries(&self) -> Result<Vec<Entry>, LibraryError> {
        let named = self.index().all()?;
        let mut entries = Vec::new();
        for object in self.objects.all()? {
            let inspection = match self.inspect(object.digest) {
                Ok(inspection) => inspection,
                Err(error) => {
                    tracing::warn!(sha256 = %object.digest, %error, "a module is left out");
                    continue;
                }
            };
            let is_named = named.iter().any(|name| name.digest == object.digest);
            entries.push(self.entry(object, &inspection, is_named)?);
        }
        entries.sort_by(|one, other| {
            let by_version = || reference::compare(&other.version, &one.version);
            let by_name = one.name.cmp(&other.name).then_with(by_version);
            by_name.then_with(|| other.is_named.cmp(&one.is_named))
        });
        Ok(entries)
    }

    /// The plug-in that is meant.
    ///
    /// # Errors
    /// There is none, or more than one.
    pub fn resolve(&self, asked: &Reference) -> Result<Entry, LibraryError> {
        if let Which::Digest(digits) = &asked.which {
            return self.by_digest(asked, digits);
        }
        let versions = self.index().versions(&asked.name)?;
        let fitting = versions.iter().filter(|named| match &asked.which {
            Which::Version(version) => reference::is_of(&named.version, version),
            _ => true,
        });
        let order = |one: &&index::Named, other: &&index::Named| {
            // Who asks for no version in particular gets no trial, unless there is nothing else.
            let trials =
                reference::is_trial(&other.version).cmp(&reference::is_trial(&one.version));
            trials.then_with(|| reference::compare(&one.version, &other.version))
        };
        let exact = |named: &&index::Named| matches!(&asked.which, Which::Version(version) if *version == named.version);
        let found = versions.iter().find(exact).or_else(|| fitting.max_by(order));
        let Some(found) = found else { return Err(self.not_found(asked)?) };
        let object = self.objects.find(found.digest).ok_or_else(|| LibraryError::Damaged {
            path: self.objects.path(found.digest),
            digest: found.digest,
        })?;
        self.entry(object, &self.inspect(found.digest)?, true)
    }

    /// The bytes of a module, as they were added.
    ///
    /// # Errors
    /// It is not there, or not what it was.
    pub fn read(&self, digest: Digest) -> Result<Vec<u8>, LibraryError> {
        let path = self.objects.path(digest);
        let wasm = disk::read_small(&path, MODULE_BYTES)?;
        if Digest::of(&wasm) != digest {
            return Err(LibraryError::Damaged { path, digest });
        }
        Ok(wasm)
    }

    /// Takes name and version from a plug-in, or, with a digest, the module away. What a
    /// link uses stays, unless `force` is given.
    ///
    /// # Errors
    /// There is no such plug-in, or it is used.
    pub fn remove(&self, asked: &Reference, force: bool) -> Result<Entry, LibraryError> {
        let _lock = self.lock()?;
        let entry = self.resolve(asked)?;
        if !force && !entry.used_by.is_empty() {
            let holders = entry.used_by.clone();
            return Err(LibraryError::InUse { asked: asked.clone(), holders });
        }
        if entry.is_named {
            self.index().forget(&entry.name, &entry.version)?;
        }
        if matches!(asked.which, Which::Digest(_)) {
            self.objects.remove(entry.digest)?;
        }
        Ok(entry)
    }

    /// Removes all modules that no name and version means and that no link uses; tells
    /// which. With `pretend` it only tells.
    ///
    /// # Errors
    /// The folder cannot be read, or a file not removed.
    pub fn collect_garbage(&self, pretend: bool) -> Result<Vec<Object>, LibraryError> {
        let _lock = self.lock()?;
        let named = self.index().all()?;
        let used = self.uses()?;
        let mut garbage = self.objects.all()?;
        garbage.retain(|object| {
            let is_named = named.iter().any(|name| name.digest == object.digest);
            !is_named && used.iter().all(|(_, used)| !used.has(object.digest))
        });
        if !pretend {
            for object in &garbage {
                self.objects.remove(object.digest)?;
            }
        }
        Ok(garbage)
    }

    fn by_digest(&self, asked: &Reference, digits: &str) -> Result<Entry, LibraryError> {
        let mut fitting = Vec::new();
        for object in self.objects.all()? {
            if object.digest.to_string().starts_with(digits) {
                let inspection = self.inspect(object.digest)?;
                if inspection.manifest.name == asked.name {
                    fitting.push((object, inspection));
                }
            }
        }
        match &fitting[..] {
            [] => Err(self.not_found(asked)?),
            [(object, inspection)] => {
                let named = self.index().all()?;
                let is_named = named.iter().any(|name| name.digest == object.digest);
                self.entry(*object, inspection, is_named)
            }
            [..] => Err(LibraryError::Ambiguous { asked: asked.clone(), count: fitting.len() }),
        }
    }

    fn not_found(&self, asked: &Reference) -> Result<LibraryError, LibraryError> {
        let index = self.index();
        let versions = index.versions(&asked.name)?;
        let hint = if versions.is_empty() {
            let names = index.names()?;
            match nearest(&asked.name, names.iter().map(String::as_str)) {
                Some(name) => format!("did you mean \"{name}\"?"),
                None if names.is_empty() => "it is empty".to_owned(),
                None => format!("it has {}", names.join(", ")),
            }
        } else {
            let versions: Vec<_> = versions.into_iter().map(|named| named.version).collect();
            format!("its versions are {}", versions.join(", "))
        };
        Ok(LibraryError::NotFound { asked: asked.clone(), hint })
    }

    fn inspect(&self, digest: Digest) -> Result<Inspection, LibraryError> {
        Ok(lint(&self.read(digest)?)?)
    }

    fn entry(
        &self,
        object: Object,
        inspection: &Inspection,
        is_named: bool,
    ) -> Result<Entry, LibraryError> {
        let manifest = &inspection.manifest;
        let used = self.uses()?.into_iter().filter(|(_, used)| used.has(object.digest));
        Ok(Entry {
            name: manifest.name.clone(),
            version: manifest.version.clone(),
            digest: object.digest,
            size: object.size,
            protocol: manifest.protocol.clone(),
            description: manifest.description.clone(),
            is_named,
            used_by: used.map(|(link, _)| link).collect(),
        })
    }

    fn index(&self) -> Index {
        Index::new(self.folder.join("names"))
    }

    /// For changes: one process at a time. What a killed one left is cleared away.
    fn lock(&self) -> Result<File, LibraryError> {
        let path = self.folder.join(".lock");
        let lock = || {
            let file = fs::OpenOptions::new().create(true).append(true).open(&path)?;
            file.lock()?;
            Ok(file)
        };
        let file = lock().map_err(DiskError::when("lock", &path))?;
        self.objects.sweep();
        Ok(file)
    }
}
