//! One test for each rule of the ABI that the link keeps; docs/abi.md,
//! section "Rules", names them.

mod credit;
mod jobs;
mod left;
mod line;
mod order;
mod probation;
mod swap;
mod timers;
mod transmit;
