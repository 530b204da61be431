//! The one interface behind which a WebAssembly engine stands.
//!
//! Callers know these three traits and nothing of the engine: another engine is
//! another file beside `wasmtime.rs`.

#[cfg(feature = "wasmtime")]
mod cache;
#[cfg(feature = "wasmtime")]
mod code;
#[cfg(feature = "wasmtime")]
pub mod compiler;
#[cfg(feature = "interpreter")]
mod interpreter;
#[cfg(feature = "wasmtime")]
mod precompiled;
#[cfg(feature = "wasmi")]
mod wasmi;
#[cfg(feature = "wasmtime")]
mod wasmtime;

use crate::{Digest, LoadError};
use softplug_abi::wire::NoSpace;
use softplug_abi::{Event, Micros};
use std::fmt;
use std::ops::Range;

#[cfg(feature = "interpreter")]
pub(crate) use self::interpreter::Interpreter;
#[cfg(feature = "wasmi")]
pub(crate) use self::wasmi::Wasmi;
#[cfg(feature = "wasmtime")]
pub(crate) use self::wasmtime::Wasmtime;

/// The engines that there are. Plug-ins behave the same under each of them; what
/// differs is speed, and the fuel that the same computing takes.
///
/// ```
/// use softplug_host::{EngineKind, Host, HostOptions};
///
/// # #[cfg(feature = "wasmtime")] {
/// let host = Host::new(HostOptions { engine: EngineKind::Wasmtime, ..HostOptions::default() })?;
/// assert_eq!(host.engine().name, "wasmtime");
/// # }
/// # Ok::<(), softplug_host::LoadError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Hash, Default)]
pub enum EngineKind {
    /// A compiler: the engine for live links.
    #[cfg(feature = "wasmtime")]
    #[default]
    Wasmtime,
    /// An interpreter that shares no code with the compiler: for comparing the
    /// two, and for machines that the compiler does not support. It keeps nothing in
    /// the cache, has no most number of instances, and names no functions of a trap.
    #[cfg(feature = "wasmi")]
    #[cfg_attr(not(feature = "wasmtime"), default)]
    Wasmi,
    /// The interpreter of units without an operating system (`softplug-interpreter`), which
    /// translates nothing: to see here what a plug-in does there. As the one before it keeps nothing in the
    /// cache, has no most number of instances, and names no functions of a trap.
    #[cfg(feature = "interpreter")]
    #[cfg_attr(not(any(feature = "wasmtime", feature = "wasmi")), default)]
    Interpreter,
}

/// Which engine runs the plug-ins, exactly. Fuel figures hold for one version of one
/// engine only, so a report states both.
///
/// ```
/// use softplug_host::{EngineInfo, Host, HostOptions};
///
/// let EngineInfo { name, version } = Host::new(HostOptions::default())?.engine();
/// let heading = format!("units of fuel under {name} {version}");
/// assert!(heading.ends_with(|c: char| c.is_ascii_digit()));
/// # Ok::<(), softplug_host::LoadError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Hash)]
pub struct EngineInfo {
    /// The engine's name.
    pub name: &'static str,
    /// Its version.
    pub version: &'static str,
}

impl fmt::Display for EngineInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.name, self.version)
    }
}

/// Where a plug-in's code came from.
///
/// ```
/// use softplug_host::{Host, HostOptions, Origin};
///
/// # #[cfg(all(unix, feature = "wasmtime"))] {
/// # let folder = tempfile::tempdir()?;
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// let cache = Some(folder.path().join("compiled"));
/// let host = Host::new(HostOptions { cache, ..HostOptions::default() })?;
/// assert_eq!(host.load_bytes(&wasm)?.origin(), Origin::Compiled);
/// assert_eq!(host.load_bytes(&wasm)?.origin(), Origin::Cache);
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Origin {
    /// It was compiled at this load.
    Compiled,
    /// It was in the cache.
    Cache,
}

/// Units of fuel of those operators that take longer than the rest, which cost one,
/// by an order: so that the budget bounds time, not only a count.
#[cfg(any(feature = "wasmtime", feature = "wasmi"))]
mod weights {
    pub(super) const MEMORY_GROW: u8 = 100;
    pub(super) const CALL_INDIRECT: u8 = 4;
    pub(super) const DIVISION: u8 = 8;
}

/// Compiles modules that the lint has let through.
pub(crate) trait Engine: Send + Sync {
    fn info(&self) -> EngineInfo;

    /// Compiles the module of this digest, or finds what it once compiled of it.
    fn load(&self, wasm: &[u8], digest: Digest) -> Result<(Box<dyn Compiled>, Origin), NotLoaded>;

    /// Breaks off what it has others compile, for good.
    fn stop_compiling(&self) {}
}

/// A compiled module.
pub(crate) trait Compiled: Send + Sync {
    fn instantiate(&self) -> Result<Box<dyn Running>, StartError>;
}

/// One instance with its memory.
pub(crate) trait Running: Send {
    /// Calls `softplug_v1`.
    fn mailbox(&mut self, fuel: u64) -> Result<u32, Stop>;

    /// Writes the event's payload to `input` and calls `softplug_v1_step`. All in one
    /// call: an event costs so little that several would show.
    fn step(
        &mut self,
        event: &Event<'_>,
        input: Range<usize>,
        now: Micros,
        fuel: u64,
    ) -> Result<Stepped<'_>, NoSpace>;

    /// What stands in an exported global of 32 or 64 bits.
    fn global(&mut self, name: &str) -> Option<i64>;

    /// Writes an exported global of 32 or 64 bits; whether there is one that can be written.
    fn set_global(&mut self, name: &str, value: i64) -> bool;

    fn memory(&self) -> &[u8];

    fn memory_mut(&mut self) -> &mut [u8];
}

/// What a call of `softplug_v1_step` came to.
pub(crate) struct Stepped<'a> {
    /// In a box, so that what comes back of nearly every call stays small.
    pub(crate) result: Result<i32, Box<Stop>>,
    pub(crate) fuel_used: u64,
    pub(crate) memory: &'a mut [u8],
}

/// Why a call did not return.
#[derive(Debug)]
pub(crate) enum Stop {
    OutOfFuel,
    Trap {
        reason: String,
        /// Names of functions, the innermost first.
        frames: Vec<String>,
    },
}

/// Why there is no instance.
#[derive(Debug)]
pub(crate) enum StartError {
    #[cfg(feature = "wasmtime")]
    PoolExhausted {
        /// The most instances.
        limit: u32,
    },
    Other(String),
}

/// What the engine says of its own failure.
#[derive(Debug)]
pub(crate) struct EngineError(pub(crate) String);

/// Why an engine has no code of a module.
#[derive(Debug)]
pub(crate) enum NotLoaded {
    Engine(EngineError),
    #[cfg(feature = "wasmtime")]
    Apart(self::compiler::Failed),
}

impl From<EngineError> for NotLoaded {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

impl NotLoaded {
    pub(crate) fn into_error(self) -> LoadError {
        #[cfg(feature = "wasmtime")]
        use self::compiler::Failed;
        match self {
            Self::Engine(EngineError(reason)) => LoadError::Compile(reason),
            #[cfg(feature = "wasmtime")]
            Self::Apart(failed) => match failed {
                Failed::Time(most) => LoadError::CompileTime { most },
                Failed::Memory(most) => LoadError::CompileMemory { most },
                Failed::Refused(reason) => LoadError::Compile(reason),
                Failed::Process(reason) => LoadError::CompilerProcess(reason),
            },
        }
    }
}
