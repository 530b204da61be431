//! Plug-ins in C: clang and lld, and a manifest beside the sources.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::tool;
use crate::commands::pack;
use crate::failure::Failure;
use crate::files;
use crate::screen::Screen;

/// The file that tells such a project: the manifest.
pub(super) const MARK: &str = "manifest.json";
/// WebAssembly 1.0, one page of memory that never grows, names of functions kept for backtraces.
const OPTIONS: [&str; 12] = [
    "--target=wasm32",
    "-mcpu=mvp",
    "-Oz",
    "-ffreestanding",
    "-nostdlib",
    "-Wall",
    "-Wl,--no-entry",
    "-Wl,--strip-debug",
    "-Wl,--compress-relocations",
    "-Wl,-zstack-size=1024",
    "-Wl,--initial-memory=65536",
    "-Wl,--max-memory=65536",
];
const INSTALL: &str = "install clang and lld (on Debian: apt install clang lld)";

/// The module that clang makes of `src/*.c`, with the manifest in it.
pub(super) fn compile(root: &Path) -> Result<(PathBuf, Vec<u8>), Failure> {
    let folder = root.join("src");
    let sources = files::gather(std::slice::from_ref(&folder), "c")?;
    if sources.is_empty() {
        return Err(Failure::usage(format_args!("{} holds no .c file", folder.display())));
    }
    let manifest = pack::manifest(&root.join(MARK))?;
    let made = tempfile::tempdir();
    let made =
        made.map_err(|error| Failure::usage(format_args!("no temporary folder: {error}")))?;
    let file = made.path().join("plugin.wasm");
    let mut clang = Command::new("clang");
    clang.args(OPTIONS).arg("-o").arg(&file).args(&sources);
    let ran = tool::run(&mut clang, Path::new(""), INSTALL)?;
    let said = String::from_utf8_lossy(&ran.stderr);
    if !ran.status.success() {
        let failure = tool::does_not_compile(&said);
        return Err(if said.contains("undefined symbol") {
            failure.hint(
                "there is no C library: write the function, or use what softplug.h has (sp_copy)",
            )
        } else if said.contains("wasm-ld") && said.contains("unable to execute") {
            failure.hint(INSTALL)
        } else {
            failure
        });
    }
    // Warnings.
    if !said.is_empty() {
        Screen::pass_on(&said);
    }
    let module = files::read(&file)?;
    let packed = softplug_build::pack(&module, &manifest, softplug_build::Strip::Debug);
    let packed = packed.ok_or_else(|| pack::no_module(&file, &module))?;
    Ok((folder, packed))
}
