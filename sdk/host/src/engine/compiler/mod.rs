//! Compiling in a process of its own, with limits of memory and time.
//!
//! The lint estimates what a module costs a compiler; what it does not foresee ends here, and with
//! it only that process. The other side of the pipe is [`run`], in this same program: its
//! code comes back over a pipe that nobody else has, in the form of a cache file, so that it is
//! bound to module, engine, version and settings like one.

mod child;
mod parent;

pub use child::run;
pub(crate) use parent::{Failed, compile};

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

/// Where plug-ins are compiled: a program that calls [`run`] and nothing else when it is
/// started with these arguments. Usually it is the host's own.
///
/// ```standalone_crate
/// use softplug_host::compiler::{self, CompilerProcess};
/// use softplug_host::{Host, HostOptions};
///
/// fn main() -> Result<(), Box<dyn std::error::Error>> {
///     // The first thing that the program does.
///     if std::env::args().nth(1).as_deref() == Some("__compile") {
///         return Ok(compiler::run()?);
///     }
///     let compiler = Some(CompilerProcess::this_program(["__compile"])?);
///     let host = Host::new(HostOptions { compiler, ..HostOptions::default() })?;
/// #   let wasm = wat::parse_file("tests/guests/echo.wat")?;
///     let plugin = host.load_bytes(&wasm)?;
///     plugin.instantiate()?;
///     Ok(())
/// }
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CompilerProcess {
    program: PathBuf,
    arguments: Vec<OsString>,
    limits: CompileLimits,
    in_background: bool,
}

/// What compiling one plug-in may take. More is the plug-in's fault.
///
/// ```
/// use softplug_host::compiler::CompileLimits;
/// use std::time::Duration;
///
/// // A slow computer.
/// let limits = CompileLimits { computing: Duration::from_secs(10), ..CompileLimits::default() };
/// assert!(limits.patience > limits.computing);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct CompileLimits {
    /// Time of computing, whatever else the computer does meanwhile.
    pub computing: Duration,
    /// Memory in bytes, beside the program's own code. Held to on Unix.
    pub memory: u64,
    /// Time as clocks have it, for a computer that is busy with other things. Past it the
    /// compiler, and not the plug-in, has failed.
    pub patience: Duration,
}

impl Default for CompileLimits {
    /// 1.5 s of computing, 128 MiB, two minutes.
    fn default() -> Self {
        Self {
            computing: Duration::from_millis(1_500),
            memory: 128 << 20,
            patience: Duration::from_mins(2),
        }
    }
}

static OF_THIS_PROCESS: OnceLock<CompilerProcess> = OnceLock::new();

impl CompilerProcess {
    /// A program that compiles when it is given these arguments.
    pub fn new(program: &Path, arguments: impl IntoIterator<Item = impl Into<OsString>>) -> Self {
        Self {
            program: program.to_owned(),
            arguments: arguments.into_iter().map(Into::into).collect(),
            limits: CompileLimits::default(),
            in_background: false,
        }
    }

    /// This very program, also if its file has been replaced meanwhile (on Linux).
    ///
    /// # Errors
    /// The system does not tell which file that is.
    pub fn this_program(
        arguments: impl IntoIterator<Item = impl Into<OsString>>,
    ) -> std::io::Result<Self> {
        let itself = Path::new("/proc/self/exe");
        if cfg!(target_os = "linux") && itself.exists() {
            return Ok(Self::new(itself, arguments));
        }
        Ok(Self::new(&std::env::current_exe()?, arguments))
    }

    /// This compiler with other limits.
    #[must_use]
    pub fn limited(self, limits: CompileLimits) -> Self {
        Self { limits, ..self }
    }

    /// This compiler at a lower priority (on Unix): for a program that serves machines meanwhile.
    #[must_use]
    pub fn in_background(self) -> Self {
        Self { in_background: true, ..self }
    }

    /// Makes it that of all hosts of this process that are not given another:
    /// [`HostOptions::default`](crate::HostOptions::default) has it from now on. The first one
    /// counts.
    pub fn install(self) {
        // Somebody was first: documented.
        let _ = OF_THIS_PROCESS.set(self);
    }

    /// What was installed, if anything was.
    pub fn installed() -> Option<Self> {
        OF_THIS_PROCESS.get().cloned()
    }
}

const MAGIC: &[u8; 8] = b"SPLGCMP1";
const REFUSED: &[u8; 8] = b"SPLGREF1";

/// What the child is told before the module.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
struct Head {
    is_pooled: bool,
    in_background: bool,
    limits: CompileLimits,
    module_bytes: u32,
}

impl Head {
    const BYTES: usize = 8 + 1 + 1 + 8 + 8 + 4;

    fn encode(&self) -> Vec<u8> {
        let computing = u64::try_from(self.limits.computing.as_millis()).unwrap_or(u64::MAX);
        let mut bytes = MAGIC.to_vec();
        bytes.push(self.is_pooled.into());
        bytes.push(self.in_background.into());
        bytes.extend(computing.to_le_bytes());
        bytes.extend(self.limits.memory.to_le_bytes());
        bytes.extend(self.module_bytes.to_le_bytes());
        bytes
    }

    fn decode(bytes: &[u8; Self::BYTES]) -> Option<Self> {
        let (magic, rest) = bytes.split_first_chunk::<8>()?;
        let (pooled, rest) = rest.split_first()?;
        let (background, rest) = rest.split_first()?;
        let (computing, rest) = rest.split_first_chunk()?;
        let (memory, rest) = rest.split_first_chunk()?;
        let limits = CompileLimits {
            computing: Duration::from_millis(u64::from_le_bytes(*computing)),
            memory: u64::from_le_bytes(*memory),
            ..CompileLimits::default()
        };
        let module_bytes = u32::from_le_bytes(rest.try_into().ok()?);
        let (is_pooled, in_background) = (*pooled != 0, *background != 0);
        (magic == MAGIC).then_some(Self { is_pooled, in_background, limits, module_bytes })
    }
}

/// The child ended because the computing was used up.
const TIME_IS_UP: i32 = 71;
/// What Rust says, and then aborts, when there is no memory.
const NO_MEMORY: &str = "memory allocation of ";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_read_as_it_was_written() {
        let limits = CompileLimits { memory: 7, ..CompileLimits::default() };
        let head = Head { is_pooled: true, in_background: false, limits, module_bytes: 262_144 };
        let bytes: [u8; Head::BYTES] = head.encode().try_into().unwrap();
        assert_eq!(Head::decode(&bytes), Some(head));
        let mut other = bytes;
        other[0] ^= 1;
        assert_eq!(Head::decode(&other), None);
    }
}
