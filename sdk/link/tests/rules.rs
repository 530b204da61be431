//! One test for each rule of the ABI that the link keeps; docs/abi.md,
//! section "Rules", names them.

mod common;

#[path = "rules/credit.rs"]
mod credit;
#[path = "rules/jobs.rs"]
mod jobs;
#[path = "rules/left.rs"]
mod left;
#[path = "rules/line.rs"]
mod line;
#[path = "rules/order.rs"]
mod order;
#[path = "rules/probation.rs"]
mod probation;
#[path = "rules/swap.rs"]
mod swap;
#[path = "rules/timers.rs"]
mod timers;
#[path = "rules/transmit.rs"]
mod transmit;
