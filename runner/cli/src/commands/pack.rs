//! `softplug pack`: makes a plug-in of a module that any compiler made.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;
use softplug_abi::limits::{MANIFEST_BYTES, MODULE_BYTES};
use softplug_abi::manifest::Manifest;
use softplug_build::{pack, without_spaces};
use softplug_host::{Host, HostOptions, Plugin, lint};

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::numbers;
use crate::plugin::load_failure;
use crate::screen::Screen;

/// Puts a manifest into a module and checks that the result is a plug-in.
///
/// A manifest that is there already is replaced. Nothing is written unless the result can be
/// loaded.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug pack my-plugin.wasm --manifest my-plugin.json
  softplug pack build/out.wasm --manifest my-plugin.json --strip --out my-plugin.wasm")]
pub(crate) struct Arguments {
    /// The module, a .wasm file
    #[arg(value_name = "FILE")]
    module: PathBuf,
    /// The manifest, a JSON file
    #[arg(long, value_name = "FILE")]
    manifest: PathBuf,
    /// Where to write the plug-in; without it the module is replaced
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Take out custom sections that no host needs
    #[arg(
        long,
        value_enum,
        value_name = "WHAT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "debug"
    )]
    strip: Option<Strip>,
}

/// What to take out, beside an earlier manifest.
#[derive(Copy, Clone, PartialEq, Eq, Debug, ValueEnum)]
enum Strip {
    /// Debug information and what compilers say of themselves; names of functions stay
    Debug,
    /// The names as well: the backtrace of a trap has none then
    All,
}

impl From<Strip> for softplug_build::Strip {
    fn from(strip: Strip) -> Self {
        match strip {
            Strip::Debug => Self::Debug,
            Strip::All => Self::All,
        }
    }
}

/// What machines get.
#[derive(Serialize)]
struct Document {
    file: String,
    name: String,
    version: String,
    sha256: String,
    size: usize,
    manifest_bytes: usize,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let file = &arguments.module;
    let module = files::read(file)?;
    let manifest = manifest(&arguments.manifest)?;
    let strip = arguments.strip.map_or(softplug_build::Strip::Nothing, Into::into);
    let packed = pack(&module, &manifest, strip).ok_or_else(|| no_module(file, &module))?;
    let plugin = check(file, &packed)?;
    let out = arguments.out.as_ref().unwrap_or(file);
    files::write(out, &packed)?;
    let inspection = plugin.inspection();
    let document = Document {
        file: out.display().to_string(),
        name: inspection.manifest.name.clone(),
        version: inspection.manifest.version.clone(),
        sha256: inspection.digest.to_string(),
        size: packed.len(),
        manifest_bytes: manifest.len(),
    };
    screen.say(format_args!(
        "{}: {} {}, {}, {} of them manifest",
        document.file,
        document.name,
        document.version,
        numbers::bytes(document.size as u64),
        numbers::count(document.manifest_bytes as u64)
    ));
    screen.document(&document);
    Ok(Exit::Done)
}

/// The manifest as it stands in the plug-in: checked, without the spaces between its parts.
pub(super) fn manifest(file: &Path) -> Result<Vec<u8>, Failure> {
    let written = files::read_text(file)?;
    let text = without_spaces(&written);
    // Messages tell places in the file as it is written.
    let checked = if written.len() > MANIFEST_BYTES { &text } else { &written };
    Manifest::parse(checked.as_bytes())
        .map_err(|error| Failure::plug_in(format_args!("{}: {error}", file.display())))?;
    Ok(text.into_bytes())
}

/// What cannot be taken apart is no module; the lint knows why.
pub(super) fn no_module(file: &Path, module: &[u8]) -> Failure {
    match lint(module) {
        Err(rule) => Failure::plug_in(format_args!("{}: {rule}", file.display())),
        Ok(_) => Failure::internal(format_args!("{} cannot be taken apart", file.display())),
    }
}

/// Loaded and asked for its mailbox, not only linted: then it can be started.
pub(super) fn check(file: &Path, packed: &[u8]) -> Result<Plugin, Failure> {
    let host = Host::new(HostOptions::default()).map_err(Failure::plug_in)?;
    let plugin = host.load_bytes(packed).map_err(|error| {
        let failure = load_failure(file, &error);
        if packed.len() > MODULE_BYTES {
            failure.hint("--strip takes out debug information")
        } else {
            failure
        }
    })?;
    plugin.instantiate().map_err(|error| load_failure(file, &error))?;
    Ok(plugin)
}
