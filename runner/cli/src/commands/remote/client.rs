//! A running gateway, over its HTTP API.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use softplug_live::plain_text;
use softplug_service::http::Problem;
use softplug_service::view::now_ms;
use ureq::http::{Request, Response, StatusCode};
use ureq::tls::{Certificate, RootCerts, TlsConfig};
use ureq::{Agent, AsSendBody, Body};

use super::{Remote, Within};
use crate::assignment::Assignment;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{self, Partial};

const ADDRESS: &str = "http://127.0.0.1:8117";
const CONNECT: Duration = Duration::from_secs(10);
/// How long the whole answer to a question may take.
const ANSWER: Duration = Duration::from_secs(15);
/// How long an order may take, or the begin of a long answer: a plug-in may be compiled first.
const ORDER: Duration = Duration::from_mins(5);
/// Largest document that is read, in bytes.
const DOCUMENT_BYTES: u64 = 64 * 1024 * 1024;

/// A gateway that can be asked.
#[derive(Debug)]
pub(crate) struct Client {
    pub(super) agent: Agent,
    pub(super) address: String,
    /// Options that say where it is.
    pub(super) named_by: &'static str,
    pub(super) token: Option<String>,
}

impl Client {
    pub(crate) fn new(remote: &Remote) -> Result<Self, Failure> {
        let from_environment =
            || std::env::var("SOFTPLUG_GATEWAY").ok().filter(|is| !is.is_empty());
        let address = remote.gateway.clone().or_else(from_environment);
        let address = address.unwrap_or_else(|| ADDRESS.to_owned());
        if !address.starts_with("http://") && !address.starts_with("https://") {
            return Err(Failure::usage(format_args!("\"{address}\" is no address of a gateway"))
                .hint(format_args!("it is written like {ADDRESS}")));
        }
        let token = match &remote.token_file {
            Some(file) => Some(files::read_text(file)?.trim().to_owned()),
            None => std::env::var("SOFTPLUG_TOKEN").ok().filter(|token| !token.is_empty()),
        };
        let mut configuration = Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            // A token is for the gateway alone.
            .proxy(None)
            .timeout_connect(Some(CONNECT))
            .timeout_recv_response(Some(ORDER));
        if let Some(file) = &remote.ca {
            let pem = files::read(file)?;
            let certificate = Certificate::from_pem(&pem).map_err(|error| {
                let path = file.display();
                Failure::usage(format_args!("{path} holds no certificate: {error}"))
            })?;
            let roots = RootCerts::new_with_certs(&[certificate]);
            configuration =
                configuration.tls_config(TlsConfig::builder().root_certs(roots).build());
        }
        let address = address.trim_end_matches('/').to_owned();
        let named_by = "--gateway or SOFTPLUG_GATEWAY";
        Ok(Self { agent: configuration.build().into(), address, named_by, token })
    }

    pub(crate) fn get<T: DeserializeOwned>(&self, path: &str) -> Result<T, Failure> {
        self.ask("GET", path, None, (), Some(ANSWER)).and_then(|answer| self.read(answer))
    }

    /// What takes longer to be found out.
    pub(crate) fn get_patiently<T: DeserializeOwned>(&self, path: &str) -> Result<T, Failure> {
        self.ask("GET", path, None, (), Some(ORDER)).and_then(|answer| self.read(answer))
    }

    pub(crate) fn post<T: DeserializeOwned>(
        &self,
        path: &str,
        order: Option<&impl Serialize>,
    ) -> Result<T, Failure> {
        self.order("POST", path, order)
    }

    pub(crate) fn put<T: DeserializeOwned>(
        &self,
        path: &str,
        order: &impl Serialize,
    ) -> Result<T, Failure> {
        self.order("PUT", path, Some(order))
    }

    pub(crate) fn order<T: DeserializeOwned>(
        &self,
        method: &str,
        path: &str,
        order: Option<&impl Serialize>,
    ) -> Result<T, Failure> {
        let answer = match order {
            None => self.ask(method, path, None, (), Some(ORDER)),
            Some(order) => {
                let text = serde_json::to_vec(order).map_err(Failure::internal)?;
                self.ask(method, path, Some("application/json"), text, Some(ORDER))
            }
        };
        self.read(answer?)
    }

    /// Sends a body as it is read.
    pub(crate) fn send<T: DeserializeOwned>(
        &self,
        method: &str,
        path: &str,
        body: impl AsSendBody,
    ) -> Result<T, Failure> {
        let answer = self.ask(method, path, Some("application/octet-stream"), body, None)?;
        self.read(answer)
    }

    pub(crate) fn delete(&self, path: &str) -> Result<(), Failure> {
        self.ask("DELETE", path, None, (), Some(ORDER)).map(drop)
    }

    /// Fetches a file, which gets its name when it is complete.
    pub(crate) fn fetch(&self, path: &str, out: &Path, force: bool) -> Result<PathBuf, Failure> {
        Partial::check(out, force)?;
        let answer = self.ask("GET", path, None, (), None)?;
        let mut partial = Partial::create(out, force)?;
        let mut source = answer.into_body().into_reader();
        if let Err(error) = io::copy(&mut source, &mut partial.file) {
            partial.keep();
            let what = format_args!("{} did not come whole: {error}", out.display());
            return Err(Failure::new(Exit::Port, what));
        }
        partial.complete()
    }

    /// The data of each server-sent event, until there are no more.
    pub(crate) fn events(
        &self,
        path: &str,
        mut each: impl FnMut(&str, &str) -> Result<bool, Failure>,
    ) -> Result<(), Failure> {
        let answer = self.ask("GET", path, None, (), None)?;
        let mut lines = BufReader::new(answer.into_body().into_reader());
        let (mut name, mut line) = (String::new(), String::new());
        loop {
            line.clear();
            // No event is longer: the gateway gathers a bounded number of news.
            let read = lines.by_ref().take(DOCUMENT_BYTES).read_line(&mut line);
            let read = read.map_err(|error| self.unreachable(&error.into()))?;
            if read == 0 {
                return Ok(());
            }
            if let Some(event) = line.strip_prefix("event:") {
                event.trim().clone_into(&mut name);
            } else if let Some(data) = line.strip_prefix("data:")
                && !each(&name, data.trim())?
            {
                return Ok(());
            }
        }
    }

    fn ask(
        &self,
        method: &str,
        path: &str,
        kind: Option<&str>,
        body: impl AsSendBody,
        within: Option<Duration>,
    ) -> Result<Response<Body>, Failure> {
        let mut request =
            Request::builder().method(method).uri(format!("{}/api/v1{path}", self.address));
        if let Some(token) = &self.token {
            request = request.header("Authorization", format!("Bearer {token}"));
        }
        if let Some(kind) = kind {
            request = request.header("Content-Type", kind);
        }
        let request = request.body(body).map_err(|error| {
            Failure::usage(format_args!("{} cannot be asked: {error}", self.address))
        })?;
        let request = self.agent.configure_request(request).timeout_global(within).build();
        let answer = self.agent.run(request).map_err(|error| self.unreachable(&error))?;
        if answer.status().is_success() { Ok(answer) } else { Err(self.refusal(answer)) }
    }

    fn read<T: DeserializeOwned>(&self, answer: Response<Body>) -> Result<T, Failure> {
        let mut body = answer.into_body();
        body.with_config().limit(DOCUMENT_BYTES).read_json().map_err(|error| {
            if let ureq::Error::Timeout(_) = error {
                return self.unreachable(&error);
            }
            let what = format_args!("{} answered with something else: {error}", self.address);
            Failure::new(Exit::Port, what).hint("is it a Softplug gateway of this version?")
        })
    }

    fn unreachable(&self, error: &ureq::Error) -> Failure {
        let address = &self.address;
        if let ureq::Error::Timeout(_) = error {
            let what = format_args!("{address} did not answer in time ({error})");
            return Failure::new(Exit::Port, what).hint(format_args!(
                "is it a Softplug gateway? {} says where it is",
                self.named_by
            ));
        }
        let what = format_args!("the gateway at {address} cannot be reached: {error}");
        let named_by = self.named_by;
        Failure::new(Exit::Port, what)
            .hint(format_args!("`softplug gateway run` starts one; {named_by} says where it is"))
    }

    fn refusal(&self, answer: Response<Body>) -> Failure {
        let status = answer.status();
        let mut body = answer.into_body();
        let problem: Option<Problem> = body.with_config().limit(DOCUMENT_BYTES).read_json().ok();
        let sentence = problem.map_or_else(
            || format!("{} answered {status}", self.address),
            |problem| plain_text(&problem.detail),
        );
        let failure = Failure::new(exit_of(status), sentence);
        match status {
            StatusCode::UNAUTHORIZED if self.token.is_none() => {
                failure.hint("give the token with --token-file or SOFTPLUG_TOKEN")
            }
            _ => failure,
        }
    }
}

fn exit_of(status: StatusCode) -> Exit {
    match status {
        StatusCode::NOT_FOUND => Exit::NothingSelected,
        StatusCode::CONFLICT => Exit::Failed,
        StatusCode::REQUEST_TIMEOUT | StatusCode::TOO_MANY_REQUESTS => Exit::Port,
        status if status.is_client_error() => Exit::Usage,
        _ => Exit::Port,
    }
}

/// Names with their values, as orders hold them.
pub(crate) fn pairs(assignments: &[Assignment]) -> BTreeMap<String, String> {
    assignments.iter().map(|of| (of.name.clone(), of.value.clone())).collect()
}

/// A path with what was asked for behind it.
pub(crate) fn query<'a>(
    path: &str,
    asked: impl IntoIterator<Item = (&'static str, Option<&'a str>)>,
) -> String {
    let mut text = path.to_owned();
    for (name, value) in asked {
        if let Some(value) = value {
            let _ = write!(text, "&{name}={}", segment(value));
        }
    }
    text
}

/// From when to when, in milliseconds since 1970.
pub(crate) fn times(within: &Within) -> [Option<String>; 2] {
    let before = |span: Duration| now_ms().saturating_sub(span.as_millis() as u64).to_string();
    [within.since, within.until].map(|span| span.map(before))
}

/// One segment of a path, or a value of a query.
pub(crate) fn segment(text: &str) -> String {
    let mut escaped = String::new();
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_~".contains(&byte) {
            escaped.push(byte.into());
        } else if byte == b'.' && text.len() > 2 {
            escaped.push('.');
        } else {
            let _ = write!(escaped, "%{byte:02X}");
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_in_their_segment() {
        assert_eq!(segment("lathes/O1 ä.nc"), "lathes%2FO1%20%C3%A4.nc");
        assert_eq!(segment(".."), "%2E%2E");
        assert_eq!(segment("a?b#c"), "a%3Fb%23c");
    }
}
