//! The scheduler of a bus that feeds front-end units: which unit is served next, and with how much.
//!
//! A gateway drives a live bus with it, and the planner simulates a shop with it: both tell it the
//! time and what the levels are, and are told what to do. Nothing here has I/O, a clock or an
//! allocator.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod scheduler;

pub use scheduler::{Decision, Grant, Line, Scheduler, Unit};
