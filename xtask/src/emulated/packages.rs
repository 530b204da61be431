//! Debian packages that are unpacked below `target` and not installed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{EmulatedError, file_error};
use crate::Error;
use crate::run;

/// What names the kernel that Debian has at present.
const KERNEL: &str = "linux-image-amd64";
/// The programs beside the command.
const PROGRAMS: [&str; 2] = ["busybox-static", "udev"];
/// Written when all is there: its lines are the packages.
const COMPLETE: &str = "complete";

/// The unpacked packages.
pub(crate) struct Packages {
    root: PathBuf,
    kernel: String,
}

impl Packages {
    /// Fetches and unpacks them into `folder`, unless they are there from an earlier time.
    pub(crate) fn fetch(folder: &Path) -> Result<Self, Error> {
        let root = folder.join("root");
        if let Ok(list) = fs::read_to_string(folder.join(COMPLETE))
            && let Some(kernel) = list.lines().next()
        {
            return Ok(Self { root, kernel: kernel.to_owned() });
        }
        if folder.exists() {
            fs::remove_dir_all(folder).map_err(|cause| file_error(folder, cause))?;
        }
        fs::create_dir_all(&root).map_err(|cause| file_error(&root, cause))?;
        let depends = run::output(Command::new("apt-cache").args(["depends", KERNEL]))?;
        let kernel = first_dependency(&depends).ok_or(EmulatedError::NoKernel)?;
        let mut download = Command::new("apt-get");
        download.current_dir(folder).args(["download", kernel]).args(PROGRAMS);
        run::succeed(&mut download)?;
        let entries = fs::read_dir(folder).map_err(|cause| file_error(folder, cause))?;
        for entry in entries {
            let file = entry.map_err(|cause| file_error(folder, cause))?.path();
            if file.extension().is_some_and(|extension| extension == "deb") {
                run::succeed(Command::new("dpkg-deb").arg("-x").args([&file, &root]))?;
                fs::remove_file(&file).map_err(|cause| file_error(&file, cause))?;
            }
        }
        let complete = folder.join(COMPLETE);
        let list = format!("{kernel}\n{}\n", PROGRAMS.join("\n"));
        fs::write(&complete, list).map_err(|cause| file_error(&complete, cause))?;
        Ok(Self { root, kernel: kernel.to_owned() })
    }

    /// The package of the kernel.
    pub(crate) fn kernel(&self) -> &str {
        &self.kernel
    }

    /// A file of theirs.
    pub(crate) fn file(&self, path: &str) -> Result<PathBuf, EmulatedError> {
        let file = self.root.join(path);
        if file.is_file() {
            return Ok(file);
        }
        let package = format!("{}, {}", self.kernel, PROGRAMS.join(" or "));
        Err(EmulatedError::Lacks { package, what: path.to_owned() })
    }

    /// The version of the kernel, as its folders are named.
    pub(crate) fn kernel_version(&self) -> &str {
        self.kernel.strip_prefix("linux-image-").unwrap_or(&self.kernel)
    }
}

/// The first package that one depends on, in the words of `apt-cache depends`.
fn first_dependency(depends: &str) -> Option<&str> {
    depends.lines().find_map(|line| line.trim().strip_prefix("Depends: "))
}

#[cfg(test)]
mod tests {
    use super::first_dependency;

    #[test]
    fn the_kernel_is_what_its_package_depends_on() {
        let said = "linux-image-amd64\n  Depends: linux-image-6.1.0-56-amd64\n  Conflicts: x\n";
        assert_eq!(first_dependency(said), Some("linux-image-6.1.0-56-amd64"));
        assert_eq!(first_dependency("linux-image-amd64\n"), None);
    }
}
