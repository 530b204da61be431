//! The table `[http]`: where the API listens, whom it lets in, and its limits.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use toml::Spanned;

use super::finding::ConfigFindings;
use super::service::{address, bytes};
use super::written::{self, Text};

/// What [`serve`](crate::http::serve) goes by.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Options {
    /// Address and port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// The file of [tokens](crate::http::Tokens). Without one nobody is let in.
    pub tokens: Option<PathBuf>,
    /// Speak TLS with this certificate.
    pub certificate: Option<Certificate>,
    /// Names by which it may be asked for, beside `localhost` and the address.
    pub names: Vec<String>,
    /// How much of what is taken.
    pub limits: Limits,
}

impl Options {
    /// Plain HTTP at this address, for the holders of these tokens.
    pub fn new(listen: SocketAddr, tokens: Option<PathBuf>) -> Self {
        let (names, limits) = (Vec::new(), Limits::default());
        Self { listen, tokens, certificate: None, names, limits }
    }
}

/// A certificate and its key, as PEM files.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Certificate {
    /// The certificate, and those that lead to its authority.
    pub chain: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

/// Limits of the API; what goes past one gets a problem as its answer.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Largest program or plug-in that is taken, in bytes.
    pub upload_bytes: u64,
    /// Connections at one time; a further one is closed at once.
    pub connections: usize,
    /// Requests in a second that one address may go on with.
    pub requests_per_second: u32,
    /// Requests that it may make at once.
    pub burst: u32,
    /// Until a request's head has come, counted from the last answer; then the connection is
    /// closed.
    pub head_patience: Duration,
    /// A client that takes nothing of its answer for as long is gone.
    pub write_patience: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            upload_bytes: 64 * 1024 * 1024,
            connections: 1024,
            requests_per_second: 50,
            burst: 200,
            head_patience: Duration::from_secs(30),
            write_patience: Duration::from_secs(30),
        }
    }
}

pub(super) fn read(
    written: &Spanned<written::Http>,
    folder: &Path,
    problems: &mut ConfigFindings<'_>,
) -> Options {
    let at = written.span();
    let written = written.get_ref();
    let mut listen = SocketAddr::from(([127, 0, 0, 1], 8117));
    if let Some(text) = &written.listen {
        listen = address(text, problems).unwrap_or(listen);
    }
    let path = |text: &Option<Text>| text.as_ref().map(|text| folder.join(text.get_ref()));
    let tokens = path(&written.tokens);
    if tokens.is_none() && !listen.ip().is_loopback() {
        let span = written.listen.as_ref().map_or(at.clone(), Spanned::span);
        problems.add(
            span,
            format_args!("{listen} can be reached from elsewhere, and there are no tokens"),
            "name a file with tokens (tokens = \"tokens.toml\"), or listen on 127.0.0.1",
        );
    }
    let certificate = match (path(&written.certificate), path(&written.key)) {
        (Some(chain), Some(key)) => Some(Certificate { chain, key }),
        (None, None) => None,
        _ => {
            let given = written.certificate.as_ref().or(written.key.as_ref());
            let span = given.map_or(at.clone(), Spanned::span);
            problems.add(span, "certificate and key go together", "give both, or none");
            None
        }
    };
    let is_plain = certificate.is_none() && !written.plain.unwrap_or(false);
    if tokens.is_some() && is_plain && !listen.ip().is_loopback() {
        let span = written.listen.as_ref().map_or(at.clone(), Spanned::span);
        problems.add(
            span,
            format_args!(
                "{listen} can be reached from elsewhere, and tokens would pass in the clear"
            ),
            "give a certificate and a key, or say `plain = true` where something else encrypts",
        );
    }
    let default = Limits::default();
    let upload_bytes = written.upload_bytes.as_ref().map_or(default.upload_bytes, |value| {
        bytes(value, 1, 1 << 40, problems).unwrap_or_default()
    });
    let mut at_least_one = |value: &Option<Spanned<u32>>, default: u32| {
        value.as_ref().map_or(default, |value| {
            if *value.get_ref() == 0 {
                problems.add(value.span(), "it is 0", "give at least 1, or leave it out");
            }
            *value.get_ref()
        })
    };
    let limits = Limits {
        upload_bytes,
        connections: at_least_one(&written.connections, default.connections as u32) as usize,
        requests_per_second: at_least_one(
            &written.requests_per_second,
            default.requests_per_second,
        ),
        burst: at_least_one(&written.burst, default.burst),
        ..default
    };
    Options {
        listen,
        tokens,
        certificate,
        names: names(written.names.as_deref(), problems),
        limits,
    }
}

/// Names by which the API may be asked for.
fn names(written: Option<&[Text]>, problems: &mut ConfigFindings<'_>) -> Vec<String> {
    let mut names = Vec::new();
    for text in written.unwrap_or_default() {
        let name = text.get_ref();
        let is_name = (1..=253).contains(&name.len())
            && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_".contains(&byte));
        if is_name || name.parse::<IpAddr>().is_ok() {
            names.push(name.clone());
        } else {
            let message = format!("\"{}\" is not the name of a host", name.escape_debug());
            let hint = "write it as \"gateway.shop.example\", without a port or a path";
            problems.add(text.span(), message, hint);
        }
    }
    names
}
