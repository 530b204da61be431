//! A plug-in's project: what it is written in.

use std::path::{Path, PathBuf};

use super::{c, rust};
use crate::failure::Failure;

/// A project that can be built.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Project {
    root: PathBuf,
    language: Language,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Language {
    Rust,
    C,
}

impl Project {
    /// The project in a folder.
    pub(crate) fn find(root: &Path) -> Result<Self, Failure> {
        // So that messages name files as an author types them.
        let root = root.strip_prefix(".").unwrap_or(root);
        let language = if root.join(rust::MARK).is_file() {
            Language::Rust
        } else if root.join(c::MARK).is_file() {
            Language::C
        } else {
            return Err(Failure::usage(format_args!(
                "{} is no project of a plug-in: it has neither {} nor {}",
                if root.as_os_str().is_empty() { ".".into() } else { root.to_string_lossy() },
                rust::MARK,
                c::MARK
            ))
            .hint("`softplug new NAME` makes one; `softplug pack` takes modules of any compiler"));
        };
        Ok(Self { root: root.to_owned(), language })
    }

    /// Its folder; empty where it is the working one.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    pub(super) fn language(&self) -> Language {
        self.language
    }

    /// Files and folders in it that the plug-in is made of, and held against.
    pub(crate) fn sources(&self) -> impl Iterator<Item = &'static str> {
        let names: &[&str] = match self.language {
            Language::Rust => &[rust::MARK, ".cargo", "src", "traces"],
            Language::C => &[c::MARK, "src", "traces"],
        };
        names.iter().copied()
    }

    /// What the compiler makes of it, with its manifest, and where from.
    pub(super) fn compile(&self) -> Result<(PathBuf, Vec<u8>), Failure> {
        match self.language {
            Language::Rust => rust::compile(&self.root),
            Language::C => c::compile(&self.root),
        }
    }
}
