//! The playground: plug-ins against traces in a web page, without a server.
//!
//! The suite and the host with its interpreter make one WebAssembly module that imports nothing.
//! What judges in the page is what judges in the command. The page gives it requests as JSON
//! ([`Playground::answer`]) through the functions that `exports.rs` exports.

pub mod exports;
mod playground;
mod request;

pub use playground::Playground;
