//! `softplug build`: the plug-in of a project, as it is released.

mod c;
mod hints;
mod project;
mod rust;
mod tool;

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use softplug_build::{Optimizer, Size, shrink};
use softplug_host::{Host, HostOptions, Plugin, lint};

pub(crate) use self::project::Project;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::screen::Screen;

/// Builds the plug-in of a project: small, with its manifest, checked as a gateway checks it.
///
/// In Rust with cargo for wasm32v1-none, in C with clang. The module is made smaller (with
/// wasm-opt where there is one), checked and started, and tells what its bytes are spent on.
/// Nothing is written unless it can be loaded.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug build
  softplug build my-machine --out my-machine.wasm
  softplug build --json")]
pub(crate) struct Arguments {
    /// Folder of the project: with a Cargo.toml, or with manifest.json and src/*.c
    #[arg(value_name = "DIR", default_value = ".")]
    project: PathBuf,
    /// Where to write the plug-in; target/plugins/NAME.wasm of the project if nothing is said
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// What machines get.
#[derive(Serialize)]
struct Document<'a> {
    file: String,
    version: &'a str,
    sha256: String,
    /// Whether wasm-opt made it smaller.
    optimized: bool,
    #[serde(flatten)]
    size: &'a Size,
}

/// A plug-in that was built and can be loaded.
pub(crate) struct Built {
    pub(crate) file: PathBuf,
    pub(crate) plugin: Plugin,
    pub(crate) module: Vec<u8>,
    optimized: bool,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let project = Project::find(&arguments.project)?;
    let built = build(&project, arguments.out.as_deref())?;
    let manifest = built.plugin.manifest();
    let size = Size::of(&manifest.name, &built.module);
    screen.say(format_args!(
        "{}\n{}",
        built.file.display(),
        Size::table(std::slice::from_ref(&size))
    ));
    if !built.optimized {
        screen.note(
            "wasm-opt is not in PATH: the plug-in works but is larger; install binaryen for one \
             that is released",
        );
    }
    screen.document(&Document {
        file: built.file.display().to_string(),
        version: &manifest.version,
        sha256: built.plugin.digest().to_string(),
        optimized: built.optimized,
        size: &size,
    });
    Ok(Exit::Done)
}

/// Builds the plug-in and puts it where it belongs.
pub(crate) fn build(project: &Project, out: Option<&Path>) -> Result<Built, Failure> {
    let host = Host::new(HostOptions::default()).map_err(Failure::plug_in)?;
    let (compiled, module) = project.compile()?;
    let fail = |why: &dyn std::fmt::Display| {
        Failure::plug_in(format_args!("{}: {why}", compiled.display()))
    };
    // Told of what the compiler made: nothing else was done to it yet.
    lint(&module).map_err(|rule| hints::of(project, &rule, &module, fail(&rule)))?;
    let optimizer = Optimizer::find();
    let module = shrink(&module, optimizer.as_ref()).map_err(|error| fail(&error))?;
    let plugin = host.load_bytes(&module).map_err(|error| fail(&error))?;
    // Started, and not only compiled: then it has a mailbox.
    plugin.instantiate().map_err(|error| fail(&error))?;
    let file = match out {
        Some(file) => file.to_owned(),
        None => {
            project.root().join("target/plugins").join(format!("{}.wasm", plugin.manifest().name))
        }
    };
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        fs::create_dir_all(folder).map_err(|error| files::unwritable(folder, &error))?;
    }
    files::write(&file, &module)?;
    Ok(Built { file, plugin, module, optimized: optimizer.is_some() })
}
