//! The connections there are: how many, and for how long one may keep us waiting.
//!
//! A connection that brings no request head in time after the last answer is closed, however it
//! spreads its bytes, and so is one that takes nothing of its answer. While a request is being handled the handler has the say.

use std::collections::HashMap;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, ready};

use axum_server::accept::Accept;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep_until};

use crate::config::http::Limits;

/// All connections, by where they come from.
#[derive(Clone, Debug)]
pub(super) struct Connections {
    limits: Limits,
    open: Arc<Mutex<HashMap<SocketAddr, Arc<RequestState>>>>,
}

/// How far the request under way is.
#[derive(Debug, Default)]
struct RequestState {
    /// It is being handled.
    busy: AtomicBool,
    /// It has been handled since this was last looked at.
    answered: AtomicBool,
}

impl Connections {
    pub(super) fn new(limits: Limits) -> Self {
        Self { limits, open: Arc::default() }
    }

    pub(super) fn count(&self) -> usize {
        self.open.lock().map_or(0, |open| open.len())
    }

    /// From now on, until the guard goes, a request of this peer is being handled.
    pub(super) fn handling(&self, peer: SocketAddr) -> Handling {
        let state = self.open.lock().ok().and_then(|open| open.get(&peer).cloned());
        let state = state.unwrap_or_default();
        state.busy.store(true, Ordering::Relaxed);
        Handling(state)
    }

    fn admit(&self, stream: TcpStream) -> io::Result<Guarded> {
        let peer = stream.peer_addr()?;
        stream.set_nodelay(true)?;
        let state = Arc::<RequestState>::default();
        {
            let mut open = self.open.lock().map_err(|_| io::ErrorKind::Other)?;
            if open.len() >= self.limits.connections {
                return Err(io::ErrorKind::ConnectionRefused.into());
            }
            open.insert(peer, state.clone());
        }
        Ok(Guarded {
            stream,
            state,
            head: Box::pin(sleep_until(Instant::now() + self.limits.head_patience)),
            stalled: None,
            entry: Entered { peer, connections: self.clone() },
        })
    }
}

/// A request is being handled.
#[derive(Debug)]
pub(super) struct Handling(Arc<RequestState>);

impl Drop for Handling {
    fn drop(&mut self) {
        self.0.answered.store(true, Ordering::Relaxed);
        self.0.busy.store(false, Ordering::Relaxed);
    }
}

impl<S> Accept<TcpStream, S> for Connections {
    type Stream = Guarded;
    type Service = S;
    type Future = std::future::Ready<io::Result<(Guarded, S)>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        std::future::ready(self.admit(stream).map(|stream| (stream, service)))
    }
}

#[derive(Debug)]
struct Entered {
    peer: SocketAddr,
    connections: Connections,
}

impl Drop for Entered {
    fn drop(&mut self) {
        if let Ok(mut open) = self.connections.open.lock() {
            open.remove(&self.peer);
        }
    }
}

/// A connection that ends itself when its client keeps us waiting.
#[derive(Debug)]
pub(super) struct Guarded {
    stream: TcpStream,
    state: Arc<RequestState>,
    /// Until when a request's head must have come.
    head: Pin<Box<Sleep>>,
    /// Since when nothing can be written.
    stalled: Option<Pin<Box<Sleep>>>,
    entry: Entered,
}

impl Guarded {
    fn wrote(
        &mut self,
        context: &mut Context<'_>,
        result: Poll<io::Result<usize>>,
    ) -> Poll<io::Result<usize>> {
        if result.is_ready() {
            self.stalled = None;
            let patience = self.entry.connections.limits.head_patience;
            self.head.as_mut().reset(Instant::now() + patience);
            return result;
        }
        let patience = self.entry.connections.limits.write_patience;
        let stalled =
            self.stalled.get_or_insert_with(|| Box::pin(sleep_until(Instant::now() + patience)));
        ready!(stalled.as_mut().poll(context));
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Guarded {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if self.state.busy.load(Ordering::Relaxed) {
            return read;
        }
        if self.state.answered.swap(false, Ordering::Relaxed) {
            let patience = self.entry.connections.limits.head_patience;
            self.head.as_mut().reset(Instant::now() + patience);
        }
        // Looked at even when something came: a drop now and then is no request.
        match self.head.as_mut().poll(context) {
            Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
            Poll::Pending => read,
        }
    }
}

impl AsyncWrite for Guarded {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.wrote(context, result)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.stream).poll_write_vectored(context, slices);
        self.wrote(context, result)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
