//! What to change, and where, when a project's module is no plug-in.

use softplug_host::LintError;

use super::project::{Language, Project};
use crate::failure::Failure;

/// Of a crate without exports, which also has no panic handler.
pub(super) const NO_EXPORT: &str =
    "name your converter in src/lib.rs: softplug_plugin::export!(YourConverter);";

/// The failure with the hint for this project.
pub(super) fn of(project: &Project, rule: &LintError, failure: Failure) -> Failure {
    match hint(project.language(), rule) {
        Some(hint) => failure.hint(hint),
        None => failure,
    }
}

fn hint(language: Language, rule: &LintError) -> Option<&'static str> {
    use Language::{C, Rust};
    Some(match (rule, language) {
        (LintError::MissingExport(_) | LintError::ManifestMissing, Rust) => NO_EXPORT,
        (LintError::MissingExport(_), C) => {
            "include softplug.h in one of src/*.c, and link with --initial-memory"
        }
        (LintError::Manifest(_), Rust) => {
            "mend it where it is written: in manifest! and settings! of your converter, in src/lib.rs"
        }
        (LintError::Manifest(_), C) => "mend it in manifest.json",
        (LintError::Imports { .. }, Rust) => {
            "some crate calls what only a system has: use none that needs std, a clock or random numbers"
        }
        (LintError::Imports { .. }, C) => {
            "define the function, or do without it: nothing is linked in"
        }
        (LintError::MemoryGrows { .. } | LintError::TooManyPages { .. }, Rust) => {
            "the linker's options belong into .cargo/config.toml of the project, under \
             [target.wasm32v1-none]: -zstack-size=24576, --initial-memory=65536, --max-memory=65536"
        }
        (LintError::TooLarge { .. }, Rust) => {
            "in Cargo.toml, [profile.release]: opt-level = \"s\", lto = \"fat\", panic = \"abort\""
        }
        _ => return None,
    })
}
