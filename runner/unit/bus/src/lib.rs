//! The scheduler of a bus that feeds front-end units: which unit is served next, and with how much.
//!
//! A gateway drives a live bus with it, and the planner simulates a shop with it: both tell it the
//! time and what the levels are, and are told what to do. Nothing here has I/O, a clock or an
//! allocator. Times are in seconds, counted from where the caller likes; data is in bits.
//!
//! | type | what |
//! |---|---|
//! | [`Bus`] | a bus: what may leave now, and what was measured |
//! | [`Scheduler`] | whose turn it is, in one decision |
//! | [`Consumption`] | what one machine takes, measured |
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod bus;
mod consumption;
mod measured;
mod scheduler;

pub use bus::{Bus, BusRates, Step};
pub use consumption::Consumption;
pub use measured::BusFigures;
pub use scheduler::{Decision, Grant, Line, Scheduler, Unit};
