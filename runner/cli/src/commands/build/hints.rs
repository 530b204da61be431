//! What to change, and where, when a project's module is no plug-in.

use softplug_abi::MANIFEST_SECTION;
use softplug_abi::manifest::ManifestError;
use softplug_build::{Kind, sections};
use softplug_host::LintError;

use super::project::{Language, Project};
use super::rust::NO_EXPORT;
use crate::failure::Failure;

/// Where the manifest of a plug-in in Rust is written.
const IN_MACROS: &str =
    "mend it where it is written: in manifest! and settings! of your converter, in src/lib.rs";

/// Bytes of a manifest that are shown on either side of a fault.
const AROUND: usize = 30;

/// The failure with the hint for this project.
pub(super) fn of(project: &Project, rule: &LintError, module: &[u8], failure: Failure) -> Failure {
    // The place is one in a text that no file has: it is made of pieces.
    if let LintError::Manifest(ManifestError::Json(said)) = rule
        && let Some(text) = excerpt(module, said)
    {
        return failure.hint(format_args!("it reads there: {text}; {IN_MACROS}"));
    }
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
        (LintError::Manifest(_), Rust) => IN_MACROS,
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

/// What stands in the manifest around the line and column that a message ends with.
fn excerpt(module: &[u8], said: &str) -> Option<String> {
    let (said, column) = said.rsplit_once(" column ")?;
    let (_, line) = said.rsplit_once(" line ")?;
    let (line, column): (usize, usize) = (line.parse().ok()?, column.parse().ok()?);
    let sections = sections(module)?;
    let manifest = sections.iter().find(|of| of.kind == Kind::Custom(MANIFEST_SECTION))?;
    let line = manifest.content.split(|byte| *byte == b'\n').nth(line.checked_sub(1)?)?;
    let around = line.get(column.saturating_sub(AROUND)..line.len().min(column + AROUND))?;
    // A character may be cut at the ends.
    let text = String::from_utf8_lossy(around);
    let shown = text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c });
    Some(format!("…{}…", shown.collect::<String>()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_build::{Strip, pack};

    #[test]
    fn a_fault_in_a_manifest_is_shown_with_what_is_around_it() {
        let manifest = format!("{{\"a\":\n\"{}\":soon}}", "b".repeat(40));
        let module = pack(b"\0asm\x01\0\0\0", manifest.as_bytes(), Strip::Nothing).unwrap();
        let shown = excerpt(&module, "expected value at line 2 column 44").unwrap();
        assert_eq!(shown, format!("…{}\":soon}}…", "b".repeat(27)));
        for other in
            ["expected value", "at line 3 column 1", "at line 0 column 1", "at line 1 column 99"]
        {
            assert_eq!(excerpt(&module, other), None, "{other}");
        }
    }
}
