//! Serial lines: ports that never block, pacing at the line's rate,
//! and the answers to "why does nothing arrive?".
//!
//! - [`port`]: a terminal, a TCP connection, a device server of RFC 2217 or a
//!   pty behind one non-blocking interface, with marks of damaged characters
//!   decoded.
//! - [`recorder`]: the last events that a plug-in was given.
//! - [`pacer`]: how many bytes may be given to a port now, so that few are
//!   beyond recall when the partner says stop.
//! - [`channel`]: a port with a plug-in on it; [`reactor`]: many of them on few
//!   threads, fed and emptied through [`reservoir`]s.
//! - [`units`]: links whose plug-ins run in front-end units.
//! - [`station`]: a channel that waits for itself; [`transfer`]: one program over it,
//!   or all that comes and is asked for.
//! - [`tap`]: between two ports, passing everything on and telling what passed.
//! - [`store`]: folders for what comes and for what machines may ask for.
//! - [`timer`] and [`poll`]: waiting for a port, a deadline and a wake-up; [`due`]:
//!   when somebody is to be called.
//! - [`ports`] and [`doctor`]: which ports there are and what ails one.
//! - [`awaited`]: what a job waits for, and what the operator has to do.
//! - [`guess`]: what was meant, where a name is not known.
//! - [`place`]: where something stands in a text.
//! - [`quantity`]: spans and numbers of bytes as people write them.
//! - [`suggest`]: baud and parity from what was heard.
//!
//! The reactor, units, `doctor` and ptys need Linux and are compiled there only.
//! Elsewhere a [`station`] and a [`tap`] drive a serial port, TCP and RFC 2217, and look every
//! millisecond whether something has come.

// Elsewhere what only the reactor needs is not called.
#![cfg_attr(not(target_os = "linux"), allow(dead_code))]

pub mod awaited;
pub mod channel;
pub mod clock;
mod difference;
pub mod due;
pub mod error;
pub mod guess;
pub mod pacer;
pub mod place;
pub mod poll;
pub mod port;
pub mod ports;
pub mod quantity;
pub mod recorder;
pub mod reservoir;
#[cfg(feature = "simulate")]
pub mod simulator;
pub mod station;
pub mod store;
pub mod suggest;
pub mod tap;
mod text;
pub mod transfer;

#[cfg(target_os = "linux")]
mod allowance;
#[cfg(all(target_os = "linux", feature = "simulate"))]
pub mod device_server;
#[cfg(target_os = "linux")]
pub mod doctor;
#[cfg(target_os = "linux")]
pub mod endpoint;
#[cfg(target_os = "linux")]
pub mod reactor;
#[cfg(target_os = "linux")]
pub mod timer;
#[cfg(target_os = "linux")]
pub mod units;

pub use due::Due;
pub use error::{BadSpec, Blame, Holder, PortError};
pub use pacer::Pacer;
#[doc(inline)]
pub use port::pty;
pub use port::{Flow, PortOptions, PortSpec, SettingDifference};
pub use port::{Input, Port, ReadOutcome};
pub use text::{is_plain, plain_text};
