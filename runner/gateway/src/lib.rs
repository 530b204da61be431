//! Serial lines on Linux: ports that never block, pacing at the line's rate,
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
//! What needs Linux is compiled there only; settings, pacing and the pure
//! decoders are everywhere.

#[cfg(target_os = "linux")]
mod allowance;
pub mod awaited;
pub mod due;
pub mod error;
pub mod guess;
pub mod pacer;
pub mod place;
pub mod port;
pub mod quantity;
pub mod recorder;
pub mod store;
pub mod suggest;
mod text;

#[cfg(target_os = "linux")]
pub mod channel;
#[cfg(target_os = "linux")]
pub mod clock;
#[cfg(all(target_os = "linux", feature = "simulate"))]
pub mod device_server;
#[cfg(target_os = "linux")]
pub mod doctor;
#[cfg(target_os = "linux")]
pub mod endpoint;
#[cfg(target_os = "linux")]
pub mod poll;
#[cfg(target_os = "linux")]
pub mod ports;
#[cfg(target_os = "linux")]
pub mod pty;
#[cfg(target_os = "linux")]
pub mod reactor;
pub mod reservoir;
#[cfg(all(target_os = "linux", feature = "simulate"))]
pub mod simulator;
#[cfg(target_os = "linux")]
pub mod station;
#[cfg(target_os = "linux")]
pub mod tap;
#[cfg(target_os = "linux")]
pub mod timer;
#[cfg(target_os = "linux")]
pub mod transfer;
#[cfg(target_os = "linux")]
pub mod units;

pub use due::Due;
pub use error::{BadSpec, Blame, Holder, PortError};
pub use pacer::Pacer;
pub use port::{Flow, PortOptions, PortSpec, SettingDifference};
#[cfg(target_os = "linux")]
pub use port::{Input, Port, ReadOutcome};
pub use text::{is_plain, plain_text};
