//! The verbs that speak with a gateway: what they say when there is none, or when it is another one.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::thread::{self, JoinHandle};

use crate::bench::Bench;

/// Answers one request with these words; gives what it was asked.
fn one_answer(answer: String) -> (SocketAddr, JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let thread = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut asked = Vec::new();
        let mut buffer = [0; 1024];
        while !asked.windows(4).any(|end| end == b"\r\n\r\n") {
            let length = stream.read(&mut buffer).unwrap();
            assert_ne!(length, 0);
            asked.extend_from_slice(&buffer[..length]);
        }
        stream.write_all(answer.as_bytes()).unwrap();
        String::from_utf8(asked).unwrap()
    });
    (address, thread)
}

fn with_status(status: &str, kind: &str, body: &str) -> String {
    let length = body.len();
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\
         Connection: close\r\n\r\n{body}"
    )
}

fn problem(status: &str, detail: &str) -> String {
    let (code, title) = status.split_once(' ').unwrap();
    let body = format!(
        r#"{{"type":"about:blank","title":"{title}","status":{code},"detail":"{detail}"}}"#
    );
    with_status(status, "application/problem+json", &body)
}

#[test]
fn without_a_gateway_the_network_is_to_blame() {
    // Bound, never accepted from and closed: nobody listens there.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let bench = Bench::new();
    let gateway = format!("http://{address}");
    for words in [["link", "list"], ["job", "list"], ["program", "list"]] {
        let ran = bench.run(&[&words[..], &["--gateway", &gateway]].concat()).with_code(6);
        assert!(ran.err.contains("cannot be reached"), "{ran}");
        assert!(ran.err.contains("softplug gateway run"), "{ran}");
    }
    let ran = bench.run(&["link", "list", "--gateway", "ftp://x", "--json"]).with_code(2);
    assert_eq!(ran.json()["error"]["code"], 2);
}

#[test]
fn a_refusal_is_told_in_the_gateways_words_and_by_its_kind() {
    let bench = Bench::new();
    for (status, code) in [
        ("401 Unauthorized", 2),
        ("403 Forbidden", 2),
        ("404 Not Found", 4),
        ("409 Conflict", 1),
        ("413 Payload Too Large", 2),
        ("422 Unprocessable Entity", 2),
        ("429 Too Many Requests", 6),
        ("500 Internal Server Error", 6),
        ("503 Service Unavailable", 6),
    ] {
        let (address, thread) = one_answer(problem(status, "so it \\u001b[2Jis"));
        let gateway = format!("http://{address}/");
        let ran = bench.run(&["job", "abort", "7", "--gateway", &gateway]).with_code(code);
        assert!(ran.err.contains("so it \\u{1b}[2Jis"), "{status}: {ran}");
        assert!(thread.join().unwrap().starts_with("POST /api/v1/jobs/7/abort HTTP/1.1\r\n"));
    }
}

#[test]
fn the_token_goes_along_and_names_stay_in_their_segment() {
    let bench = Bench::new();
    bench.write("token", "softplug_abc\n");
    let (address, thread) = one_answer(problem("404 Not Found", "no"));
    let gateway = format!("http://{address}");
    let words = ["link", "show", "../jobs?x", "--gateway", &gateway, "--token-file", "token"];
    bench.run(&words).with_code(4);
    let asked = thread.join().unwrap();
    assert!(asked.starts_with("GET /api/v1/links/..%2Fjobs%3Fx HTTP/1.1\r\n"), "{asked}");
    assert!(asked.to_lowercase().contains("authorization: bearer softplug_abc\r\n"), "{asked}");

    let (address, thread) = one_answer(problem("401 Unauthorized", "no"));
    let gateway = format!("http://{address}");
    let mut command = bench.command(&["link", "list"]);
    let output = command.env("SOFTPLUG_GATEWAY", &gateway).env("SOFTPLUG_TOKEN", "t").output();
    assert_eq!(output.unwrap().status.code(), Some(2));
    assert!(thread.join().unwrap().to_lowercase().contains("authorization: bearer t\r\n"));
}

#[test]
fn something_that_is_no_gateway_is_told_apart() {
    let bench = Bench::new();
    let (address, thread) = one_answer(with_status("200 OK", "text/html", "<html>"));
    let gateway = format!("http://{address}");
    let ran = bench.run(&["link", "list", "--gateway", &gateway]).with_code(6);
    assert!(ran.err.contains("answered with something else"), "{ran}");
    thread.join().unwrap();
}

#[test]
fn a_download_that_breaks_off_gets_no_name() {
    let bench = Bench::new();
    let answer = "HTTP/1.1 200 OK\r\nContent-Length: 10\r\nConnection: close\r\n\r\nG0".to_owned();
    let (address, thread) = one_answer(answer);
    let gateway = format!("http://{address}");
    bench.run(&["program", "download", "O1.nc", "--gateway", &gateway]).with_code(6);
    thread.join().unwrap();
    assert_eq!(bench.names(), ["O1.nc.failed"]);
    assert_eq!(bench.read("O1.nc.failed"), b"G0");
}
