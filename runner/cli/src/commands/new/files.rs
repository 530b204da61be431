//! The files of a new project. They stand in `templates` as those of a project that is called
//! `my-protocol`.

use include_dir::{Dir, include_dir};
use std::fmt::Write as _;

use super::Language;
use super::like::Like;
use super::name::Name;
use super::origin::{Origin, files_below};
use super::sdk::Sdk;

/// The names in the templates.
const NAME: &str = "my-protocol";
const IDENTIFIER: &str = "my_protocol";
const PROFILE: &str = "my-profile";
const REFERENCE: &str = "my-reference";
const DESCRIPTION: &str = "my-description";
/// The beginning of the SDK's dependency in the templates.
const DEPENDENCY: &str = "{ version = \"0.1.0\"";
const LICENCE: &str = "license = \"MIT\"";
/// Crates that a plug-in needs beside the SDK stand before it.
const DEV_DEPENDENCIES: &str = "\n[dev-dependencies]";

static TRACES: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/templates/c/traces");

/// A file's path in the project, and what stands in it.
pub(super) type ProjectFile = (String, Vec<u8>);
type Template = (&'static str, &'static str);

const ALL: &[Template] = &[(".gitignore", include_str!("../../../templates/both/gitignore"))];
/// Certification as an action and as a job, for CI files that use it.
const CI: &[Template] = &[
    (
        ".github/actions/softplug/action.yml",
        include_str!("../../../templates/both/github/action.yml"),
    ),
    ("ci/softplug.yml", include_str!("../../../templates/both/gitlab-softplug.yml")),
];
const RUST: &[Template] = &[
    (".cargo/config.toml", include_str!("../../../templates/rust/cargo-config.toml")),
    ("Cargo.toml", include_str!("../../../templates/rust/Cargo.toml.in")),
];
const RUST_CI: &[Template] = &[
    (".github/workflows/ci.yml", include_str!("../../../templates/rust/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/rust/gitlab-ci.yml")),
];
const C: &[Template] = &[
    (".github/workflows/ci.yml", include_str!("../../../templates/c/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/c/gitlab-ci.yml")),
    ("src/softplug.h", include_str!("../../../templates/c/src/softplug.h")),
];
/// What begins from nothing.
const OWN_RUST: &[Template] = &[
    (".github/workflows/ci.yml", include_str!("../../../templates/like/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/like/gitlab-ci.yml")),
    ("README.md", include_str!("../../../templates/like/README.md")),
];
const OWN_C: &[Template] = &[
    ("LICENSE", include_str!("../../../templates/c/LICENSE")),
    ("README.md", include_str!("../../../templates/c/README.md")),
    ("manifest.json", include_str!("../../../templates/c/manifest.json")),
    ("requirements/my-protocol.toml", include_str!("../../../templates/c/requirements.toml")),
    ("src/plugin.c", include_str!("../../../templates/c/src/plugin.c")),
];
/// What begins from a reference plug-in.
const FROM: &[Template] = &[
    ("LICENSE", include_str!("../../../templates/from/LICENSE")),
    ("README.md", include_str!("../../../templates/from/README.md")),
];

/// What a project begins from.
#[derive(Copy, Clone)]
pub(super) enum Beginning {
    /// Nothing, in Rust: a small protocol of this kind.
    Rust(Like),
    /// Nothing, in C.
    C,
    /// A reference plug-in, and the profile that it was asked for by.
    From(&'static Origin, &'static str),
}

/// What a project is made for.
pub(super) struct Plan<'a> {
    pub(super) name: &'a Name,
    /// In Rust.
    pub(super) sdk: Option<&'a Sdk>,
    pub(super) beginning: Beginning,
}

impl Plan<'_> {
    /// All files, sorted by path.
    pub(super) fn files(&self) -> Vec<ProjectFile> {
        let (templates, folder): (&[&[Template]], _) = match self.beginning {
            Beginning::Rust(like) => (&[ALL, RUST, OWN_RUST], Some((like.files(), ""))),
            Beginning::C => (&[ALL, CI, C, OWN_C], Some((&TRACES, "traces/my-protocol/"))),
            Beginning::From(origin, _) if origin.language == Language::Rust => {
                (&[ALL, CI, RUST, RUST_CI, FROM], None)
            }
            Beginning::From(..) => (&[ALL, CI, C, FROM], None),
        };
        let mut files: Vec<ProjectFile> = templates
            .iter()
            .copied()
            .flatten()
            .map(|(path, text)| {
                let text =
                    if *path == "Cargo.toml" { self.cargo(text) } else { (*text).to_owned() };
                (self.named(path), self.named(&text).into_bytes())
            })
            .collect();
        if let Some((folder, place)) = folder {
            files.extend(files_below(folder).into_iter().map(|file| {
                let path = format!("{place}{}", file.path().display());
                let text = file.contents_utf8().unwrap_or_default();
                (self.named(&path), self.named(text).into_bytes())
            }));
        }
        if let Beginning::From(origin, _) = self.beginning {
            files.extend(origin.corpus().into_iter().map(|(path, bytes)| (path, bytes.to_vec())));
            let sources = origin.sources().into_iter();
            files.extend(sources.filter_map(|file| {
                let path = file.path().to_str()?;
                self.source(origin, path, file.contents_utf8()?)
            }));
        }
        files.sort();
        files
    }

    /// A text of the templates with the names of this project.
    fn named(&self, text: &str) -> String {
        let (profile, reference) = match self.beginning {
            Beginning::From(origin, profile) => (profile, origin.name),
            Beginning::Rust(_) | Beginning::C => (self.name.as_str(), ""),
        };
        text.replace(NAME, self.name.as_str())
            .replace(IDENTIFIER, &self.name.as_identifier())
            .replace(PROFILE, profile)
            .replace(REFERENCE, reference)
    }

    fn cargo(&self, text: &str) -> String {
        let Some(sdk) = self.sdk else { return text.to_owned() };
        let text = text.replace(DEPENDENCY, &sdk.dependency("sdk/plugin"));
        let origin = match self.beginning {
            Beginning::From(origin, _) => origin,
            Beginning::Rust(like) => return text.replace(DESCRIPTION, like.description()),
            Beginning::C => return text,
        };
        let mut crates = String::new();
        for (name, place) in origin.crates {
            let entry = if place.starts_with('{') {
                (*place).to_owned()
            } else {
                sdk.dependency(place) + " }"
            };
            let _ = writeln!(crates, "{name} = {entry}");
        }
        text.replace(DESCRIPTION, &format!("Softplug plug-in, begun from {}", origin.name))
            .replace(LICENCE, "license = \"MIT OR Apache-2.0\"")
            .replace(DEV_DEPENDENCIES, &(crates + DEV_DEPENDENCIES))
    }

    /// A source of a reference plug-in, which is to be called as the project is.
    fn source(&self, origin: &Origin, path: &str, text: &str) -> Option<ProjectFile> {
        let name = self.name.as_str();
        let (path, text) = match origin.language {
            Language::Rust => {
                let (from, to) = (origin.plugin, name);
                let head = |name: &str| format!("\",\"name\":\"{name}\",\"version\":");
                (format!("src/{path}"), text.replacen(&head(from), &head(to), 1))
            }
            Language::C if path == "xon_xoff.c" => {
                ("src/plugin.c".to_owned(), text.replace("\"../softplug.h\"", "\"softplug.h\""))
            }
            Language::C if path == "xon-xoff.json" => {
                let head = |name: &str| format!("\"name\": \"{name}\"");
                ("manifest.json".to_owned(), text.replacen(&head(origin.plugin), &head(name), 1))
            }
            // The protocol's core alone is another plug-in.
            Language::C => return None,
        };
        Some((path, text.into_bytes()))
    }
}
