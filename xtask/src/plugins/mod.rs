//! Builds the plug-ins and the command, and holds the plug-ins to their limits.

mod made;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use softplug_build::{Optimizer, ShrinkError, Size, memory, shrink};

use self::made::Made;
use crate::Error;
use crate::run::{cargo, succeed};
use crate::toolchain::{WASM_TARGET, ensure_target};
use crate::workspace::{Plugin, Workspace};

/// A release plug-in is at most so many bytes.
const MOST_BYTES: usize = 40 * 1024;
/// A plug-in declares at most so many pages of 64 KiB.
const MOST_PAGES: u64 = 4;

/// A built plug-in breaks its limits, or is not where it should be.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PluginError {
    #[error("the plug-in {name} has {bytes} bytes, {most} are allowed: make it smaller")]
    Size { name: String, bytes: usize, most: usize },
    #[error("the plug-in {name} may grow to {pages} pages of memory, {MOST_PAGES} are allowed")]
    Pages { name: String, pages: u64 },
    #[error("the plug-in {name} sets no upper limit to its memory: link it with --max-memory")]
    Unbounded { name: String },
    #[error("the plug-in {name} declares no memory")]
    NoMemory { name: String },
    #[error("{}: {cause}", path.display())]
    Shrink { path: PathBuf, cause: ShrinkError },
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
}

/// How to say how large the plug-ins are.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Report {
    /// A table on standard error.
    Table,
    /// A list on standard output.
    Json,
}

/// Builds every plug-in into `target/plugins/NAME.wasm`; tells their sizes.
pub(crate) fn build(workspace: &Workspace, report: Report) -> Result<Vec<Size>, Error> {
    ensure_target(WASM_TARGET)?;
    let plugins = workspace.plugins();
    let folder = workspace.plugin_folder();
    fs::create_dir_all(&folder).map_err(|cause| file_error(&folder, cause))?;
    compile(workspace, &plugins, "plugin", workspace.root())?;
    let optimizer = Optimizer::find();
    let most = if optimizer.is_some() { MOST_BYTES } else { usize::MAX };
    if optimizer.is_none() {
        eprintln!(
            "wasm-opt is not in PATH: the plug-ins work but are larger, and their size is not \
             looked at; install binaryen for those that are released"
        );
    }
    // All are put where they belong and listed before one over its limits fails.
    let mut sizes = Vec::new();
    let mut verdicts = Vec::new();
    for plugin in &plugins {
        let built = workspace.target().join(WASM_TARGET).join("plugin").join(&plugin.file);
        let out = folder.join(format!("{}.wasm", plugin.name));
        let made = Made::of(&built, &out, optimizer.as_ref());
        let made = made.map_err(|cause| file_error(&built, cause))?;
        let module = if made.is_current() {
            fs::read(&out).map_err(|cause| file_error(&out, cause))?
        } else {
            let module = fs::read(&built).map_err(|cause| file_error(&built, cause))?;
            let module = shrink(&module, optimizer.as_ref())
                .map_err(|cause| PluginError::Shrink { path: built, cause })?;
            replace(&out, &module).map_err(|cause| file_error(&out, cause))?;
            made.note().map_err(|cause| file_error(&out, cause))?;
            module
        };
        sizes.push(Size::of(&plugin.name, &module));
        verdicts.push(check(&plugin.name, &module, most));
    }
    match report {
        Report::Table => eprintln!("{}\n{}", folder.display(), Size::table(&sizes)),
        Report::Json => println!("{}", serde_json::json!(sizes)),
    }
    verdicts.into_iter().collect::<Result<(), _>>()?;
    Ok(sizes)
}

/// Builds every plug-in of these changed sources, with all of its mutants, into
/// `target/mutants/NAME.wasm`: for tests only, so that no limit of size binds them.
pub(crate) fn build_mutants(workspace: &Workspace, sources: &Path) -> Result<(), Error> {
    ensure_target(WASM_TARGET)?;
    let plugins = workspace.plugins();
    let folder = workspace.mutant_folder();
    fs::create_dir_all(&folder).map_err(|cause| file_error(&folder, cause))?;
    compile(workspace, &plugins, "mutant", sources)?;
    for plugin in &plugins {
        let built = workspace.target().join(WASM_TARGET).join("mutant").join(&plugin.file);
        let module = fs::read(&built).map_err(|cause| file_error(&built, cause))?;
        let out = folder.join(format!("{}.wasm", plugin.name));
        replace(&out, &module).map_err(|cause| file_error(&out, cause))?;
    }
    Ok(())
}

/// Builds the command, into `target/release` or `target/debug`.
pub(crate) fn build_command(workspace: &Workspace, dev: bool) -> Result<PathBuf, Error> {
    let mut command = cargo();
    command.current_dir(workspace.root()).args(["build", "-p", "softplug"]);
    if !dev {
        command.arg("--release");
    }
    succeed(&mut command)?;
    let built = built_command(workspace, dev);
    let bytes = fs::metadata(&built).map_err(|cause| file_error(&built, cause))?.len();
    eprintln!("{}: {bytes} bytes", built.display());
    Ok(built)
}

/// Where it builds the command.
pub(crate) fn built_command(workspace: &Workspace, dev: bool) -> PathBuf {
    let folder = if dev { "debug" } else { "release" };
    workspace.target().join(folder).join(format!("softplug{}", std::env::consts::EXE_SUFFIX))
}

/// Flags from the environment would replace those that bound the memory.
fn compile(
    workspace: &Workspace,
    plugins: &[Plugin],
    profile: &str,
    sources: &Path,
) -> Result<(), Error> {
    let mut command = cargo();
    command
        .current_dir(sources)
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .args(["build", "--profile", profile, "--target", WASM_TARGET, "--lib", "--target-dir"])
        .arg(workspace.target());
    // Cargo reads the settings of the folders above: those of a copy may lie elsewhere.
    if !sources.starts_with(workspace.root()) {
        command.arg("--config").arg(workspace.root().join(".cargo/config.toml"));
    }
    for plugin in plugins {
        command.args(["-p", &plugin.package]);
    }
    Ok(succeed(&mut command)?)
}

fn check(name: &str, module: &[u8], most: usize) -> Result<(), PluginError> {
    let name = name.to_owned();
    if module.len() > most {
        return Err(PluginError::Size { name, bytes: module.len(), most });
    }
    let Some(memory) = memory(module) else {
        return Err(PluginError::NoMemory { name });
    };
    let Some(pages) = memory.most else {
        return Err(PluginError::Unbounded { name });
    };
    if pages.max(memory.least) > MOST_PAGES {
        return Err(PluginError::Pages { name, pages: pages.max(memory.least) });
    }
    Ok(())
}

/// A reader sees the old file or the new one, never a part.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let part = path.with_extension(format!("wasm.{}.part", std::process::id()));
    fs::write(&part, bytes)?;
    fs::rename(&part, path)
}

fn file_error(path: &Path, cause: io::Error) -> PluginError {
    PluginError::File { path: path.to_owned(), cause }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &[u8] = b"\0asm\x01\0\0\0";

    /// A module of this length with this memory.
    fn module(memory: &[u8], length: usize) -> Vec<u8> {
        let mut module = [HEADER, &[5, memory.len() as u8], memory].concat();
        // A nameless custom section: its kind, three bytes of length, no name.
        let padding = length - module.len() - 4;
        module.extend([
            0,
            padding as u8 | 0x80,
            (padding >> 7) as u8 | 0x80,
            (padding >> 14) as u8,
        ]);
        module.resize(length, 0);
        module
    }

    #[test]
    fn limits_are_kept() {
        let check = |module: Vec<u8>| check("x", &module, MOST_BYTES);
        assert!(matches!(check(module(&[1, 1, 1, 4], MOST_BYTES)), Ok(())));
        let error = |module: Vec<u8>| check(module).unwrap_err().to_string();
        assert_eq!(
            error(module(&[1, 1, 1, 4], MOST_BYTES + 1)),
            "the plug-in x has 40961 bytes, 40960 are allowed: make it smaller"
        );
        assert_eq!(
            error(module(&[1, 1, 1, 5], 100)),
            "the plug-in x may grow to 5 pages of memory, 4 are allowed"
        );
        assert!(error(module(&[1, 0, 1], 100)).contains("no upper limit"));
        assert!(error(HEADER.to_vec()).contains("no memory"));
    }
}
