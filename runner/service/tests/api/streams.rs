//! Server-sent events: what changes, and what passes on a line.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};

use crate::common::bench::Bench;

/// Begins to listen; gives what is sent, event by event.
fn listen(bench: &Bench, path: &str) -> BufReader<TcpStream> {
    let mut stream = bench.connect();
    stream.write_all(bench.request("GET", path, "").as_bytes()).unwrap();
    let mut lines = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        assert_ne!(lines.read_line(&mut head).unwrap(), 0, "{head}");
    }
    assert!(head.starts_with("HTTP/1.1 200 "), "{head}");
    assert!(head.to_lowercase().contains("content-type: text/event-stream"), "{head}");
    lines
}

/// The news of the next event of this name; `None` when the stream has ended.
fn next(lines: &mut BufReader<TcpStream>, name: &str) -> Option<Vec<Value>> {
    let mut is_this = false;
    let mut heartbeats = 0;
    let mut line = String::new();
    loop {
        line.clear();
        if lines.read_line(&mut line).unwrap() == 0 {
            return None;
        }
        heartbeats += u32::from(line.starts_with(':'));
        assert!(heartbeats < 6, "no {name} comes");
        if let Some(event) = line.strip_prefix("event:") {
            is_this = event.trim() == name;
        } else if let Some(data) = line.strip_prefix("data:")
            && is_this
        {
            return Some(serde_json::from_str(data.trim()).unwrap());
        }
    }
}

#[test]
fn changes_are_told_as_they_happen() {
    let bench = Bench::new();
    bench.until_link("lathe-1", "idle");
    bench.upload("O1.nc", b"G0 X1\nM30\n").with(201);
    let mut events = listen(&bench, "/api/v1/events");
    let job = bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201).json();
    let (mut seen, mut journal) = (Vec::new(), Vec::new());
    let is_over = |journal: &[String]| journal.iter().any(|text| text.contains("is done"));
    while !seen.iter().any(|state| state == "done") || !is_over(&journal) {
        for change in next(&mut events, "changes").expect("it goes on") {
            if change["change"] == "job" && change["id"] == job["id"] {
                seen.push(change["state"].as_str().unwrap().to_owned());
            } else if change["change"] == "journal" && change["job"] == job["id"] {
                journal.push(change["text"].as_str().unwrap().to_owned());
            }
        }
    }
    assert!(journal[0].contains("is queued") && journal[1].contains("begins"), "{journal:?}");
}

#[test]
fn a_line_is_watched_byte_by_byte() {
    let bench = Bench::new();
    bench.until_link("lathe-1", "idle");
    let mut events = listen(&bench, "/api/v1/links/lathe-1/watch");
    bench.upload("O1.nc", b"G0 X1\nM30\n").with(201);
    bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201);
    let mut sent = String::new();
    while !sent.contains("47302058310a4d33300a") {
        for seen in next(&mut events, "seen").expect("it goes on") {
            assert_eq!(seen["dropped"], 0);
            if seen["seen"] == "sent" {
                sent.push_str(&seen["hex"].as_str().unwrap().to_lowercase());
            }
        }
    }
    bench.ask("GET", "/links/none/watch", &bench.operator, b"").with(404);
}

#[test]
fn streams_end_when_the_gateway_stops() {
    let mut bench = Bench::new();
    let mut streams: Vec<_> = (0..5).map(|_| listen(&bench, "/api/v1/events")).collect();
    bench.server.take().unwrap().stop(Duration::from_mins(1));
    for stream in &mut streams {
        while next(stream, "changes").is_some() {}
    }
}
