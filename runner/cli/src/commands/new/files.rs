//! The files of a new project. They stand in `templates` as those of a project that is called
//! `my-protocol`.

use include_dir::{Dir, include_dir};

use super::name::Name;
use super::sdk::Sdk;

/// The name in the templates.
const NAME: &str = "my-protocol";
const IDENTIFIER: &str = "my_protocol";
/// The beginning of the SDK's dependency in the templates.
const DEPENDENCY: &str = "{ version = \"0.1.0\"";

static TRACES: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/templates/both/traces");

/// A file's path in the project, and its text.
type Template = (&'static str, &'static str);

const BOTH: &[Template] = &[
    (
        ".github/actions/softplug/action.yml",
        include_str!("../../../templates/both/github/action.yml"),
    ),
    ("ci/softplug.yml", include_str!("../../../templates/both/gitlab-softplug.yml")),
    (".gitignore", include_str!("../../../templates/both/gitignore")),
    ("LICENSE", include_str!("../../../templates/both/LICENSE")),
    ("requirements/my-protocol.toml", include_str!("../../../templates/both/requirements.toml")),
];

const RUST: &[Template] = &[
    (".cargo/config.toml", include_str!("../../../templates/rust/cargo-config.toml")),
    (".github/workflows/ci.yml", include_str!("../../../templates/rust/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/rust/gitlab-ci.yml")),
    ("Cargo.toml", include_str!("../../../templates/rust/Cargo.toml.in")),
    ("README.md", include_str!("../../../templates/rust/README.md")),
    ("src/buffer.rs", include_str!("../../../templates/rust/src/buffer.rs")),
    ("src/lib.rs", include_str!("../../../templates/rust/src/lib.rs")),
    ("src/receiver.rs", include_str!("../../../templates/rust/src/receiver.rs")),
    ("src/sender.rs", include_str!("../../../templates/rust/src/sender.rs")),
    ("tests/link.rs", include_str!("../../../templates/rust/tests/link.rs")),
];

const C: &[Template] = &[
    (".github/workflows/ci.yml", include_str!("../../../templates/c/github-ci.yml")),
    (".gitlab-ci.yml", include_str!("../../../templates/c/gitlab-ci.yml")),
    ("README.md", include_str!("../../../templates/c/README.md")),
    ("manifest.json", include_str!("../../../templates/c/manifest.json")),
    ("src/plugin.c", include_str!("../../../templates/c/src/plugin.c")),
    ("src/softplug.h", include_str!("../../../templates/c/src/softplug.h")),
];

/// Paths and texts, sorted by path. In Rust with an SDK, in C without.
pub(super) fn of(name: &Name, sdk: Option<&Sdk>) -> Vec<(String, String)> {
    let own = if sdk.is_some() { RUST } else { C };
    let traces = TRACES.files().filter_map(|file| {
        let path = format!("traces/{NAME}/{}", file.path().display());
        Some((path, file.contents_utf8()?))
    });
    let templates = BOTH.iter().chain(own).map(|(path, text)| ((*path).to_owned(), *text));
    let named =
        |text: &str| text.replace(NAME, name.as_str()).replace(IDENTIFIER, &name.as_identifier());
    let mut files: Vec<_> = templates
        .chain(traces)
        .map(|(path, text)| {
            let mut text = named(text);
            if let Some(sdk) = sdk.filter(|_| path == "Cargo.toml") {
                text = text.replace(DEPENDENCY, &sdk.dependency());
            }
            (named(&path), text)
        })
        .collect();
    files.sort();
    files
}
