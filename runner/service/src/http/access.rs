//! What every request passes before it is handled: the rate, the length of its head, the name
//! that it asks for, then the token.

use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::{ConnectInfo, FromRequestParts, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};

use super::connections::Connections;
use super::limits::HEAD_BYTES;
use super::names::Names;
use super::problem::Problem;
use super::tokens::{Role, Tokens};
use crate::config::http::Limits;
use crate::metrics::Tally;

/// Addresses are forgotten after so many requests, as far as they have been quiet.
const FORGET_EVERY: u64 = 4096;

/// Who may have what: tokens, names of this host, rates, connections.
#[derive(Debug)]
pub(super) struct AccessControl {
    tokens: Tokens,
    names: Names,
    rate: DefaultKeyedRateLimiter<IpAddr>,
    connections: Connections,
    pub(super) tally: Tally,
}

impl AccessControl {
    pub(super) fn new(
        tokens: Tokens,
        names: Names,
        connections: Connections,
        limits: &Limits,
    ) -> Self {
        let at_least_one = |number| NonZeroU32::new(number).unwrap_or(NonZeroU32::MIN);
        let quota = Quota::per_second(at_least_one(limits.requests_per_second))
            .allow_burst(at_least_one(limits.burst));
        let rate = RateLimiter::keyed(quota);
        Self { tokens, names, rate, connections, tally: Tally::default() }
    }

    pub(super) fn connections(&self) -> usize {
        self.connections.count()
    }

    fn hasty(&self, peer: SocketAddr) -> bool {
        let count = self.tally.requests.fetch_add(1, Ordering::Relaxed);
        if count % FORGET_EVERY == FORGET_EVERY - 1 {
            self.rate.retain_recent();
        }
        self.rate.check_key(&origin(peer.ip())).is_err()
    }

    fn role(&self, headers: &HeaderMap) -> Result<Role, Problem> {
        let stranger = |sentence| Problem::new(StatusCode::UNAUTHORIZED, sentence);
        let Some(token) = headers.get(header::AUTHORIZATION).and_then(bearer) else {
            return Err(stranger(if self.tokens.is_empty() {
                "this gateway has no tokens; `softplug gateway token` makes one"
            } else {
                "a token is needed: `Authorization: Bearer …`"
            }));
        };
        self.tokens.role(token).ok_or_else(|| stranger("this token is not known"))
    }
}

/// Whose requests are counted together: an address, or a subscriber's network.
fn origin(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => Ipv6Addr::from(u128::from(address) & !u128::from(u64::MAX)).into(),
        address @ IpAddr::V4(_) => address,
    }
}

fn bearer(value: &HeaderValue) -> Option<&str> {
    let (scheme, token) = value.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

/// The length of a request's head, as it is written without spaces that need not be.
fn head_bytes(request: &Request) -> usize {
    let uri = request.uri();
    let whole = uri.authority().map_or(0, |authority| "http://".len() + authority.as_str().len());
    let path = uri.path_and_query().map_or(0, |path| path.as_str().len());
    let first = request.method().as_str().len() + " ".len() + whole + path + " HTTP/1.1\r\n".len();
    let line = |(name, value): (&header::HeaderName, &HeaderValue)| {
        name.as_str().len() + ": ".len() + value.len() + "\r\n".len()
    };
    first + request.headers().iter().map(line).sum::<usize>() + "\r\n".len()
}

/// Outermost: the rate, the headers that every answer has, the counters.
pub(super) async fn pass(
    State(access): State<Arc<AccessControl>>,
    ConnectInfo(peer): ConnectInfo<SocketAddr>,
    request: Request,
    next: Next,
) -> Response {
    let _handling = access.connections.handling(peer);
    let mut response = if access.hasty(peer) {
        access.tally.hasty.fetch_add(1, Ordering::Relaxed);
        let sentence = "too many requests from this address; try again in a second";
        Problem::new(StatusCode::TOO_MANY_REQUESTS, sentence).into_response()
    } else if head_bytes(&request) > HEAD_BYTES {
        let sentence = format!("the head of a request has at most {HEAD_BYTES} bytes");
        let problem = Problem::new(StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE, sentence);
        let mut response = problem.into_response();
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
        response
    } else if let Err(problem) = access.names.check(&request) {
        problem.into_response()
    } else {
        next.run(request).await
    };
    if response.status().is_server_error() {
        access.tally.failed.fetch_add(1, Ordering::Relaxed);
    }
    let headers = response.headers_mut();
    for (name, value) in [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::CONTENT_SECURITY_POLICY, "default-src 'none'; frame-ancestors 'none'"),
    ] {
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Before all that is not public: only with a token.
pub(super) async fn known(
    State(access): State<Arc<AccessControl>>,
    mut request: Request,
    next: Next,
) -> Response {
    match access.role(request.headers()) {
        Ok(Role::Viewer) if !request.method().is_safe() => {
            let sentence = "a viewer's token only shows; an operator's may do this";
            Problem::new(StatusCode::FORBIDDEN, sentence).into_response()
        }
        Ok(role) => {
            request.extensions_mut().insert(role);
            next.run(request).await
        }
        Err(problem) => {
            access.tally.strangers.fetch_add(1, Ordering::Relaxed);
            problem.into_response()
        }
    }
}

/// The request's token is an admin's.
#[derive(Copy, Clone, Debug)]
pub(super) struct Admin;

impl<S: Sync> FromRequestParts<S> for Admin {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        match parts.extensions.get::<Role>() {
            Some(Role::Admin) => Ok(Self),
            _ => Err(Problem::new(StatusCode::FORBIDDEN, "only an admin's token may do this")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bearer_tokens_are_read() {
        let of = |text: &'static str| bearer(&HeaderValue::from_static(text)).map(str::to_owned);
        assert_eq!(of("Bearer abc").as_deref(), Some("abc"));
        assert_eq!(of("bearer  abc ").as_deref(), Some("abc"));
        assert_eq!(of("Basic abc"), None);
        assert_eq!(of("Bearer"), None);
    }

    #[test]
    fn a_network_is_one_origin() {
        let of = |text: &str| origin(text.parse().unwrap());
        assert_eq!(of("2001:db8::1"), of("2001:db8::ffff:2"));
        assert_ne!(of("2001:db8::1"), of("2001:db8:0:1::1"));
        assert_eq!(of("::ffff:192.0.2.1"), of("192.0.2.1"));
        assert_ne!(of("192.0.2.1"), of("192.0.2.2"));
    }
}
