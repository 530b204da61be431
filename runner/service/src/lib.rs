//! The Softplug gateway as a service.
