//! The HTTP API: who is let in, what can be asked for, and within which limits.
//!
//! HTTP runs on a thread of its own, with a runtime of its own; calls into the gateway run on
//! threads that may block. Nothing here is on the way of the bytes.

mod access;
mod connections;
mod extract;
mod limits;
mod names;
mod problem;
mod routes;
mod server;
mod stream;
mod tls;
mod tokens;
mod upload;

pub use crate::config::http::{Certificate, Limits, Options};
pub use problem::Problem;
pub use routes::MeView;
pub use server::{ServeError, Server};
pub use tls::CertificateError;
pub use tokens::{Entry, Role, Tokens, TokensError, new_token};

use crate::Gateway;

/// Serves the API and the page for a gateway.
///
/// # Errors
/// The address, the tokens or the certificate cannot be used.
pub fn serve(gateway: Gateway, options: &Options) -> Result<Server, ServeError> {
    Server::start(options, |parts| routes::all(gateway, options.limits, parts))
}
