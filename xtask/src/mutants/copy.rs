//! The changed copy of the plug-ins' sources, a workspace of its own in the target folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use toml::{Table, Value};

use super::change::{self, CatalogueError};
use super::rewrite::{RewriteError, rewrite};
use crate::workspace::Workspace;

/// The copy cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CopyError {
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error("{}: {cause}", path.display())]
    Rewrite { path: PathBuf, cause: RewriteError },
    #[error("the catalogues change plugins/{0}: there is no such file")]
    NoFile(String),
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("{}: {cause}", path.display())]
    Toml { path: PathBuf, cause: Box<toml::de::Error> },
}

/// Makes the copy and returns its folder. A file that is as it was is not written again, so
/// that cargo builds only what has changed.
pub(super) fn make(workspace: &Workspace) -> Result<PathBuf, CopyError> {
    let plugins = workspace.root().join("plugins");
    let folder = workspace.target().join("mutant-sources");
    let copies = folder.join("plugins");
    let mut changes = change::read(&workspace.root().join("fixtures/mutants"))?;
    let mut texts = BTreeMap::new();
    for entry in read_folder(&plugins)? {
        let manifest = entry.join("Cargo.toml");
        if let (Some(name), true) = (entry.file_name(), manifest.exists()) {
            texts.insert(copies.join(name).join("Cargo.toml"), plugin_manifest(&manifest)?);
            for (below, text) in sources(&plugins, &entry.join("src"))? {
                let changes = changes.remove(&below).unwrap_or_default();
                let text = rewrite(&text, &changes)
                    .map_err(|cause| CopyError::Rewrite { path: plugins.join(&below), cause })?;
                // With the places of all mutants it would make a function that is too large to load.
                let text = text.replace("inline(always)", "inline(never)");
                texts.insert(copies.join(below), text);
            }
        }
    }
    if let Some((file, _)) = changes.pop_first() {
        return Err(CopyError::NoFile(file));
    }
    prune(&copies, &texts)?;
    for (path, text) in &texts {
        write(path, text)?;
    }
    write(&folder.join("Cargo.toml"), &workspace_manifest(workspace.root())?)?;
    let lock = workspace.root().join("Cargo.lock");
    let versions = fs::read_to_string(&lock).map_err(|cause| file_error(&lock, cause))?;
    // Cargo then takes out what the copy has no use for.
    let copied = folder.join("Cargo.lock");
    if !copied.exists() {
        write(&copied, &versions)?;
    }
    Ok(folder)
}

/// All files in and below a folder, by their path below `plugins`.
fn sources(plugins: &Path, folder: &Path) -> Result<Vec<(String, String)>, CopyError> {
    let mut texts = Vec::new();
    for path in read_folder(folder)? {
        if path.is_dir() {
            texts.append(&mut sources(plugins, &path)?);
        } else {
            let text = fs::read_to_string(&path).map_err(|cause| file_error(&path, cause))?;
            let below = path.strip_prefix(plugins).unwrap_or(&path).to_string_lossy();
            texts.push((below.replace(std::path::MAIN_SEPARATOR, "/"), text));
        }
    }
    Ok(texts)
}

/// Takes out what an earlier copy has and this one has not: a compiler would find it.
fn prune(folder: &Path, texts: &BTreeMap<PathBuf, String>) -> Result<(), CopyError> {
    if !folder.exists() {
        return Ok(());
    }
    for path in read_folder(folder)? {
        if path.is_dir() {
            prune(&path, texts)?;
            // One that is empty goes as well; one that is not stays.
            let _ = fs::remove_dir(&path);
        } else if !texts.contains_key(&path) {
            fs::remove_file(&path).map_err(|cause| file_error(&path, cause))?;
        }
    }
    Ok(())
}

/// A plug-in's manifest, with what its changed code asks.
fn plugin_manifest(path: &Path) -> Result<String, CopyError> {
    let mut manifest = read_toml(path)?;
    // Nobody tests the copy, and what is wrong on purpose is no reason to warn.
    manifest.remove("dev-dependencies");
    manifest.remove("lints");
    let rust = table(table(&mut manifest, "lints"), "rust");
    rust.insert("warnings".to_owned(), "allow".into());
    table(&mut manifest, "dependencies").insert("softplug-mutant".to_owned(), workspace_value());
    Ok(manifest.to_string())
}

/// The workspace's manifest: the plug-ins are the copies, all else is where it was.
fn workspace_manifest(root: &Path) -> Result<String, CopyError> {
    let mut manifest = read_toml(&root.join("Cargo.toml"))?;
    let workspace = table(&mut manifest, "workspace");
    workspace.insert("members".to_owned(), Value::Array(vec!["plugins/*".into()]));
    workspace.remove("lints");
    for (_, dependency) in table(workspace, "dependencies").iter_mut() {
        let Some(path) = dependency.get_mut("path") else { continue };
        let is_plugin = path.as_str().is_some_and(|path| path.starts_with("plugins/"));
        if let (false, Some(below)) = (is_plugin, path.as_str()) {
            *path = root.join(below).to_string_lossy().into_owned().into();
        }
    }
    if let Some(Value::Table(profiles)) = manifest.get_mut("profile") {
        // It names packages that the copy does not have.
        profiles.remove("dev");
    }
    Ok(manifest.to_string())
}

fn workspace_value() -> Value {
    Value::Table(Table::from_iter([("workspace".to_owned(), Value::Boolean(true))]))
}

/// A table of a manifest; an empty one where it has none.
fn table<'a>(parent: &'a mut Table, name: &str) -> &'a mut Table {
    let value = parent.entry(name).or_insert_with(|| Value::Table(Table::new()));
    if !value.is_table() {
        *value = Value::Table(Table::new());
    }
    value.as_table_mut().expect("it was just made one")
}

fn read_toml(path: &Path) -> Result<Table, CopyError> {
    let text = fs::read_to_string(path).map_err(|cause| file_error(path, cause))?;
    text.parse().map_err(|cause: toml::de::Error| CopyError::Toml {
        path: path.to_owned(),
        cause: cause.into(),
    })
}

fn read_folder(folder: &Path) -> Result<Vec<PathBuf>, CopyError> {
    let entries = fs::read_dir(folder).and_then(|entries| {
        entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>()
    });
    entries.map_err(|cause| file_error(folder, cause))
}

fn write(path: &Path, text: &str) -> Result<(), CopyError> {
    if fs::read_to_string(path).is_ok_and(|there| there == text) {
        return Ok(());
    }
    let written = path.parent().map_or(Ok(()), fs::create_dir_all);
    written.and_then(|()| fs::write(path, text)).map_err(|cause| file_error(path, cause))
}

fn file_error(path: &Path, cause: io::Error) -> CopyError {
    CopyError::File { path: path.to_owned(), cause }
}
