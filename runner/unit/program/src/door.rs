//! Where a gateway comes in.

use std::net::SocketAddr;

use mio::net::{TcpListener, TcpStream};
use mio::{Interest, Registry, Token};
use softplug_abi::Micros;
use softplug_unit_uplink::{CanAddress, CanEnd, CanUplink, TcpUplink, TlsKeys, Uplink};

use crate::callers::{Callers, UPLINK};
use crate::config::Reach;
use crate::error::UnitError;

const LISTENER: Token = Token(1);
/// An interface that is down or not there is tried again after this span.
const AGAIN: Micros = Micros::from_millis(500);

/// Where a gateway comes in.
pub(crate) enum Door {
    /// Each gateway makes a connection.
    Tcp(TcpListener),
    /// Each gateway makes a connection, and has to show that it has a key that is known here.
    Tls(TcpListener, Callers),
    /// All hear each other as soon as the interface is up.
    Can {
        address: CanAddress,
        /// When to open it, if it is not open.
        again_at: Option<Micros>,
        /// Why it does not open has been said.
        is_said: bool,
    },
}

impl Door {
    pub(crate) fn open(
        reach: &Reach,
        tls: Option<&TlsKeys>,
        registry: &Registry,
    ) -> Result<Self, UnitError> {
        match reach {
            Reach::Tcp(address) => {
                let failed = |source| UnitError::Listen { address: *address, source };
                let mut listener = TcpListener::bind(*address).map_err(failed)?;
                registry.register(&mut listener, LISTENER, Interest::READABLE).map_err(failed)?;
                Ok(match tls {
                    Some(keys) => Self::Tls(listener, Callers::new(keys.clone())),
                    None => Self::Tcp(listener),
                })
            }
            Reach::Can(address) => Ok(Self::Can {
                address: address.clone(),
                again_at: Some(Micros::ZERO),
                is_said: false,
            }),
        }
    }

    pub(crate) fn address(&self) -> Option<Reach> {
        match self {
            Self::Tcp(listener) | Self::Tls(listener, _) => {
                listener.local_addr().ok().map(Reach::Tcp)
            }
            Self::Can { address, .. } => Some(Reach::Can(address.clone())),
        }
    }

    /// When [`Self::next`] is due.
    pub(crate) fn again_at(&self) -> Option<Micros> {
        match self {
            Self::Tcp(_) => None,
            Self::Tls(_, callers) => callers.due(),
            Self::Can { again_at, .. } => *again_at,
        }
    }

    /// An uplink by which somebody may call. `is_driven`: there is a session already.
    pub(crate) fn next(
        &mut self,
        is_driven: bool,
        registry: &Registry,
        now: Micros,
    ) -> Option<Uplink> {
        let mut uplink = match self {
            Self::Tcp(listener) => {
                let (stream, _) = next_caller(listener, is_driven)?;
                Uplink::Tcp(TcpUplink::new(stream))
            }
            Self::Tls(listener, callers) => {
                while let Some((stream, peer)) = next_caller(listener, is_driven) {
                    callers.add(stream, peer, registry, now);
                }
                if is_driven {
                    callers.send_away();
                }
                return callers.next(now).map(Uplink::Tcp);
            }
            Self::Can { address, again_at, is_said } => {
                again_at.take_if(|at| *at <= now)?;
                match CanUplink::open(address, CanEnd::Unit) {
                    Ok(uplink) => Uplink::Can(uplink),
                    Err(error) => {
                        *again_at = Some(now + AGAIN);
                        if !std::mem::replace(is_said, true) {
                            tracing::error!(%error, %address, "the uplink does not open yet");
                        }
                        return None;
                    }
                }
            }
        };
        let both = Interest::READABLE | Interest::WRITABLE;
        if let Err(error) = registry.register(&mut uplink, UPLINK, both) {
            tracing::error!(%error, "an uplink cannot be waited for");
            self.uplink_is_gone(now);
            return None;
        }
        Some(uplink)
    }

    /// What [`Self::next`] gave is of no more use.
    pub(crate) fn uplink_is_gone(&mut self, now: Micros) {
        if let Self::Can { again_at, .. } = self {
            *again_at = Some(now + AGAIN);
        }
    }
}

/// Whoever has called; with `is_driven` all are sent away.
fn next_caller(listener: &TcpListener, is_driven: bool) -> Option<(TcpStream, SocketAddr)> {
    loop {
        let (stream, peer) = listener.accept().ok()?;
        if !is_driven {
            return Some((stream, peer));
        }
        // Its server calls again; if the one that is there is gone, its silence ends it.
        tracing::debug!(%peer, "a second server is sent away");
    }
}
