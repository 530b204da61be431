//! TLS for the API, with a certificate from PEM files.

use std::path::PathBuf;
use std::sync::Arc;

use axum_server::tls_rustls::RustlsConfig;
use rustls::ServerConfig;
use rustls::crypto::ring;
use rustls::pki_types::pem::{self, PemObject as _};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};

use crate::config::http::Certificate;

/// Why a certificate cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CertificateError {
    /// A file that cannot be read, or holds nothing of the kind.
    #[error("{} holds no {what} that can be read: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// They are none, or do not fit each other.
    #[error("the certificate {} and its key cannot be used: {error}", path.display())]
    Unfit {
        /// The certificate's file.
        path: PathBuf,
        /// What is wrong.
        error: rustls::Error,
    },
}

/// HTTP/1.1 over TLS 1.2 or 1.3.
pub(super) fn configuration(files: &Certificate) -> Result<RustlsConfig, CertificateError> {
    let Certificate { chain: path, key } = files;
    let unread = |path: &PathBuf, what| {
        let path = path.clone();
        move |error: pem::Error| CertificateError::File { path, what, reason: error.to_string() }
    };
    let unfit = |error| CertificateError::Unfit { path: path.clone(), error };
    let chain: Vec<_> = CertificateDer::pem_file_iter(path)
        .and_then(Iterator::collect)
        .map_err(unread(path, "certificate"))?;
    let key = PrivateKeyDer::from_pem_file(key).map_err(unread(key, "private key"))?;
    let mut configuration = ServerConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .map_err(unfit)?
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .map_err(unfit)?;
    configuration.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(RustlsConfig::from_config(Arc::new(configuration)))
}
