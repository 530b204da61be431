//! What can go wrong after the lint, by blame: loading, and a running session.

use crate::LintError;
use softplug_abi::limits::{MODULE_BYTES, OUTPUT_ROUNDS, STATE_BYTES};
use softplug_abi::{EventKind, MailboxError, Malformed, Refusal};
use std::io;
use std::path::PathBuf;
use std::time::Duration;
use thiserror::Error;

/// Why a plug-in cannot be loaded or instantiated.
///
/// ```
/// use softplug_host::{Host, HostOptions, LintError, LoadError};
/// use std::path::Path;
///
/// // Not a plug-in, but the file beside it.
/// let host = Host::new(HostOptions::default())?;
/// let error = host.load(Path::new("Cargo.toml")).unwrap_err();
/// assert!(matches!(error, LoadError::Lint(LintError::NotWasm)));
/// let error = host.load(Path::new("src")).unwrap_err();
/// assert_eq!(error.to_string(), "src is not a file: give the plug-in's .wasm file");
/// # Ok::<(), LoadError>(())
/// ```
#[derive(Debug, Error)]
pub enum LoadError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The path leads to a directory, a device or the like.
    #[error("{} is not a file: give the plug-in's .wasm file", path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
    },
    /// The file is larger than [`MODULE_BYTES`]; it was not read.
    #[error("{} has {bytes} bytes, a plug-in has at most {MODULE_BYTES}: it was not read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size in bytes, as far as it was looked at.
        bytes: u64,
    },
    /// The module is no plug-in.
    #[error(transparent)]
    Lint(#[from] LintError),
    /// The engine cannot be set up on this machine.
    #[error("the WebAssembly engine cannot be set up here: {0}")]
    Engine(String),
    /// The engine cannot compile the module.
    #[error("the module cannot be compiled: {0}")]
    Compile(String),
    /// Compiling it takes more computing than the [compiler's process](crate::compiler) gives.
    #[error(
        "compiling the module takes more than {} s of computing: divide its largest functions, or \
             build it for size", most.as_secs_f32()
    )]
    CompileTime {
        /// The most.
        most: Duration,
    },
    /// Compiling it takes more memory than the [compiler's process](crate::compiler) gives.
    #[error(
        "compiling the module takes more than {} MB of memory: divide its largest functions, or \
             build it for size", most / 1_000_000
    )]
    CompileMemory {
        /// The most, in bytes.
        most: u64,
    },
    /// The [compiler's process](crate::compiler) cannot be started, or does not do what it should.
    /// The plug-in is not to blame.
    #[error("the process that compiles plug-ins cannot be used: {0}")]
    CompilerProcess(String),
    /// As many instances run as the host was made for.
    #[error(
        "{limit} instances are running, the most that this host was set up for: end some, or \
             raise HostOptions::instances"
    )]
    TooManyInstances {
        /// The most.
        limit: u32,
    },
    /// There is no instance of it: a data or element segment that does not fit,
    /// or no memory on this machine.
    #[error("the plug-in cannot be instantiated: {reason}")]
    Instantiate {
        /// The engine's reason.
        reason: String,
    },
    /// It trapped while it was asked for its mailbox.
    #[error("the plug-in trapped when asked for its mailbox: {reason}")]
    Trapped {
        /// The engine's reason.
        reason: String,
    },
    /// It computed for too long when it was asked for its mailbox.
    #[error("the plug-in did not give its mailbox within {fuel} units of fuel")]
    BudgetExhausted {
        /// The budget, in units of fuel.
        fuel: u64,
    },
    /// The mailbox descriptor lies outside the memory.
    #[error("the plug-in's mailbox descriptor at address {address:#x} lies outside its memory")]
    Descriptor {
        /// Its address.
        address: u32,
    },
    /// The mailbox breaks a rule.
    #[error("the plug-in's mailbox cannot be used: {0}")]
    Mailbox(#[from] MailboxError),
}

/// Why a session did not take an event, or ended.
///
/// ```
/// use softplug_abi::{Event, EventKind, Instance, LineErrorKind, Micros};
/// use softplug_host::{Host, HostOptions, SessionFault};
///
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// // A plug-in that panics on a break.
/// let mut session = Host::new(HostOptions::default())?.load_bytes(&wasm)?.instantiate()?;
/// let a_break = Event::LineError { kind: LineErrorKind::Break, byte: None, span: 0 };
/// let fault = session.step(&a_break, Micros(1_000)).unwrap_err();
/// assert!(matches!(fault, SessionFault::Trapped { event: EventKind::LineError, .. }));
/// assert!(fault.to_string().ends_with("it says: no breaks, please"));
/// // It has ended, and its code does not run again.
/// assert!(fault.is_final() && fault.refusal().is_none());
/// assert_eq!(session.step(&Event::Received(b"G1"), Micros(2_000)).unwrap_err(), fault);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum SessionFault {
    /// The plug-in trapped: it panicked, or did what WebAssembly forbids.
    #[error("the plug-in trapped on event {event}: {reason}{}", saying(last_words.as_deref()))]
    Trapped {
        /// The event that did it.
        event: EventKind,
        /// The engine's reason.
        reason: String,
        /// Names of the functions that were running, the innermost first.
        frames: Vec<String>,
        /// Panic text and place, if it left any.
        last_words: Option<String>,
    },
    /// The plug-in computed for too long.
    #[error("the plug-in used up its budget of {fuel} units of fuel on event {event}")]
    BudgetExhausted {
        /// The event that did it.
        event: EventKind,
        /// The budget, in units of fuel.
        fuel: u64,
    },
    /// The plug-in broke the ABI.
    #[error("the plug-in broke the ABI on event {event}: {reason}")]
    Malformed {
        /// The event that it answered.
        event: EventKind,
        /// How.
        reason: Misbehaviour,
    },
    /// The plug-in did not take the event and says so.
    #[error("the plug-in refused event {event}: {}{}", refusal.text(), saying(words.as_deref()))]
    Refused {
        /// The event.
        event: EventKind,
        /// Why.
        refusal: Refusal,
        /// What it has to say to that, if anything.
        words: Option<String>,
    },
    /// The host's own mistake: the event is longer than the plug-in can take.
    #[error("event {event} does not fit the plug-in's input of {capacity} bytes: cut it")]
    EventTooLarge {
        /// The event.
        event: EventKind,
        /// The input's capacity in bytes.
        capacity: usize,
    },
    /// The manifest names no format that the plug-in saves.
    #[error("this plug-in does not save its state, so it cannot be swapped in the middle")]
    DoesNotSave,
    /// The manifest does not name the format of the state.
    #[error("the plug-in does not accept a state of format {format}")]
    FormatNotAccepted {
        /// The format.
        format: u16,
    },
    /// The state to restore is longer than the ABI allows.
    #[error("the saved state has {bytes} bytes, at most {STATE_BYTES} are allowed")]
    StateTooLarge {
        /// Its length in bytes.
        bytes: usize,
    },
}

/// How a plug-in broke the ABI.
///
/// ```
/// use softplug_abi::{Event, EventKind, Instance, Micros};
/// use softplug_host::{Host, HostOptions, Misbehaviour, SessionFault};
///
/// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
/// # let length = "(i32.add (local.get $length) (i32.const 8))";
/// # let wasm = wat::parse_str(echo.replace(length, "(i32.const 5000)"))?;
/// // A plug-in whose output buffer has 4,096 bytes says that it wrote 5,000.
/// let mut session = Host::new(HostOptions::default())?.load_bytes(&wasm)?.instantiate()?;
/// let fault = session.step(&Event::Received(b"G1"), Micros::ZERO).unwrap_err();
/// let reason = Misbehaviour::Length { length: 5_000, capacity: 4_096 };
/// assert_eq!(fault, SessionFault::Malformed { event: EventKind::Received, reason });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum Misbehaviour {
    /// It claims more output than its buffer holds.
    #[error("it claims {length} bytes of output, its buffer holds {capacity}")]
    Length {
        /// What it claims, in bytes.
        length: u32,
        /// What the buffer holds, in bytes.
        capacity: u32,
    },
    /// It returned a negative result that means nothing.
    #[error("it returned {0}, which means nothing")]
    UnknownResult(i32),
    /// It refused an event with a reason that belongs to another event.
    #[error("it refused with \"{0}\", which belongs to another event")]
    Refusal(Refusal),
    /// It has yet more output after all rounds.
    #[error("it has yet more output after {OUTPUT_ROUNDS} rounds of continue")]
    TooManyRounds,
    /// Its actions cannot be decoded.
    #[error("its actions cannot be decoded: {0}")]
    Actions(#[from] Malformed),
    /// It asks for something at a time when only notes are allowed.
    #[error("it asks for an action where only notes and state names may stand")]
    Action,
    /// A piece of its saved state does not fit the pieces before.
    #[error("a piece of its saved state is out of place: {0}")]
    SavedPiece(&'static str),
}

impl SessionFault {
    /// Whether the session has ended with this fault. It then answers every
    /// later step with it.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Trapped { .. } | Self::BudgetExhausted { .. } | Self::Malformed { .. })
    }

    /// Why the plug-in refused the event, if it did.
    pub fn refusal(&self) -> Option<Refusal> {
        match self {
            Self::Refused { refusal, .. } => Some(*refusal),
            _ => None,
        }
    }
}

fn saying(words: Option<&str>) -> String {
    words.map(|words| format!("; it says: {words}")).unwrap_or_default()
}
