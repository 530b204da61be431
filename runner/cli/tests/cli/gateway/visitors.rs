//! Many visitors, good and bad: afterwards the process has no more descriptors and memory than before.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;

use rustix::process::Signal;

use super::{Gateway, HANG, bench, link, token, wait_for};

const VISITORS: usize = 500;
const ROUNDS: usize = 6;
/// More than an allocator keeps, and far less than a round of visitors would leave behind.
const SLACK_KIB: usize = 4_096;

fn descriptors(gateway: &Gateway) -> usize {
    fs::read_dir(format!("/proc/{}/fd", gateway.child.id())).unwrap().count()
}

fn resident_kib(gateway: &Gateway) -> usize {
    let status = fs::read_to_string(format!("/proc/{}/status", gateway.child.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").trim().parse().unwrap()
}

/// 500 at once, of five kinds; whoever is answered reads it.
fn visit(gateway: &Gateway, token: &str) {
    let ask = |line: &str, token: &str, more: &str| {
        format!(
            "{line} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n{more}\r\n"
        )
    };
    let kinds = [
        (ask("GET /api/v1/links", token, ""), &["200"][..]),
        (ask("GET /api/v1/links", "softplug_wrong", ""), &["401"]),
        (ask("GET /api/v1/programs/..%2Ft.toml", token, ""), &["400", "404", "422"]),
        // Too large, or one of too many at a time.
        (
            ask("PUT /api/v1/programs/O1.nc", token, "Content-Length: 99999999999\r\n"),
            &["413", "503"],
        ),
        // A slow one, which goes away in the middle.
        ("GET /api/v1/li".to_owned(), &[]),
    ];
    let mut visitors: Vec<_> = (0..VISITORS)
        .map(|_| {
            let stream = TcpStream::connect(&gateway.address).unwrap();
            stream.set_read_timeout(Some(HANG)).unwrap();
            stream
        })
        .collect();
    for (visitor, (request, _)) in visitors.iter_mut().zip(kinds.iter().cycle()) {
        visitor.write_all(request.as_bytes()).unwrap();
    }
    for (visitor, (request, statuses)) in visitors.iter_mut().zip(kinds.iter().cycle()) {
        if !statuses.is_empty() {
            let mut answer = String::new();
            visitor.read_to_string(&mut answer).unwrap();
            let is = |status: &&str| answer.starts_with(&format!("HTTP/1.1 {status}"));
            assert!(statuses.iter().any(is), "{request}: {answer}");
        }
    }
}

#[test]
fn five_hundred_visitors_at_once_leave_nothing_behind() {
    let bench = bench(&link("lathe", "pty:"));
    let text = String::from_utf8(bench.read("gateway.toml")).unwrap();
    let limits = "[http]\nrequests-per-second = 100000\nburst = 100000\n";
    bench.write("gateway.toml", text.replace("[http]\n", limits));
    let token = token(&bench);
    let gateway = Gateway::start(&bench);
    visit(&gateway, &token);
    let mut before = None;
    for round in 0..ROUNDS {
        visit(&gateway, &token);
        let open = || descriptors(&gateway);
        let most = before.map_or(64, |(open, _)| open);
        wait_for("the visitors' leaving", || open() <= most);
        let resident = resident_kib(&gateway);
        if let Some((_, resident_before)) = before {
            assert!(resident <= resident_before + SLACK_KIB, "{resident} {resident_before} KiB");
        } else if round == 1 {
            before = Some((open(), resident));
        }
    }
    assert!(before.is_some(), "it was compared with the second round");
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
}
