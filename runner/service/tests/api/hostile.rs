//! Requests that mean no good: nothing breaks, nothing leaks, nobody enters.

use std::fmt::Write as _;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use proptest::prelude::*;

use crate::common::bench::Bench;

/// All files below a folder, with their lengths.
fn files(folder: &Path) -> Vec<(String, u64)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let metadata = entry.metadata().unwrap();
        if metadata.is_dir() {
            found.extend(files(&entry.path()));
        } else {
            found.push((entry.path().display().to_string(), metadata.len()));
        }
    }
    found.sort();
    found
}

fn status(answer: &str) -> u16 {
    answer.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0)
}

const TRAVERSALS: [&str; 20] = [
    "../tokens.toml",
    "..%2ftokens.toml",
    "..%2Ftokens.toml",
    "%2e%2e/tokens.toml",
    "%2e%2e%2ftokens.toml",
    "%2e%2e%2f%2e%2e%2f%2e%2e%2f%2e%2e%2fetc%2fpasswd",
    "..%252ftokens.toml",
    "..%5ctokens.toml",
    "..%c0%aftokens.toml",
    "%c0%ae%c0%ae/tokens.toml",
    "%2fetc%2fpasswd",
    "//etc/passwd",
    "O1.nc%00.txt",
    "O1.nc%0d%0aX:%20y",
    "lathes%2f..%2f..%2ftokens.toml",
    ".%2ftokens.toml",
    "~root",
    "%2e",
    "%2e%2e",
    ".hidden",
];

#[test]
fn no_path_leads_out_of_its_folder() {
    let bench = Bench::new();
    bench.upload("O1.nc", b"%\nO0001\n").with(201);
    let before = files(&bench.path("programs"));
    let tokens = fs::read(bench.path("tokens.toml")).unwrap();
    for name in TRAVERSALS {
        for folder in ["programs", "links/lathe-1/receptions", "links/lathe-1/traces", "plugins"] {
            let path = format!("/api/v1/{folder}/{name}");
            let answer = bench.raw(bench.request("GET", &path, "").as_bytes());
            assert!((400..500).contains(&status(&answer)), "{path}: {answer}");
            assert!(!answer.contains("root:") && !answer.contains("sha256 ="), "{path}: {answer}");
        }
        let path = format!("/api/v1/programs/{name}?overwrite=true");
        let request = bench.request("PUT", &path, "Content-Length: 4\r\n") + "evil";
        let answer = bench.raw(request.as_bytes());
        assert!((400..500).contains(&status(&answer)), "{path}: {answer}");
        let request = bench.request("DELETE", &path, "").replace(&bench.operator, &bench.admin);
        let answer = bench.raw(request.as_bytes());
        assert!((400..500).contains(&status(&answer)), "{path}: {answer}");
    }
    for path in ["/page/../tokens.toml", "/page/..%2f..%2ftokens.toml", "/../../etc/passwd"] {
        let answer = bench.raw(bench.request("GET", path, "").as_bytes());
        assert!((400..500).contains(&status(&answer)), "{path}: {answer}");
    }
    assert_eq!(files(&bench.path("programs")), before);
    assert_eq!(fs::read(bench.path("tokens.toml")).unwrap(), tokens);
}

#[test]
fn what_is_too_large_is_refused_and_nothing_of_it_stays() {
    let bench = Bench::new();
    let before = files(&bench.path("programs"));
    let huge = "Content-Length: 99999999999\r\n";
    let answer = bench.raw(bench.request("PUT", "/api/v1/programs/O1.nc", huge).as_bytes());
    assert_eq!(status(&answer), 413, "{answer}");
    // Announced as nothing, in pieces.
    let mut request =
        bench.request("PUT", "/api/v1/programs/O1.nc", "Transfer-Encoding: chunked\r\n");
    let piece = format!("{:x}\r\n{}\r\n", 50_000, "G".repeat(50_000));
    (0..21).for_each(|_| request.push_str(&piece));
    let answer = bench.raw((request + "0\r\n\r\n").as_bytes());
    assert_eq!(status(&answer), 413, "{answer}");
    assert_eq!(files(&bench.path("programs")), before);
    bench.upload("O1.nc", &vec![b'G'; 1_000_000]).with(201);

    let long = format!("{{\"program\": \"{}\"}}", "O".repeat(70_000));
    bench.ask("POST", "/links/lathe-1/jobs", &bench.operator, long.as_bytes()).with(413);
    let deep = "[".repeat(60_000);
    bench.ask("POST", "/links/lathe-1/jobs", &bench.operator, deep.as_bytes()).with(400);
    let head = format!("X-Long: {}\r\n", "x".repeat(64 * 1024));
    let answer = bench.raw(bench.request("GET", "/api/v1/links", &head).as_bytes());
    assert!([0, 400, 431].contains(&status(&answer)), "{answer}");
    let many = (0..2_000).fold(String::new(), |mut text, number| {
        let _ = write!(text, "X-{number}: y\r\n");
        text
    });
    let answer = bench.raw(bench.request("GET", "/api/v1/links", &many).as_bytes());
    assert!([0, 400, 431].contains(&status(&answer)), "{answer}");
    let path = format!("/api/v1/links/{}", "a".repeat(40_000));
    let answer = bench.raw(bench.request("GET", &path, "").as_bytes());
    assert!([0, 400, 414, 431].contains(&status(&answer)), "{answer}");
    // To the byte, and in one line as in many.
    let empty = bench.request("GET", "/api/v1/links", "").len();
    for (most, expected) in [(32 * 1024, 200), (32 * 1024 + 1, 431), (40_000, 431)] {
        let one = format!("X-Long: {}\r\n", "x".repeat(most - empty - 10));
        let mut many = "X-Long: y\r\n".repeat(60);
        let rest = most - empty - many.len() - 10;
        let _ = write!(many, "X-Rest: {}\r\n", "x".repeat(rest));
        for head in [one, many] {
            let request = bench.request("GET", "/api/v1/links", &head);
            assert_eq!(request.len(), most);
            let answer = bench.raw(request.as_bytes());
            assert_eq!(status(&answer), expected, "{most} bytes: {answer}");
        }
    }
    bench.get("/links").with(200);
}

/// A stranger's page whose name was made to lead here asks for the stranger's name.
#[test]
fn a_name_that_is_not_ours_is_not_answered() {
    let bench = Bench::with(|options| options.names = vec!["gateway.shop.example".to_owned()]);
    let asked = |path: &str, host: &str| {
        let request = bench.request("GET", path, "").replace("Host: localhost", host);
        status(&bench.raw(request.as_bytes()))
    };
    let port = bench.address().port();
    for path in ["/", "/healthz", "/api/v1/links", "/api/v1/openapi.json", "/nothing"] {
        let own = if path == "/nothing" { 404 } else { 200 };
        assert_eq!(asked(path, "Host: gateway.shop.example"), own, "{path}");
        assert_eq!(asked(path, &format!("Host: 127.0.0.1:{port}")), own, "{path}");
        assert_eq!(asked(path, "Host: rebound.example"), 421, "{path}");
        assert_eq!(asked(path, &format!("Host: rebound.example:{port}")), 421, "{path}");
        assert_eq!(asked(path, "Host: localhost\r\nHost: rebound.example"), 400, "{path}");
        assert_eq!(asked(path, "X: y"), 400, "{path}");
    }
    assert_eq!(asked("http://rebound.example/api/v1/links", "Host: localhost"), 421);
}

#[test]
fn a_body_that_breaks_off_leaves_no_program() {
    let bench = Bench::new();
    let before = files(&bench.path("programs"));
    for (head, body) in [
        ("Content-Length: 1000\r\n", "G0 X1\n"),
        ("Transfer-Encoding: chunked\r\n", "6\r\nG0 X1\n\r\n"),
        ("Transfer-Encoding: chunked\r\n", "6\r\nG0 X1\n\r\nnonsense\r\n"),
    ] {
        let request = bench.request("PUT", "/api/v1/programs/O7.nc", head) + body;
        let answer = bench.raw_and_gone(request.as_bytes());
        assert!(status(&answer) != 201, "{answer}");
    }
    bench.get("/programs/O7.nc").with(404);
    bench.until("/programs", |_| files(&bench.path("programs")) == before);
}

#[test]
fn requests_that_could_be_read_in_two_ways_are_not_read() {
    let bench = Bench::new();
    let get = "GET /api/v1/me HTTP/1.1\r\n";
    for more in ["Content-Length: 5\r\nContent-Length: 6\r\n", "Content-Length: -1\r\n"] {
        let request = bench.request("PUT", "/api/v1/programs/O1.nc", more) + "hello!" + get;
        assert_eq!(status(&bench.raw(request.as_bytes())), 400, "{more}");
    }
    let both = "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n";
    let request = bench.request("PUT", "/api/v1/programs/O2.nc", both) + "0\r\n\r\n" + get;
    let answer = bench.raw(request.as_bytes());
    assert_eq!(answer.matches("HTTP/1.1 ").count(), 1, "{answer}");
    for nonsense in ["\0\0\0\0", "GET\r\n\r\n", "\x16\x03\x01\x02", "GET / HTTP/9.9\r\n\r\n"] {
        let answer = bench.raw_and_gone(nonsense.as_bytes());
        assert!(!answer.starts_with("HTTP/1.1 2"), "{answer}");
    }
    bench.get("/me").with(200);
}

#[test]
fn documents_that_are_not_right_are_refused_by_name() {
    let bench = Bench::new();
    let post =
        |body: &str| bench.ask("POST", "/links/lathe-1/jobs", &bench.operator, body.as_bytes());
    for body in ["", "{", "[]", "null", "{\"progam\": 1}", "{} {}", "{\"priority\": 1e99}", "\u{0}"]
    {
        post(body).with(400);
    }
    let plain = bench.ask_as("POST", "/links/lathe-1/jobs", &bench.operator, "text/plain", b"{}");
    plain.with(415);
    bench.ask("GET", "/jobs/none", &bench.operator, b"").with(400);
    bench.ask("GET", "/jobs/4294967296", &bench.operator, b"").with(400);
    bench.ask("GET", "/jobs?limit=-1", &bench.operator, b"").with(400);
    bench.ask("GET", "/jobs?limit=1001", &bench.operator, b"").with(422);
    bench.ask("GET", "/journal?limit=1001", &bench.operator, b"").with(422);
    let nothing = bench.raw(bench.request("PUT", "/api/v1/programs/O1.nc", "").as_bytes());
    assert_eq!(status(&nothing), 422, "{nothing}");
    bench.ask("GET", "/jobs?colour=red", &bench.operator, b"").with(400);
    bench.ask("GET", "/jobs/4000000", &bench.operator, b"").with(404);
    bench.ask("PATCH", "/jobs", &bench.operator, b"{}").with(405);
    bench.ask("GET", "/links/none", &bench.operator, b"").with(404);
    let fields = bench.ask("POST", "/links/lathe-1/feed?fields=%5B", &bench.operator, b"G0");
    assert_eq!(fields.with(400).json()["field"], "fields");
}

/// Reads until the other side has closed; more than there can be is an error.
fn drain(stream: &mut TcpStream) -> bool {
    let mut buffer = [0; 4096];
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return true,
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => return true,
            Err(_) => return false,
        }
    }
}

#[test]
fn who_dawdles_over_the_head_is_closed_however_the_bytes_are_spread() {
    let bench = Bench::with(|options| options.limits.head_patience = Duration::from_secs(2));
    let mut silent = bench.connect();
    assert!(drain(&mut silent));
    let mut slow = bench.connect();
    let mut closed = false;
    for letter in
        "GET /api/v1/links HTTP/1.1\r\nX-Slow: ".bytes().chain(std::iter::repeat_n(b'x', 2000))
    {
        if slow.write_all(&[letter]).is_err() {
            closed = true;
            break;
        }
        sleep(Duration::from_millis(5));
    }
    assert!(closed || drain(&mut slow), "it was never closed");
    // One that was answered may not stay for ever either.
    let mut idle = bench.connect();
    let request = bench.request("GET", "/api/v1/me", "").replace("close", "keep-alive");
    idle.write_all(request.as_bytes()).unwrap();
    assert!(drain(&mut idle));
    bench.get("/me").with(200);
}

#[test]
fn a_client_that_takes_nothing_of_its_answer_is_let_go() {
    let bench = Bench::with(|options| {
        options.limits.write_patience = Duration::from_millis(200);
        options.limits.head_patience = Duration::from_secs(2);
        options.limits.upload_bytes = 64_000_000;
        options.limits.burst = 100_000;
        options.limits.requests_per_second = 100_000;
    });
    bench.upload("long.nc", &vec![b'G'; 32_000_000]).with(201);
    let mut greedy = bench.connect();
    greedy.write_all(bench.request("GET", "/api/v1/programs/long.nc", "").as_bytes()).unwrap();
    until_connections(&bench, 1);
    // What it reads now is not all.
    let mut came = 0;
    let mut buffer = vec![0; 1 << 20];
    while let Ok(length @ 1..) = greedy.read(&mut buffer) {
        came += length;
    }
    assert!(came < 32_000_000, "{came}");
}

/// Waits until so many connections are left, the one that asks included.
#[track_caller]
fn until_connections(bench: &Bench, most: u64) {
    for _ in 0..600 {
        let answer = bench.raw(bench.request("GET", "/metrics", "").as_bytes());
        let line = answer.lines().find(|line| line.starts_with("softplug_http_connections "));
        let count: u64 = line.and_then(|line| line.split(' ').nth(1)).unwrap().parse().unwrap();
        if count <= most {
            return;
        }
        sleep(Duration::from_millis(50));
    }
    panic!("connections stay open");
}

fn open_files() -> usize {
    fs::read_dir("/proc/self/fd").unwrap().count()
}

#[test]
fn five_hundred_connections_are_served_and_leave_nothing_behind() {
    let bench = Bench::new();
    bench.get("/me").with(200);
    let before = open_files();
    for _ in 0..3 {
        let mut streams: Vec<TcpStream> = (0..500).map(|_| bench.connect()).collect();
        let request = bench.request("GET", "/api/v1/links", "");
        for stream in &mut streams {
            stream.write_all(request.as_bytes()).unwrap();
        }
        for stream in &mut streams {
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap();
            assert_eq!(status(&answer), 200, "{answer}");
        }
    }
    // All at once without a word, then gone in the middle of one.
    let mut streams: Vec<TcpStream> = (0..500).map(|_| bench.connect()).collect();
    for stream in &mut streams {
        stream.write_all(b"PUT /api/v1/programs/x HT").unwrap();
    }
    bench.get("/links").with(200);
    drop(streams);
    until_connections(&bench, 2);
    for _ in 0..600 {
        if open_files() <= before + 8 {
            return;
        }
        sleep(Duration::from_millis(50));
    }
    panic!("{} open files, {before} before", open_files());
}

#[test]
fn connections_over_the_limit_are_closed_and_room_is_made_again() {
    let bench = Bench::with(|options| options.limits.connections = 8);
    let held: Vec<TcpStream> = (0..8).map(|_| bench.connect()).collect();
    // Accepted in their order: when the ninth is closed the eight are in.
    assert!(drain(&mut bench.connect()));
    drop(held);
    let request = bench.request("GET", "/api/v1/me", "");
    let entered = (0..600).any(|_| {
        sleep(Duration::from_millis(20));
        status(&bench.raw(request.as_bytes())) == 200
    });
    assert!(entered);
}

#[test]
fn any_bytes_at_all_leave_it_standing() {
    let bench = Bench::new();
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let heads = prop_oneof![
        Just(String::new()),
        Just("GET /api/v1/".to_owned()),
        Just("PUT /api/v1/programs/".to_owned()),
        Just(bench.request("POST", "/api/v1/links/lathe-1/jobs", "Content-Length: 40\r\n")),
        Just(bench.request("PUT", "/api/v1/programs/x", "Transfer-Encoding: chunked\r\n")),
    ];
    let rest = proptest::collection::vec(any::<u8>(), 0..400);
    let check = runner.run(&(heads, rest), |(head, rest)| {
        let answer = bench.raw_and_gone(&[head.as_bytes(), &rest].concat());
        prop_assert!(status(&answer) < 500, "{answer}");
        Ok(())
    });
    check.unwrap();
    bench.get("/me").with(200);
}
