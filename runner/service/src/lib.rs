//! The Softplug gateway as a service.

pub mod disk;
pub mod guess;
pub mod http;
pub mod library;
