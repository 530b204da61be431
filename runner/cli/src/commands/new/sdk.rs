//! Where a project in Rust takes its SDK from.

use std::env;
use std::fmt;
use std::path::{Path, PathBuf};

use crate::failure::Failure;

const VARIABLE: &str = "SOFTPLUG_SDK";
/// The crate by which a clone of Softplug is known.
const CRATE: &str = "sdk/plugin";

/// Where the crates of Softplug are.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Sdk {
    /// In a clone: its folder, from the root.
    Clone(String),
    /// On crates.io.
    Version(&'static str),
}

impl Sdk {
    /// The clone that is named, or the one that this command was built in, or crates.io.
    pub(super) fn find(named: Option<&Path>) -> Result<Self, Failure> {
        let variable = env::var_os(VARIABLE).filter(|folder| !folder.is_empty());
        if let Some(clone) = named.map(Path::to_owned).or(variable.map(PathBuf::from)) {
            return Self::in_clone(&clone);
        }
        let executable = env::current_exe().ok();
        let around = executable.iter().flat_map(|file| file.ancestors()).find(|at| has_crate(at));
        around.map_or(Ok(Self::Version(env!("CARGO_PKG_VERSION"))), Self::in_clone)
    }

    fn in_clone(clone: &Path) -> Result<Self, Failure> {
        let shown = clone.display();
        if !has_crate(clone) {
            return Err(Failure::usage(format_args!(
                "{shown} is no clone of Softplug: it has no {CRATE}/Cargo.toml"
            )));
        }
        // From the root: it holds wherever the project is moved.
        let folder = clone.canonicalize();
        let folder = folder.map_err(|error| {
            Failure::usage(format_args!("{shown} cannot be used as the SDK: {error}"))
        })?;
        folder.to_str().map(|text| Self::Clone(text.to_owned())).ok_or_else(|| {
            Failure::usage(format_args!("{shown} cannot stand in Cargo.toml: it is not UTF-8"))
        })
    }

    /// The value of a dependency in `Cargo.toml`, without closing brace; `place` is the crate's
    /// folder in a clone.
    pub(super) fn dependency(&self, place: &str) -> String {
        match self {
            // What JSON escapes, TOML reads.
            Self::Clone(folder) => {
                format!("{{ path = {}", serde_json::json!(format!("{folder}/{place}")))
            }
            Self::Version(version) => format!("{{ version = \"{version}\""),
        }
    }
}

impl fmt::Display for Sdk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clone(folder) => write!(f, "that in {folder}"),
            Self::Version(version) => write!(f, "that of crates.io, version {version}"),
        }
    }
}

fn has_crate(folder: &Path) -> bool {
    folder.join(CRATE).join("Cargo.toml").is_file()
}
