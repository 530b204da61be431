//! Binaryen's `wasm-opt`, where it is installed: modules some 10 % smaller.

use std::env;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::process::Command;

/// The program, of Debian's package `binaryen`.
const PROGRAM: &str = "wasm-opt";

/// An optimiser that can be run.
///
/// The example of [`shrink`](crate::shrink) shows one.
#[derive(Clone, Debug)]
pub struct Optimizer {
    program: PathBuf,
}

/// The optimiser could not be run, or failed.
///
/// ```
/// use softplug_build::OptimizeError;
///
/// let error = OptimizeError::Failed("[parse exception: surprising value]".to_owned());
/// assert_eq!(error.to_string(), "wasm-opt failed: [parse exception: surprising value]");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OptimizeError {
    /// It cannot be started, or its files cannot be written or read.
    #[error("{PROGRAM} cannot be run: {0}")]
    Run(#[from] io::Error),
    /// It did not take the module.
    #[error("{PROGRAM} failed: {0}")]
    Failed(String),
}

impl Optimizer {
    /// The one in PATH, if there is any.
    pub fn find() -> Option<Self> {
        let path = env::var_os("PATH")?;
        let name = format!("{PROGRAM}{}", env::consts::EXE_SUFFIX);
        let mut places = env::split_paths(&path).map(|folder| folder.join(&name));
        places.find(|file| file.is_file()).map(|program| Self { program })
    }

    /// The module, made smaller; its names stay.
    pub(crate) fn optimize(&self, module: &[u8]) -> Result<Vec<u8>, OptimizeError> {
        let folder = tempfile::tempdir()?;
        let (from, to) = (folder.path().join("in.wasm"), folder.path().join("out.wasm"));
        fs::write(&from, module)?;
        let mut command = Command::new(&self.program);
        // The features of `wasm32v1-none`, and no others.
        command.args(["-Oz", "--converge", "-g", "--mvp-features", "--enable-mutable-globals"]);
        // The lowest addresses are the far end of the stack: no pointer is near them, so
        // that adding to one never wraps.
        command.arg("--low-memory-unused");
        let ran = command.arg(&from).arg("-o").arg(&to).output()?;
        if !ran.status.success() {
            let said = String::from_utf8_lossy(&ran.stderr);
            return Err(OptimizeError::Failed(said.trim().to_owned()));
        }
        Ok(fs::read(&to)?)
    }
}
