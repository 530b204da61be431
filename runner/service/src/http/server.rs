//! The server: its thread, its start and its end.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use axum::Router;
use axum_server::Handle;
use axum_server::tls_rustls::RustlsAcceptor;
use tokio::net::{TcpListener, TcpSocket};
use tokio::runtime::{self, Runtime};
use tokio::sync::watch;

use super::access::AccessControl;
use super::connections::Connections;
use super::limits::HEAD_BYTES;
use super::names::Names;
use super::tls::{self, CertificateError};
use super::tokens::{Tokens, TokensError};
use crate::config::http::Options;

/// Connections that wait to be accepted.
const BACKLOG: u32 = 1024;
/// Threads for calls that block.
const BLOCKING_THREADS: usize = 128;

/// Why the API cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened at.
    #[error("cannot listen at {address}: {error}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        error: io::Error,
    },
    /// The tokens cannot be used.
    #[error(transparent)]
    Tokens(#[from] TokensError),
    /// The certificate cannot be used.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
    /// No thread can be had.
    #[error("cannot start the thread for HTTP: {0}")]
    Thread(io::Error),
}

/// A running server. Dropped, it ends at once.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    handle: Handle<SocketAddr>,
    stopping: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

/// What the routes get besides the gateway.
pub(super) struct RouteParts {
    pub(super) access: Arc<AccessControl>,
    pub(super) stopping: watch::Receiver<bool>,
}

impl Server {
    /// Serves the routes until told to stop.
    pub(super) fn start(
        options: &Options,
        routes: impl FnOnce(RouteParts) -> Router,
    ) -> Result<Self, ServeError> {
        let tokens = Tokens::read(options.tokens.as_deref())?;
        let tls = options.certificate.as_ref().map(tls::configuration).transpose()?;
        let runtime = runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(BLOCKING_THREADS)
            .build()
            .map_err(ServeError::Thread)?;
        let refused = |error| ServeError::Listen { address: options.listen, error };
        let listener = listen(&runtime, options.listen).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let connections = Connections::new(options.limits);
        let names = Names::new(options.listen.ip(), &options.names);
        let access =
            Arc::new(AccessControl::new(tokens, names, connections.clone(), &options.limits));
        let (stopping, stop) = watch::channel(false);
        let routes = routes(RouteParts { access, stopping: stop });
        let handle = Handle::new();
        let serving = serving(listener, connections, tls, handle.clone(), routes);
        let thread = thread::Builder::new()
            .name("http".to_owned())
            .spawn(move || {
                if let Err(error) = runtime.block_on(serving) {
                    tracing::error!("HTTP has ended: {error}");
                }
                // A call that is stuck in the gateway is not waited for.
                runtime.shutdown_timeout(Duration::from_secs(1));
            })
            .map_err(ServeError::Thread)?;
        Ok(Self { address, handle, stopping, thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Takes no more connections, lets requests under way end for as long as `grace`, and ends.
    pub fn stop(mut self, grace: Duration) {
        self.stopping.send_replace(true);
        self.handle.graceful_shutdown(Some(grace));
        self.join();
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stopping.send_replace(true);
        self.handle.shutdown();
        self.join();
    }
}

fn listen(runtime: &Runtime, address: SocketAddr) -> io::Result<TcpListener> {
    let _inside = runtime.enter();
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

async fn serving(
    listener: TcpListener,
    connections: Connections,
    tls: Option<axum_server::tls_rustls::RustlsConfig>,
    handle: Handle<SocketAddr>,
    routes: Router,
) -> io::Result<()> {
    let mut server = axum_server::Server::<SocketAddr>::from_listener(listener).handle(handle);
    // A head that comes in one piece may be twice as long, and is refused at the door.
    server.http_builder().http1().max_buf_size(HEAD_BYTES);
    let service = routes.into_make_service_with_connect_info::<SocketAddr>();
    match tls {
        None => server.acceptor(connections).http1_only().serve(service).await,
        Some(tls) => {
            let acceptor = RustlsAcceptor::new(tls).acceptor(connections);
            server.acceptor(acceptor).http1_only().serve(service).await
        }
    }
}
