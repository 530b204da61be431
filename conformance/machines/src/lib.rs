//! Simulated machines: what stands at the other end of a plug-in's serial line.
//!
//! | module | machine |
//! |---|---|
//! | [`xon_xoff`] | a control that receives and sends programs with XON/XOFF |
//! | [`fanuc`] | a FANUC control with reader, punch and remote buffer |
//! | [`pulse_lathe`] | a lathe without a control, which takes every feed pulse from its line |
//! | [`kermit`] | a machine that takes, sends or asks for files with Kermit |
//! | [`xmodem`] | a control that calls for files with XMODEM, or sends one |
//! | [`r3964`] | a station that speaks 3964R, 3964 or simplified 3964R |
//! | [`r3964::rk512`] | a computer that speaks RK512 on top of it |
//! | [`script`] | a partner of any protocol, whose lines are written down |
//!
//! [`uart`] is what they all send and receive with, [`kept`] what they keep of it. [`Clocked`] is a port
//! that clocks characters out, for a line that keeps no rate.
//!
//! Each is a [`Partner`]: it does no I/O and has no clock, its time is in whole µs.
//! It is told what reached it and when, says when it wants to be called next, and
//! gives up the characters that have left its transmitter. So the same machine runs
//! in a test in virtual time, and on a pty in real time. It shares no code with the
//! plug-ins that it is tried with, and needs the ABI's types alone.
//!
//! Two machines on one line; whatever drives them is a loop like this:
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::r3964::{Options, Priority, Station};
//!
//! let mut cell = Station::new(Options::default())?;
//! let mut robot = Station::new(Options { priority: Priority::Low, ..Options::default() })?;
//! cell.send(Micros::ZERO, b"PART 7".to_vec());
//! while let Some(now) = [cell.next_event(), robot.next_event()].into_iter().flatten().min() {
//!     cell.advance(now);
//!     robot.advance(now);
//!     while let Some(byte) = cell.poll_transmit(now) {
//!         robot.receive(now, byte);
//!     }
//!     while let Some(byte) = robot.poll_transmit(now) {
//!         cell.receive(now, byte);
//!     }
//! }
//! assert_eq!(cell.report().sent[0].result, Ok(()));
//! assert_eq!(robot.report().received[0].data, b"PART 7");
//! # Ok::<(), softplug_machines::r3964::OptionsError>(())
//! ```
#![forbid(unsafe_code)]

mod clocked;
pub mod fanuc;
pub mod kept;
pub mod kermit;
mod partner;
pub mod pulse_lathe;
pub mod r3964;
pub mod script;
pub mod uart;
pub mod xmodem;
pub mod xon_xoff;

pub use clocked::Clocked;
pub use partner::{Partner, Signal};
