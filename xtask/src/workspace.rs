//! What cargo knows of the workspace: its plug-ins, benchmarks and folders.

use std::path::{Path, PathBuf};

use cargo_metadata::{MetadataCommand, Package, Target, TargetKind};

/// cargo does not understand the workspace.
#[derive(Debug, thiserror::Error)]
#[error("the workspace cannot be read: {0}")]
pub(crate) struct WorkspaceError(#[from] Box<cargo_metadata::Error>);

/// The workspace's own packages.
pub(crate) struct Workspace {
    packages: Vec<Package>,
    root: PathBuf,
    target: PathBuf,
}

/// A plug-in of the workspace.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Plugin {
    /// The name of its folder under `plugins/`.
    pub(crate) name: String,
    /// Its package.
    pub(crate) package: String,
    /// The file that cargo makes of it.
    pub(crate) file: String,
}

impl Workspace {
    /// Asks the cargo in use about the workspace that this crate is built in.
    pub(crate) fn read() -> Result<Self, WorkspaceError> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
        let metadata =
            MetadataCommand::new().manifest_path(manifest).no_deps().exec().map_err(Box::new)?;
        Ok(Self {
            root: metadata.workspace_root.clone().into(),
            target: metadata.target_directory.clone().into(),
            packages: metadata.workspace_packages().into_iter().cloned().collect(),
        })
    }

    /// The top folder.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// Where cargo builds.
    pub(crate) fn target(&self) -> &Path {
        &self.target
    }

    /// Where the built plug-ins are put.
    pub(crate) fn plugin_folder(&self) -> PathBuf {
        self.target.join("plugins")
    }

    /// Where the plug-ins with their mutants are put.
    pub(crate) fn mutant_folder(&self) -> PathBuf {
        self.target.join("mutants")
    }

    /// Where the playground's page is put.
    pub(crate) fn playground(&self) -> PathBuf {
        self.target.join("playground.html")
    }

    /// The members under `plugins/` that make a module.
    pub(crate) fn plugins(&self) -> Vec<Plugin> {
        let mut plugins: Vec<_> = self.packages.iter().filter_map(|p| self.plugin(p)).collect();
        plugins.sort_by(|a, b| a.name.cmp(&b.name));
        plugins
    }

    /// All benchmarks, as package and target.
    pub(crate) fn benches(&self) -> Vec<(String, String)> {
        self.targets(|target| target.kind.contains(&TargetKind::Bench))
    }

    /// The tests of a package that run random cases: their names end in `_fuzz`.
    pub(crate) fn fuzz_tests(&self, package: &str) -> Vec<String> {
        let tests = self.targets(|target| {
            target.kind.contains(&TargetKind::Test) && target.name.ends_with("_fuzz")
        });
        tests.into_iter().filter(|(of, _)| of == package).map(|(_, name)| name).collect()
    }

    /// The package that has an example of this name.
    pub(crate) fn package_of_example(&self, name: &str) -> Option<String> {
        let examples = self
            .targets(|target| target.kind.contains(&TargetKind::Example) && target.name == name);
        examples.into_iter().next().map(|(package, _)| package)
    }

    fn plugin(&self, package: &Package) -> Option<Plugin> {
        let folder = package.manifest_path.parent()?;
        if folder.parent()?.as_std_path() != self.root.join("plugins") {
            return None;
        }
        let target = package.targets.iter().find(|t| t.kind.contains(&TargetKind::CDyLib))?;
        Some(Plugin {
            name: folder.file_name()?.to_owned(),
            package: package.name.to_string(),
            file: format!("{}.wasm", target.name.replace('-', "_")),
        })
    }

    fn targets(&self, wanted: impl Fn(&Target) -> bool) -> Vec<(String, String)> {
        let mut found = Vec::new();
        for package in &self.packages {
            for target in package.targets.iter().filter(|&target| wanted(target)) {
                found.push((package.name.to_string(), target.name.clone()));
            }
        }
        found.sort();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_under_plugins_are_plug_ins_and_libraries_are_none() {
        let plugins = Workspace::read().unwrap().plugins();
        let xon_xoff = Plugin {
            name: "xon-xoff".into(),
            package: "softplug-xon-xoff".into(),
            file: "xon_xoff.wasm".into(),
        };
        assert!(plugins.contains(&xon_xoff), "{plugins:?}");
        for name in ["fanuc-rs232", "r3964", "r3964-simplified"] {
            assert!(plugins.iter().any(|plugin| plugin.name == name), "{name}: {plugins:?}");
        }
        for library in ["native", "procedure-3964"] {
            assert!(plugins.iter().all(|plugin| plugin.name != library), "{plugins:?}");
        }
    }
}
