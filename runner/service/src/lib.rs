//! The Softplug gateway as a service: many serial links, each through a
//! plug-in in its sandbox, with jobs, programs, a library of plug-ins and HTTP.
//!
//! [`config`] reads `gateway.toml`; [`gateway`] runs what it describes and is the
//! one door for whoever wants something of it, be it HTTP, the command or a test;
//! [`view`] is what they are shown.
#![cfg(target_os = "linux")]

pub mod config;
pub mod disk;
mod drop_folder;
pub mod feeder;
pub mod gateway;
pub mod http;
pub mod jobs;
pub mod library;
pub mod logs;
mod metrics;
mod page;
pub mod programs;
pub mod reception_writer;
pub mod refusal;
pub mod supervise;
pub mod systemd;
pub mod view;
mod wakes;

pub use config::Config;
pub use gateway::Gateway;
pub use refusal::Refusal;
