//! The files of a new project. They stand in `templates` as those of a project that is called
//! `my-protocol`.

use include_dir::{Dir, include_dir};
use std::fmt::Write as _;

use super::Language;
use super::name::Name;
use super::origin::Origin;
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

static TRACES: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/templates/both/traces");

/// A file's path in the project, and what stands in it.
pub(super) type ProjectFile = (String, Vec<u8>);
type Template = (&'static str, &'static str);

const BOTH: &[Template] = &[
    (
        ".github/actions/softplug/action.yml",
        include_str!("../../../templates/both/github/action.yml"),
    ),
    ("ci/softplug.yml", include_str!("../../../templates/both/gitlab-softplug.yml")),
    (".gitignore", include_str!("../../../templates/both/gitignore")),
];
const RUST: &[Template] = &[
    (".cargo/config.toml", include_str!("../../../templates/rust/cargo-config.toml")),
    (".github/workflows/ci.yml", include_str!("../../../templates/rust/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/rust/gitlab-ci.yml")),
    ("Cargo.toml", include_str!("../../../templates/rust/Cargo.toml.in")),
];
const C: &[Template] = &[
    (".github/workflows/ci.yml", include_str!("../../../templates/c/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/c/gitlab-ci.yml")),
    ("src/softplug.h", include_str!("../../../templates/c/src/softplug.h")),
];
/// What begins from nothing.
const OWN: &[Template] = &[
    ("LICENSE", include_str!("../../../templates/both/LICENSE")),
    ("requirements/my-protocol.toml", include_str!("../../../templates/both/requirements.toml")),
];
const OWN_RUST: &[Template] = &[
    ("README.md", include_str!("../../../templates/rust/README.md")),
    ("src/buffer.rs", include_str!("../../../templates/rust/src/buffer.rs")),
    ("src/lib.rs", include_str!("../../../templates/rust/src/lib.rs")),
    ("src/receiver.rs", include_str!("../../../templates/rust/src/receiver.rs")),
    ("src/sender.rs", include_str!("../../../templates/rust/src/sender.rs")),
    ("tests/link.rs", include_str!("../../../templates/rust/tests/link.rs")),
];
const OWN_C: &[Template] = &[
    ("README.md", include_str!("../../../templates/c/README.md")),
    ("manifest.json", include_str!("../../../templates/c/manifest.json")),
    ("src/plugin.c", include_str!("../../../templates/c/src/plugin.c")),
];
/// What begins from a reference plug-in.
const FROM: &[Template] = &[
    ("LICENSE", include_str!("../../../templates/from/LICENSE")),
    ("README.md", include_str!("../../../templates/from/README.md")),
];

/// What a project is made for.
pub(super) struct Plan<'a> {
    pub(super) name: &'a Name,
    pub(super) language: Language,
    /// In Rust.
    pub(super) sdk: Option<&'a Sdk>,
    /// A reference plug-in, and the profile that it was asked for by.
    pub(super) origin: Option<(&'static Origin, &'a str)>,
}

impl Plan<'_> {
    /// All files, sorted by path.
    pub(super) fn files(&self) -> Vec<ProjectFile> {
        let (common, own) = match self.language {
            Language::Rust => (RUST, OWN_RUST),
            Language::C => (C, OWN_C),
        };
        let rest: Vec<&Template> = match self.origin {
            None => OWN.iter().chain(own).collect(),
            Some(_) => FROM.iter().collect(),
        };
        let templates = BOTH.iter().chain(common).chain(rest);
        let mut files: Vec<ProjectFile> = templates
            .map(|(path, text)| {
                let text =
                    if *path == "Cargo.toml" { self.cargo(text) } else { (*text).to_owned() };
                (self.named(path), self.named(&text).into_bytes())
            })
            .collect();
        match self.origin {
            None => {
                let trace = |file: &include_dir::File<'_>| {
                    let path = format!("traces/{NAME}/{}", file.path().display());
                    let text = file.contents_utf8().unwrap_or_default();
                    (self.named(&path), self.named(text).into_bytes())
                };
                files.extend(TRACES.files().map(trace));
            }
            Some((origin, _)) => {
                files.extend(
                    origin.corpus().into_iter().map(|(path, bytes)| (path, bytes.to_vec())),
                );
                let sources = origin.sources().into_iter();
                files.extend(sources.filter_map(|file| {
                    let path = file.path().to_str()?;
                    self.source(origin, path, file.contents_utf8()?)
                }));
            }
        }
        files.sort();
        files
    }

    /// A text of the templates with the names of this project.
    fn named(&self, text: &str) -> String {
        let (profile, reference) = match self.origin {
            Some((origin, profile)) => (profile, origin.name),
            None => (self.name.as_str(), ""),
        };
        text.replace(NAME, self.name.as_str())
            .replace(IDENTIFIER, &self.name.as_identifier())
            .replace(PROFILE, profile)
            .replace(REFERENCE, reference)
    }

    fn cargo(&self, text: &str) -> String {
        let Some(sdk) = self.sdk else { return text.to_owned() };
        let text = text.replace(DEPENDENCY, &sdk.dependency("sdk/plugin"));
        let Some((origin, _)) = self.origin else {
            let what = "Softplug plug-in: lines of text, each answered with ACK or NAK";
            return text.replace(DESCRIPTION, what);
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
        let (path, text) = match self.language {
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
