//! The Softplug plug-in ABI, version 1.1: what a host tells a plug-in
//! ([`Event`]), what a plug-in asks of the host ([`Action`]), the numbers that
//! bound both ([`limits`]), and the one encoding of all of it.
//!
//! `docs/abi.md` specifies the same in words, for hosts and plug-ins in any
//! language; the golden tests of this crate freeze the bytes.
//!
//! ```
//! use softplug_abi::{Action, ActionWriter, Actions, MarkId};
//!
//! let mut buffer = [0; 64];
//! let mut writer = ActionWriter::new(&mut buffer);
//! writer.push(&Action::Transmit { mark: MarkId::NONE, bytes: b"G1" }).unwrap();
//! writer.push(&Action::Transmit { mark: MarkId::NONE, bytes: b"X1" }).unwrap();
//! let length = writer.len();
//!
//! // Neighbouring transmits without a mark become one record.
//! let actions: Vec<_> = Actions::new(&buffer[..length]).collect::<Result<_, _>>().unwrap();
//! assert_eq!(actions, [Action::Transmit { mark: MarkId::NONE, bytes: b"G1X1" }]);
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

#[cfg(feature = "manifest")]
extern crate alloc;

mod action;
mod code;
mod event;
mod failure;
mod id;
mod instance;
pub mod limits;
mod line;
mod mailbox;
#[cfg(feature = "manifest")]
pub mod manifest;
mod pieces;
mod time;
mod value;
pub mod wire;

pub use action::{Action, ActionWriter, Actions, NoteLevel};
pub use event::{Event, EventKind, LineErrorKind, LinkDownReason, MarkState, Pass, TakeEvent};
pub use failure::{Failure, Refusal};
pub use id::{DeliveryId, JobId, MarkId, RequestId};
pub use instance::{Instance, Output};
pub use line::{LineParameters, ModemLines, Parity};
pub use mailbox::{MORE_OUTPUT, Mailbox, MailboxError, Region};
pub use pieces::restore_pieces;
pub use time::Micros;
pub use value::{RawValue, RawValues, Value, ValueWriter, Values};
pub use wire::{Malformed, MalformedReason, NoSpace};

/// The ABI's version: major and minor.
///
/// A plug-in of an older minor version is served by a newer host; it is never
/// sent a kind of event that its version does not know.
///
/// ```
/// // A plug-in of version 1.0 is served by a host of the same major version.
/// assert_eq!(softplug_abi::VERSION.0, 1);
/// ```
pub const VERSION: (u16, u16) = (1, 1);

/// Name of the export that returns the mailbox descriptor's address.
pub const EXPORT_MAILBOX: &str = "softplug_v1";
/// Name of the export that takes one event.
pub const EXPORT_STEP: &str = "softplug_v1_step";
/// Name of the exported linear memory.
pub const EXPORT_MEMORY: &str = "memory";
/// Name of the custom section that holds the manifest, JSON in UTF-8.
pub const MANIFEST_SECTION: &str = "softplug.manifest";
