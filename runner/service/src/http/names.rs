//! By which names the API may be asked for.
//!
//! A stranger's page can have its own name lead to this address (DNS rebinding); for the browser it
//! is then of one origin with us. The name that the browser asks for stays the stranger's.

use std::net::IpAddr;

use axum::extract::Request;
use axum::http::{StatusCode, Version, header};

use super::problem::Problem;

/// The names that are ours: those of this machine to itself, the address that is listened at,
/// and what the configuration names. Ports are not looked at.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Names {
    listen: IpAddr,
    configured: Vec<String>,
}

impl Names {
    pub(super) fn new(listen: IpAddr, configured: &[String]) -> Self {
        let configured = configured.iter().map(|name| plain(name)).collect();
        Self { listen, configured }
    }

    /// Whether the request asks for us.
    pub(super) fn check(&self, request: &Request) -> Result<(), Problem> {
        let mut hosts = request.headers().get_all(header::HOST).iter();
        let host = match (hosts.next(), hosts.next()) {
            (Some(host), None) => host.to_str().ok().map(without_port),
            (Some(_), Some(_)) => return Err(Problem::bad("a request has one `Host`")),
            // Nothing that runs pages of strangers is as old.
            (None, _) if request.version() < Version::HTTP_11 => Some("localhost"),
            (None, _) => return Err(Problem::bad("a request needs a `Host`")),
        };
        // A whole address in the first line counts before the header.
        for host in [host, request.uri().host()].into_iter().flatten() {
            if !self.are_ours(host) {
                let host: String = host.chars().take(80).flat_map(char::escape_debug).collect();
                return Err(Problem::new(
                    StatusCode::MISDIRECTED_REQUEST,
                    format!(
                        "this gateway is not called \"{host}\"; if it is, say so with `names` in [http]"
                    ),
                ));
            }
        }
        host.map(drop).ok_or_else(|| Problem::bad("the `Host` cannot be read"))
    }

    fn are_ours(&self, host: &str) -> bool {
        let name = plain(host);
        if name == "localhost" || self.configured.contains(&name) {
            return true;
        }
        // An address is what it is: nobody can have another lead here.
        name.trim_matches(['[', ']']).parse().is_ok_and(|address: IpAddr| {
            let address = address.to_canonical();
            address.is_loopback()
                || self.listen.is_unspecified()
                || address == self.listen.to_canonical()
        })
    }
}

fn without_port(host: &str) -> &str {
    match host.rsplit_once(':') {
        // The colons of an address stand in brackets.
        Some((name, port))
            if port.bytes().all(|byte| byte.is_ascii_digit()) && !name.ends_with(':') =>
        {
            name
        }
        _ => host,
    }
}

fn plain(name: &str) -> String {
    name.strip_suffix('.').unwrap_or(name).to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use axum::body::Body;

    use super::*;

    fn asked(listen: &str, uri: &str, hosts: &[&str]) -> Result<(), u16> {
        let names = Names::new(listen.parse().unwrap(), &["Gateway.Shop.example".to_owned()]);
        let mut request = Request::builder().uri(uri);
        for host in hosts {
            request = request.header("Host", *host);
        }
        let request = request.body(Body::empty()).unwrap();
        names.check(&request).map_err(|problem| problem.status)
    }

    #[test]
    fn only_our_own_names_are_answered() {
        let of = |host: &str| asked("127.0.0.1", "/", &[host]);
        for host in [
            "localhost",
            "LocalHost:8117",
            "localhost.",
            "127.0.0.1",
            "127.0.0.1:8117",
            "127.1.2.3",
            "[::1]",
            "[::1]:8117",
            "gateway.shop.example",
            "gateway.shop.EXAMPLE.:80",
        ] {
            assert_eq!(of(host), Ok(()), "{host}");
        }
        for host in [
            "evil.example",
            "localhost.evil.example",
            "evil.example:8117",
            "127.0.0.1.evil.example",
            "192.0.2.1",
            "0.0.0.0",
            "gateway.shop.example.evil",
            "shop.example",
            "",
            ":8117",
            "[::2]:1",
            "localhost:x",
            "127.1",
        ] {
            assert_eq!(of(host), Err(421), "{host}");
        }
        assert_eq!(asked("192.0.2.7", "/", &["192.0.2.7:8117"]), Ok(()));
        assert_eq!(asked("192.0.2.7", "/", &["192.0.2.8:8117"]), Err(421));
        for any in ["0.0.0.0", "::"] {
            assert_eq!(asked(any, "/", &["192.0.2.8:8117"]), Ok(()));
            assert_eq!(asked(any, "/", &["evil.example"]), Err(421));
        }
        assert_eq!(asked("::ffff:192.0.2.7", "/", &["192.0.2.7"]), Ok(()));
    }

    #[test]
    fn there_is_one_name_and_it_stands_wherever_it_may() {
        assert_eq!(asked("127.0.0.1", "/", &[]), Err(400));
        assert_eq!(asked("127.0.0.1", "/", &["localhost", "localhost"]), Err(400));
        assert_eq!(asked("127.0.0.1", "http://evil.example/", &["localhost"]), Err(421));
        assert_eq!(asked("127.0.0.1", "http://localhost/", &["evil.example"]), Err(421));
        assert_eq!(asked("127.0.0.1", "http://localhost:8117/", &["localhost"]), Ok(()));
    }
}
