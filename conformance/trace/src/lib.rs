//! The `.spt` trace format: one conformance case as text, one event a line.
//!
//! [`Trace::parse`] reads a trace and says exactly where a fault is,
//! [`Trace::format`] writes the one canonical form, and
//! [`Trace::with_expectations`] puts what was observed in the place of what was
//! expected. `docs/trace-format.md` specifies the format.
//!
//! ```
//! use softplug_trace::{Expected, Trace, What};
//!
//! let text = "\
//! id: echo.tx.first
//! title: The first byte leaves at once
//! profile: echo
//! clauses: echo.tx.at-once
//! level: must
//! line: 9600 8N1 depth=1 reaction=0
//! since: 1
//! origin: hand-written
//! ---
//! ? 0.000000 send 1 \"AB\"
//! > 0.000000 41 42          ; 'AB'
//! ";
//! let trace = Trace::parse(text)?;
//! assert_eq!(trace.front.id, "echo.tx.first");
//! assert!(matches!(trace.entries().nth(1).unwrap().what, What::Expected(Expected::Send(_))));
//! assert_eq!(trace.format(), text);
//! # Ok::<(), softplug_trace::ParseError>(())
//! ```
#![forbid(unsafe_code)]

mod annotation;
mod bless;
mod diff;
mod error;
pub mod exchange;
mod file_name;
mod format;
mod generate;
mod hidden;
pub mod limits;
mod model;
mod parse;
mod rate;
mod suggest;
#[cfg(test)]
mod tests;

pub use annotation::reading;
pub use bless::BlessError;
pub use diff::{Difference, diff};
pub use error::{ParseError, ParseErrorKind};
pub use file_name::{FileNameError, is_slug};
pub use generate::{GENERATORS, Generator, GeneratorKind};
pub use model::{
    Alternatives, Assignment, BadKind, ByteClass, Digest, Drain, Edge, Entry, Exact, Expected,
    Files, FrontMatter, Given, HostRequest, Item, Level, Line, LineEvent, LineSettings,
    ModemLevels, ModemLine, NoFile, NoFiles, Origin, Payload, PayloadError, Permutations, Piece,
    Room, SourceLine, Time, Trace, What, When,
};
