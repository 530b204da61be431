//! What the emulated computer boots from: Debian's kernel, and an image of the built command, the
//! plug-ins and the few programs beside them. It is put into `target/emulated`.

mod image;
mod packages;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::run;
use crate::workspace::Workspace;

pub(crate) use self::packages::Packages;

/// The emulator; tests that need it stand in modules of its name.
pub(crate) const QEMU: &str = "qemu-system-x86_64";

/// What else is needed of the system, with the Debian package that has it.
const PROGRAMS: [(&str, &str); 7] = [
    ("apt-cache", "apt"),
    ("apt-get", "apt"),
    ("dpkg-deb", "dpkg"),
    ("ip", "iproute2"),
    ("ldd", "libc-bin"),
    ("setpriv", "util-linux"),
    ("strip", "binutils"),
];

/// The image cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EmulatedError {
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("`{program}` needs the library {library}, which is not here: install its package")]
    Library { program: String, library: String },
    #[error("Debian's package linux-image-amd64 names no kernel here: run apt-get update")]
    NoKernel,
    #[error("`{program}`, which was there a moment ago, is not found any more")]
    Gone { program: &'static str },
    #[error("the package {package} has no {what}: it is not the one that this was written for")]
    Lacks { package: String, what: String },
    #[error("the image of the emulated computer cannot be packed: busybox cpio failed")]
    Packing,
}

/// Why no image can be made on this system; `None` if it can.
pub(crate) fn obstacle() -> Option<String> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Some("the emulated computer is made of this one's files: Debian on x86-64".into());
    }
    let missing = PROGRAMS.iter().find(|(program, _)| run::find(program).is_none());
    missing.map(|(program, package)| format!("`{program}` is missing (Debian package {package})"))
}

/// Makes kernel and image with this command, if anything in them has changed; gives their folder.
pub(crate) fn make(workspace: &Workspace, command: &Path) -> Result<PathBuf, Error> {
    let folder = workspace.target().join("emulated");
    fs::create_dir_all(&folder).map_err(|cause| file_error(&folder, cause))?;
    let packages = Packages::fetch(&folder.join("packages"))?;
    image::make(&folder, &packages, command, &workspace.plugin_folder())?;
    Ok(folder)
}

fn file_error(path: &Path, cause: io::Error) -> EmulatedError {
    EmulatedError::File { path: path.to_owned(), cause }
}
