//! The host: an engine, its limits and its cache.

#[cfg(feature = "wasmtime")]
use crate::engine::EngineError;
#[cfg(feature = "interpreter")]
use crate::engine::Interpreter;
#[cfg(feature = "wasmi")]
use crate::engine::Wasmi;
#[cfg(feature = "wasmtime")]
use crate::engine::Wasmtime;
#[cfg(feature = "wasmtime")]
use crate::engine::compiler::CompilerProcess;
use crate::engine::{Engine, EngineKind, NotLoaded};
use crate::plugin::Plugin;
use crate::{Digest, EngineInfo, Inspection, LoadError, files, lint};
use softplug_abi::limits::{FUEL_PER_EVENT, MODULE_BYTES};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a host is made with.
///
/// ```
/// use softplug_abi::{Event, Instance, Micros};
/// use softplug_host::{Host, HostOptions, SessionFault};
///
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// let options = HostOptions { fuel_per_event: 1_000, instances: 16, ..HostOptions::default() };
/// let mut session = Host::new(options)?.load_bytes(&wasm)?.instantiate()?;
/// // Enough for two bytes, too little for 4,000.
/// session.step(&Event::Received(b"G1"), Micros::ZERO)?;
/// let fault = session.step(&Event::Received(&[0; 4_000]), Micros::ZERO).unwrap_err();
/// assert!(matches!(fault, SessionFault::BudgetExhausted { fuel: 1_000, .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct HostOptions {
    /// The engine.
    pub engine: EngineKind,
    /// Directory for compiled code; `None`: compile at every load. It is made
    /// if it is missing. It must belong to this user alone.
    pub cache: Option<PathBuf>,
    /// Where the compiler runs; `None`: in this process, bounded by the lint alone. An
    /// interpreter never has one.
    #[cfg(feature = "wasmtime")]
    pub compiler: Option<CompilerProcess>,
    /// Units of fuel for one event or one round of `continue`.
    pub fuel_per_event: u64,
    /// Most instances at one time. Each reserves 4 GiB of addresses, not memory;
    /// where there are not that many, instances are made one by one, which is
    /// slower, and there is no such bound.
    pub instances: u32,
}

impl Default for HostOptions {
    /// The compiler, in the process that was [installed](CompilerProcess::install) or else in this
    /// one; no cache, the ABI's fuel, 1,024 instances.
    fn default() -> Self {
        Self {
            engine: EngineKind::default(),
            cache: None,
            #[cfg(feature = "wasmtime")]
            compiler: CompilerProcess::installed(),
            fuel_per_event: FUEL_PER_EVENT,
            instances: 1_024,
        }
    }
}

/// Loads plug-ins. Clones share one engine; a process needs one.
///
/// ```
/// use softplug_host::{Host, HostOptions};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("echo.wasm");
/// # std::fs::write(&path, wat::parse_file("tests/guests/echo.wat")?)?;
/// let host = Host::new(HostOptions::default())?;
/// let from_file = host.load(&path)?;
/// let from_memory = host.load_bytes(&std::fs::read(&path)?)?;
/// assert_eq!(from_file.digest(), from_memory.digest());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Host {
    inner: Arc<Inner>,
}

struct Inner {
    engine: Box<dyn Engine>,
    options: HostOptions,
}

impl Host {
    /// A host with its engine.
    ///
    /// # Errors
    /// The engine cannot be set up on this machine. A cache that cannot be used
    /// is no error: it is logged, and plug-ins are compiled at every load.
    pub fn new(options: HostOptions) -> Result<Self, LoadError> {
        let engine: Box<dyn Engine> = match options.engine {
            #[cfg(feature = "wasmtime")]
            EngineKind::Wasmtime => Box::new(
                Wasmtime::new(
                    options.instances,
                    options.cache.as_deref(),
                    options.compiler.clone(),
                )
                .map_err(|EngineError(reason)| LoadError::Engine(reason))?,
            ),
            #[cfg(feature = "wasmi")]
            EngineKind::Wasmi => Box::new(Wasmi::new()),
            #[cfg(feature = "interpreter")]
            EngineKind::Interpreter => Box::new(Interpreter),
        };
        Ok(Self { inner: Arc::new(Inner { engine, options }) })
    }

    /// Reads, checks and compiles a plug-in. Takes milliseconds, at worst seconds:
    /// never call it on a thread that serves a link.
    ///
    /// # Errors
    /// The file cannot be read, is larger than [`MODULE_BYTES`] (and then is not
    /// read), or is no plug-in.
    pub fn load(&self, path: &Path) -> Result<Plugin, LoadError> {
        self.load_bytes(&read_module(path)?)
    }

    /// Checks and compiles a plug-in. As slow as [`Host::load`].
    ///
    /// # Errors
    /// The module is no plug-in.
    pub fn load_bytes(&self, wasm: &[u8]) -> Result<Plugin, LoadError> {
        self.load_inspected(wasm, &lint(wasm)?)
    }

    /// Compiles a plug-in that was checked before, as for another engine. What was found out
    /// about other bytes counts for nothing: they are checked anew.
    ///
    /// # Errors
    /// The engine does not take the module.
    ///
    /// ```
    /// use softplug_host::{Host, HostOptions, lint};
    ///
    /// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
    /// let inspection = lint(&wasm)?;
    /// let host = Host::new(HostOptions::default())?;
    /// assert_eq!(host.load_inspected(&wasm, &inspection)?.inspection(), &inspection);
    /// assert!(host.load_inspected(b"\0asm", &inspection).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn load_inspected(
        &self,
        wasm: &[u8],
        inspection: &Inspection,
    ) -> Result<Plugin, LoadError> {
        if Digest::of(wasm) != inspection.digest {
            return self.load_bytes(wasm);
        }
        self.compile(wasm, inspection.digest, inspection)
    }

    fn compile(
        &self,
        code: &[u8],
        digest: Digest,
        inspection: &Inspection,
    ) -> Result<Plugin, LoadError> {
        let loaded = self.inner.engine.load(code, digest).map_err(NotLoaded::into_error);
        let ((compiled, origin), fuel) = (loaded?, self.inner.options.fuel_per_event);
        Ok(Plugin::new(compiled, inspection.clone(), origin, fuel))
    }

    /// Compiles `instrumented` as the code of a plug-in that was checked: the same module with
    /// counters in exported globals, which the lint would refuse. Sessions give them by
    /// [`Session::global`](crate::Session::global). Only for measuring: what it computes costs
    /// more fuel, and nobody has checked that it is the same.
    ///
    /// # Errors
    /// The engine does not take what was made of the plug-in.
    ///
    /// ```
    /// use softplug_abi::{Event, Instance, Micros};
    /// use softplug_host::{Host, HostOptions, lint};
    ///
    /// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
    /// # let wasm = wat::parse_str(&echo)?;
    /// # let counter = "(global $n (export \"n\") (mut i64) (i64.const 7))";
    /// # let end = echo.trim_end().strip_suffix(')').unwrap();
    /// # let instrumented = wat::parse_str(format!("{end}{counter})"))?;
    /// let host = Host::new(HostOptions::default())?;
    /// assert!(host.load_bytes(&instrumented).is_err());
    /// let mut session = host.load_instrumented(&lint(&wasm)?, &instrumented)?.instantiate()?;
    /// session.step(&Event::Received(b"G1"), Micros::ZERO)?;
    /// assert_eq!((session.global("n"), session.global("m")), (Some(7), None));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn load_instrumented(
        &self,
        inspection: &Inspection,
        instrumented: &[u8],
    ) -> Result<Plugin, LoadError> {
        self.compile(instrumented, Digest::of(instrumented), inspection)
    }

    /// Breaks off what a [compiler's process](HostOptions::compiler) has under way, and all later
    /// compiling: for a host that is about to stop. What is compiled already can be used.
    pub fn stop_compiling(&self) {
        self.inner.engine.stop_compiling();
    }

    /// Which engine runs the plug-ins.
    pub fn engine(&self) -> EngineInfo {
        self.inner.engine.info()
    }
}

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host")
            .field("engine", &self.engine())
            .field("options", &self.inner.options)
            .finish_non_exhaustive()
    }
}

/// Reads a module that is yet to be checked, without loading it.
///
/// The size is looked at first, and the read is bounded all the same: a file can
/// grow between the two.
///
/// # Errors
/// The file cannot be read, is none, or is larger than [`MODULE_BYTES`].
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("echo.wasm");
/// # std::fs::write(&path, b"\0asm\x01\0\0\0")?;
/// use softplug_host::{LoadError, lint, read_module};
///
/// let module = read_module(&path)?;
/// assert!(lint(&module).is_err());
/// assert!(matches!(read_module(folder.path()), Err(LoadError::NotAFile { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_module(path: &Path) -> Result<Vec<u8>, LoadError> {
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    let too_large = |bytes| LoadError::TooLarge { path: path.to_owned(), bytes };
    let metadata = std::fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        return Err(LoadError::NotAFile { path: path.to_owned() });
    }
    if metadata.len() > MODULE_BYTES as u64 {
        return Err(too_large(metadata.len()));
    }
    let mut wasm = Vec::with_capacity(metadata.len() as usize);
    let file = files::open(path).map_err(io)?;
    // Of the open file: something else may have come in its place.
    if !file.metadata().map_err(io)?.is_file() {
        return Err(LoadError::NotAFile { path: path.to_owned() });
    }
    file.take(MODULE_BYTES as u64 + 1).read_to_end(&mut wasm).map_err(io)?;
    if wasm.len() > MODULE_BYTES {
        return Err(too_large(wasm.len() as u64));
    }
    Ok(wasm)
}
