//! Who has called at a unit with TLS, and has not shown yet that it has a key that is known here.

use std::collections::VecDeque;
use std::net::{IpAddr, SocketAddr};

use mio::net::TcpStream;
use mio::{Interest, Registry, Token};
use softplug_abi::Micros;
use softplug_unit_uplink::{TcpUplink, TlsError, TlsKeys};

/// By this a unit is told that something has come over its uplink, or from a caller.
pub(crate) const UPLINK: Token = Token(2);

/// Who has not shown its key after this span is sent away.
const HANDSHAKE: Micros = Micros::from_secs(5);
/// As many are heard at one time; one more, and the first of them is sent away: whoever says nothing must not
/// keep the gateway out.
const MOST: usize = 8;
/// What is said of an address is not said again within this span.
const SAID: Micros = Micros::from_secs(30);
/// Of so many addresses it is known what was said.
const MOST_SAID: usize = 64;

/// Connections whose handshake is under way.
pub(crate) struct Callers {
    keys: TlsKeys,
    /// In the order in which they came.
    waiting: VecDeque<Caller>,
    said: VecDeque<(IpAddr, String, Micros)>,
}

struct Caller {
    uplink: TcpUplink,
    peer: SocketAddr,
    until: Micros,
}

impl Callers {
    pub(crate) fn new(keys: TlsKeys) -> Self {
        Self { keys, waiting: VecDeque::new(), said: VecDeque::new() }
    }

    /// When [`next`](Self::next) is due, whatever comes.
    pub(crate) fn due(&self) -> Option<Micros> {
        self.waiting.front().map(|caller| caller.until)
    }

    /// Somebody has called.
    pub(crate) fn add(
        &mut self,
        stream: TcpStream,
        peer: SocketAddr,
        registry: &Registry,
        now: Micros,
    ) {
        let mut uplink = match TcpUplink::with_tls(stream, &self.keys) {
            Ok(uplink) => uplink,
            Err(why) => return self.turn_away(peer, &why.to_string(), now),
        };
        let both = Interest::READABLE | Interest::WRITABLE;
        if let Err(error) = registry.register(&mut uplink, UPLINK, both) {
            tracing::error!(%error, "an uplink cannot be waited for");
            return;
        }
        self.waiting.push_back(Caller { uplink, peer, until: now + HANDSHAKE });
        if self.waiting.len() > MOST
            && let Some(first) = self.waiting.pop_front()
        {
            self.turn_away(first.peer, "too many call at one time", now);
        }
    }

    /// One that has shown its key.
    pub(crate) fn next(&mut self, now: Micros) -> Option<TcpUplink> {
        let mut at = 0;
        while let Some(caller) = self.waiting.get_mut(at) {
            let why = match caller.uplink.shake_hands() {
                Ok(true) => {
                    let key = caller.uplink.peer_key().map(|key| key.to_string());
                    tracing::info!(peer = %caller.peer, key, "a gateway has shown its key");
                    return self.waiting.remove(at).map(|caller| caller.uplink);
                }
                Ok(false) if now < caller.until => {
                    at += 1;
                    continue;
                }
                Ok(false) => TlsError::Slow.to_string(),
                Err(closed) => closed.to_string(),
            };
            let peer = caller.peer;
            self.waiting.remove(at);
            self.turn_away(peer, &why, now);
        }
        None
    }

    /// Somebody drives the unit.
    pub(crate) fn send_away(&mut self) {
        self.waiting.clear();
    }

    fn turn_away(&mut self, peer: SocketAddr, why: &str, now: Micros) {
        self.said.retain(|(_, _, at)| now < *at + SAID);
        if self.said.iter().any(|(ip, said, _)| *ip == peer.ip() && said == why) {
            tracing::debug!(%peer, %why, "a caller is turned away");
            return;
        }
        tracing::warn!(%peer, %why, "a caller is turned away");
        self.said.push_back((peer.ip(), why.to_owned(), now));
        if self.said.len() > MOST_SAID {
            self.said.pop_front();
        }
    }
}
