//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod api;
#[cfg(target_os = "linux")]
mod common;
mod config;
mod crash;
mod feeding;
mod full;
mod gateway;
mod jobs;
mod library;
mod page;
mod power;
mod programs;
mod readers;
