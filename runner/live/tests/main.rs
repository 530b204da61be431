//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod aside;
mod besides;
mod doctor;
mod endpoint;
mod faults;
mod gaps;
mod kernel;
#[cfg(target_os = "linux")]
mod lanes;
#[cfg(target_os = "linux")]
mod load;
#[cfg(target_os = "linux")]
mod net;
mod ports;
mod prompt;
mod reactor;
mod real_time;
mod recorder;
mod rfc2217;
mod rfc2217_lanes;
mod rules;
mod ser2net;
mod swaps;
mod tap;
mod transfers;
mod units;
