//! Plug-ins in Rust: cargo, for `wasm32v1-none`.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::tool;
use crate::failure::Failure;
use crate::files;

/// Of a crate without exports, which also has no panic handler.
pub(super) const NO_EXPORT: &str =
    "name your converter in src/lib.rs: softplug_plugin::export!(YourConverter);";

/// The file that tells such a project.
pub(super) const MARK: &str = "Cargo.toml";
const TARGET: &str = "wasm32v1-none";
const INSTALL: &str = "https://rustup.rs tells how to install Rust";

/// The module that cargo makes of the project in `root`.
pub(super) fn compile(root: &Path) -> Result<(PathBuf, Vec<u8>), Failure> {
    check_target(root)?;
    let mut command = cargo();
    command
        // Flags from the environment would replace those that bound the memory.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .args(["build", "--release", "--lib", "--target", TARGET])
        .args(names_for_folders(root)?)
        .args(["--message-format", "json-render-diagnostics"]);
    let ran = tool::run(&mut command, root, INSTALL)?;
    let said = String::from_utf8_lossy(&ran.stderr);
    if !ran.status.success() {
        let failure = tool::does_not_compile(&said);
        // Before the SDK is on crates.io, or without a network.
        let lacks_sdk = said.contains("`softplug-plugin`") && said.contains("registry");
        return Err(if said.contains("#[panic_handler]") {
            failure.hint(NO_EXPORT)
        } else if lacks_sdk {
            failure.hint(
                "take the SDK from a clone of Softplug: in Cargo.toml, twice, \
                 softplug-plugin = { path = \"CLONE/sdk/plugin\" }; `softplug new --sdk CLONE` does that",
            )
        } else {
            failure
        });
    }
    let messages = String::from_utf8_lossy(&ran.stdout);
    let file = messages.lines().filter_map(module).next_back().ok_or_else(|| {
        Failure::plug_in(format_args!("{} makes no module", root.join(MARK).display()))
            .hint("it needs, under [lib]: crate-type = [\"cdylib\", \"rlib\"]")
    })?;
    let module = files::read(&file)?;
    Ok((file, module))
}

fn cargo() -> Command {
    Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Where a panic was is told by file and line: of the crates that the project uses, by their name in place of the
/// folder in which they lie here. So a module is the same from every machine.
///
/// The flags join those of the target in the project's own configuration. Where that has none, they would take the
/// place of flags that stand elsewhere, and so there are none here either.
fn names_for_folders(root: &Path) -> Result<Vec<String>, Failure> {
    if !has_flags_for_target(root) {
        return Ok(Vec::new());
    }
    let mut command = cargo();
    command.args(["metadata", "--format-version", "1", "--filter-platform", TARGET]);
    let ran = tool::run(&mut command, root, INSTALL)?;
    // What is wrong with the project, the build says.
    let Ok(project) = serde_json::from_slice::<Value>(&ran.stdout) else { return Ok(Vec::new()) };
    Ok(vec!["--config".to_owned(), format!("target.{TARGET}.rustflags={}", flags(&project))])
}

fn has_flags_for_target(root: &Path) -> bool {
    let file = root.join(".cargo/config.toml");
    let text = files::read_text(&file).unwrap_or_default();
    let configuration = text.parse::<toml::Table>().unwrap_or_default();
    let of_target = configuration.get("target").and_then(|targets| targets.get(TARGET));
    of_target.is_some_and(|target| target.get("rustflags").is_some())
}

/// A flag for each package that is none of the project's own.
fn flags(project: &Value) -> Value {
    let own = project["workspace_members"].as_array();
    let packages = project["packages"].as_array().into_iter().flatten();
    let flag = |package: &Value| {
        let folder = Path::new(package["manifest_path"].as_str()?).parent()?;
        let name = package["name"].as_str()?;
        let is_own = own.is_some_and(|own| own.contains(&package["id"]));
        (!is_own).then(|| format!("--remap-path-prefix={}={name}", folder.display()))
    };
    packages.filter_map(flag).collect()
}

/// The .wasm file in a message of cargo, if it is about one.
fn module(message: &str) -> Option<PathBuf> {
    let message: Value = serde_json::from_str(message).ok()?;
    if message["reason"] != "compiler-artifact" {
        return None;
    }
    let files = message["filenames"].as_array()?.iter().filter_map(Value::as_str);
    files.map(PathBuf::from).find(|file| file.extension().is_some_and(|is| is == "wasm"))
}

/// cargo's own message on a missing target is long and says little.
fn check_target(root: &Path) -> Result<(), Failure> {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut command = Command::new(rustc);
    command.args(["--print", "target-libdir", "--target", TARGET]);
    // In the project: it may name a toolchain of its own.
    let ran = tool::run(&mut command, root, INSTALL)?;
    let folder = String::from_utf8_lossy(&ran.stdout);
    if ran.status.success() && Path::new(folder.trim()).is_dir() {
        return Ok(());
    }
    Err(Failure::usage(format_args!("the target {TARGET} is not installed"))
        .hint(format_args!("rustup target add {TARGET}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_crates_of_others_are_called_by_name() {
        let project = serde_json::json!({
            "workspace_members": ["path+file:///p#mine@0.1.0"],
            "packages": [
                {"id": "path+file:///p#mine@0.1.0", "name": "mine", "manifest_path": "/p/Cargo.toml"},
                {"id": "registry+x#sdk@1.0.0", "name": "sdk", "manifest_path": "/r/sdk-1.0.0/Cargo.toml"},
            ],
        });
        assert_eq!(flags(&project), serde_json::json!(["--remap-path-prefix=/r/sdk-1.0.0=sdk"]));
        assert_eq!(flags(&Value::Null), serde_json::json!([]));
    }

    #[test]
    fn flags_are_added_only_to_those_of_the_target() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!has_flags_for_target(folder.path()));
        std::fs::create_dir(folder.path().join(".cargo")).unwrap();
        for (text, has_flags) in [
            ("[build]\nrustflags = []", false),
            ("[target.wasm32v1-none]\nlinker = 'x'", false),
            ("[target", false),
            ("[target.wasm32v1-none]\nrustflags = []", true),
        ] {
            std::fs::write(folder.path().join(".cargo/config.toml"), text).unwrap();
            assert_eq!(has_flags_for_target(folder.path()), has_flags, "{text}");
        }
    }

    #[test]
    fn the_module_is_found_among_cargos_messages() {
        let message = r#"{"reason":"compiler-artifact","filenames":["/t/a.rlib","/t/a.wasm"]}"#;
        assert_eq!(module(message), Some(PathBuf::from("/t/a.wasm")));
        for other in [
            r#"{"reason":"compiler-artifact","filenames":["/t/liba.rlib"]}"#,
            r#"{"reason":"build-finished","filenames":["/t/a.wasm"]}"#,
            "warning: text",
        ] {
            assert_eq!(module(other), None, "{other}");
        }
    }
}
