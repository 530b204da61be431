//! The Softplug gateway as a service.

pub mod http;
