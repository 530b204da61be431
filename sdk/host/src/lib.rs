//! The sandbox host for Softplug plug-ins: lint, load, step, save and restore.
//!
//! A plug-in is a WebAssembly module without imports. [`Host::load`] checks it
//! and compiles it into a [`Plugin`]; [`Plugin::instantiate`] gives a [`Session`],
//! one running plug-in with its own memory, which takes events through
//! [`softplug_abi::Instance`]. Nothing that a module does reaches further than
//! its session: every address and length that it gives is checked, its
//! computing is bounded by fuel, its memory by its declaration.
//!
//! Loading compiles and takes milliseconds, at worst seconds: never load on a
//! thread that serves a link. Instantiating takes microseconds, a step less
//! than one. A thread that steps needs 512 KiB of stack.
//!
//! Of the engines, `wasmtime` is a default feature, `wasmi` and `interpreter` are not; without the default one
//! the crate builds for machines that no compiler supports, `wasm32-unknown-unknown` among them.
//!
//! ```
//! use softplug_abi::{Action, Actions, Event, Instance, MarkId, Micros};
//! use softplug_host::{Host, HostOptions};
//!
//! # let wasm = wat::parse_file("tests/guests/echo.wat")?;
//! let host = Host::new(HostOptions::default())?;
//! let plugin = host.load_bytes(&wasm)?;
//! let mut session = plugin.instantiate()?;
//! session.configure(&plugin.manifest().resolve_settings([])?, Micros::ZERO)?;
//!
//! let output = session.step(&Event::Received(b"G1"), Micros(1_000))?;
//! let actions: Vec<_> = Actions::new(output.actions).collect::<Result<_, _>>()?;
//! assert_eq!(actions, [Action::Transmit { mark: MarkId::NONE, bytes: b"G1" }]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod digest;
mod engine;
mod fault;
mod files;
mod host;
mod lint;
mod plugin;
mod session;
mod state;
mod words;

#[cfg(not(any(feature = "wasmtime", feature = "wasmi", feature = "interpreter")))]
compile_error!(
    "softplug-host needs an engine: switch on the feature \"wasmtime\", \"wasmi\" or \"interpreter\""
);

pub use digest::{Digest, NotADigest};
#[cfg(feature = "wasmtime")]
pub use engine::compiler;
pub use engine::{EngineInfo, EngineKind, Origin};
pub use fault::{LoadError, Misbehaviour, SessionFault};
pub use host::{Host, HostOptions, read_module};
pub use lint::{Inspection, LintError, MemoryMaximum, SIGNATURE_MAILBOX, SIGNATURE_STEP, lint};
pub use plugin::Plugin;
pub use session::Session;
pub use state::SavedState;
