//! Simulated partners: the machine at the other end of the line.
//!
//! Each is a sans-IO machine in whole µs. It is told what reached it and when,
//! says when it wants to be called next, and gives up the characters that have
//! left its transmitter. None shares code with the plug-ins that it judges.

pub mod uart;
pub mod xon_xoff;
