//! Programs and jobs over the API, down to a simulated machine.

use std::fmt::Write as _;

use serde_json::json;

use crate::common::bench::Bench;

/// A program of so many blocks.
fn program(blocks: usize) -> Vec<u8> {
    let blocks = (1..=blocks).fold(String::new(), |mut text, n| {
        let _ = writeln!(text, "N{n} G01 X{n} Y-{n}");
        text
    });
    blocks.into_bytes()
}

#[test]
fn a_program_comes_back_as_it_was() {
    let bench = Bench::new();
    let all_bytes: Vec<u8> = (0..=255).cycle().take(100_000).collect();
    for (name, path) in [("O1.nc", "O1.nc"), ("lathes/O2 b.nc", "lathes%2FO2%20b.nc")] {
        let stored = bench.upload(path, &all_bytes).with(201).json();
        assert_eq!((&stored["name"], &stored["bytes"]), (&json!(name), &json!(100_000)));
        assert_eq!(bench.get(&format!("/programs/{path}")).with(200).body, all_bytes);
    }
    let names = bench.get("/programs").with(200).json();
    assert_eq!(names.as_array().unwrap().len(), 2);
    bench.upload("O1.nc", b"other").with(409);
    bench.upload("lathes?overwrite=true", b"a folder is there").with(409);
    bench.upload("O1.nc%2FO2.nc", b"a program is there").with(409);
    bench.upload("O1.nc?overwrite=true", b"other").with(201);
    assert_eq!(bench.get("/programs/O1.nc").with(200).body, b"other");
    bench.upload("O1.nc?overwrite=true", b"").with(422);
    assert_eq!(bench.get("/programs/O1.nc").with(200).body, b"other");
    bench.ask("DELETE", "/programs/O1.nc", &bench.admin, b"").with(204);
    bench.get("/programs/O1.nc").with(404);
}

#[test]
fn a_job_goes_to_the_machine_and_tells_how_it_went() {
    let bench = Bench::new();
    bench.until_link("lathe-1", "idle");
    let sent = program(40);
    bench.upload("O1.nc", &sent).with(201);
    let job = bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201).json();
    assert_eq!(job["link"], "lathe-1");
    let path = format!("/jobs/{}", job["id"]);
    let job = bench.until(&path, |job| job["state"] == "done");
    assert_eq!(job["surely_left"], sent.len());
    let listed = bench.get("/jobs?link=lathe-1&state=done").with(200).json();
    assert_eq!(listed[0]["id"], job["id"]);
    bench.until("/links/lathe-1", |link| {
        link["counters"]["bytes_out"].as_u64().unwrap() >= sent.len() as u64
    });
    let entries = bench.get(&format!("/journal?job={}", job["id"])).with(200).json();
    assert!(!entries.as_array().unwrap().is_empty());
    bench.post(&format!("{path}/abort"), &json!({})).with(409);
    bench.post("/links/lathe-1/jobs", &json!({ "program": "none.nc" })).with(404);
}

#[test]
fn a_job_is_paused_resumed_aborted_and_begun_again() {
    let bench = Bench::new();
    bench.until_link("mill 2", "idle");
    bench.upload("long.nc", &program(4_000)).with(201);
    let order = json!({ "program": "long.nc" });
    let job = bench.post("/links/mill%202/jobs", &order).with(201).json();
    let waiting = bench.post("/links/mill%202/jobs", &order).with(201).json();
    let path = format!("/jobs/{}", job["id"]);
    bench.until(&path, |job| job["surely_left"].as_u64() > Some(100));
    bench.post(&format!("{path}/pause"), &json!({})).with(200);
    bench.until(&path, |job| job["state"] == "paused");
    bench.post(&format!("{path}/restart"), &json!({})).with(409);
    bench.post(&format!("{path}/resume"), &json!({})).with(200);
    bench.until(&path, |job| job["state"] == "running");
    let waits = format!("/jobs/{}", waiting["id"]);
    let first =
        bench.ask("PUT", &format!("{waits}/priority"), &bench.operator, br#"{"priority": 7}"#);
    assert_eq!(first.with(200).json()["priority"], 7);
    bench.post(&format!("{waits}/abort"), &json!({})).with(200);
    bench.until(&waits, |job| job["state"] == "aborted");
    bench.post(&format!("{path}/abort"), &json!({})).with(200);
    let ended = bench.until(&path, |job| job["state"] == "aborted");
    assert!(ended["maybe_left"].as_u64() >= ended["surely_left"].as_u64(), "{ended:#}");
    let again =
        bench.post(&format!("{path}/restart"), &json!({ "from_block": 3_999 })).with(201).json();
    assert_eq!((&again["restart_of"], &again["start_block"]), (&job["id"], &json!(3_999)));
    bench.until(&format!("/jobs/{}", again["id"]), |job| job["state"] == "done");
    let at = |order: &serde_json::Value| bench.post(&format!("{path}/restart"), order);
    let size = program(4_000).len();
    let last = at(&json!({ "from_byte": size - 1 })).with(201).json();
    let done = bench.until(&format!("/jobs/{}", last["id"]), |job| job["state"] == "done");
    assert!(done["text"].as_str().unwrap().contains("it began behind byte"), "{done:#}");
    at(&json!({ "from_byte": size })).with(422);
    let both = at(&json!({ "from_byte": 1, "from_block": 1 })).with(422).json();
    assert!(both["detail"].as_str().unwrap().contains("give one of the two"), "{both:#}");
}

#[test]
fn a_feed_goes_through_without_being_stored() {
    let bench = Bench::new();
    bench.until_link("press-3", "idle");
    let body = program(6);
    let kind = "application/octet-stream";
    let path = "/links/press-3/feed?program=live.nc";
    let job = bench.ask_as("POST", path, &bench.operator, kind, &body).with(201).json();
    assert_eq!(job["program"], "live.nc");
    bench.until(&format!("/jobs/{}", job["id"]), |job| job["state"] == "done");
    let came = body.len() as u64;
    bench.until("/links/press-3", |link| link["counters"]["bytes_out"].as_u64() > Some(came));
    assert_eq!(bench.get("/programs").with(200).json(), json!([]));
    // This plug-in looks at a program before it sends it, and gets it as a whole.
    let path = "/links/lathe-1/feed?program=live.nc";
    let job = bench.ask_as("POST", path, &bench.operator, kind, &body).with(201).json();
    assert_eq!(job["size"], body.len());
    bench.until(&format!("/jobs/{}", job["id"]), |job| job["state"] == "done");
    bench.ask_as("POST", "/links/none/feed", &bench.operator, kind, &body).with(404);
}

#[test]
fn a_feed_that_breaks_off_fails_its_job() {
    let bench = Bench::new();
    bench.until_link("press-3", "idle");
    let head = "Content-Length: 60\r\n";
    let request = bench.request("POST", "/api/v1/links/press-3/feed?program=half.nc", head);
    bench.raw_and_gone((request + "N1 G0\nN2 G0\n").as_bytes());
    let jobs = bench.until("/jobs?link=press-3", |jobs| {
        jobs[0]["state"] == "failed" || jobs[0]["state"] == "aborted"
    });
    assert_ne!(jobs[0]["state"], "done");
    bench.until_link("press-3", "idle");
}

#[test]
fn metrics_show_the_links() {
    let bench = Bench::new();
    bench.until_link("lathe-1", "idle");
    let answer = bench.raw(bench.request("GET", "/metrics", "").as_bytes());
    for line in [
        "softplug_link_up{link=\"lathe-1\"} 1",
        "softplug_link_state{link=\"lathe-1\",state=\"idle\"} 1",
        "softplug_link_buffer_bytes{link=\"mill 2\"} 0",
        "softplug_link_starved_total{link=\"lathe-1\"} 0",
        "softplug_healthy 1.0",
        "# EOF",
    ] {
        assert!(answer.contains(line), "{line}: {answer}");
    }
}

#[test]
fn plug_ins_are_listed_added_and_swapped() {
    let bench = Bench::new();
    bench.until_link("lathe-1", "idle");
    let plugins = bench.get("/plugins").with(200).json();
    let plugin = plugins.as_array().unwrap().iter().find(|of| of["name"] == "xon-xoff").unwrap();
    assert_eq!(plugin["links"], json!(["lathe-1", "mill 2"]));
    let kind = "application/wasm";
    bench.ask_as("POST", "/plugins", &bench.admin, kind, b"\0asm nonsense").with(422);
    let order = json!({ "plugin": "xon-xoff", "when": "now-or-idle" });
    let swap = bench.post("/links/lathe-1/swap", &order).with(200).json();
    assert_eq!(swap["link"], "lathe-1");
    bench.post("/links/lathe-1/swap", &json!({ "plugin": "none" })).with(422);
    bench.post("/links/none/swap", &order).with(404);
}

#[test]
fn buses_are_shown_with_their_units_and_measured_in_the_metrics() {
    let bench = Bench::with_bus();
    let buses = bench.until("/buses", |buses| buses[0]["units"][2]["link"] == "mill-3");
    let bus = &buses[0];
    assert_eq!((&bus["name"], &bus["rate"]), (&"hall".into(), &250_000.0.into()));
    assert_eq!((&bus["efficiency"], &bus["switch_seconds"]), (&0.4.into(), &0.002.into()));
    assert!(bus["measured"]["efficiency"].is_null() && bus["serves"].is_null(), "{bus:#}");
    let unit = &bus["units"][0];
    assert_eq!((&unit["port"], &unit["buffer"]), (&"unit://127.0.0.1:1/mill".into(), &0.into()));
    assert_eq!(unit["slots"][1]["slot"], "B");
    assert_eq!(unit["slots"][1]["state"], "empty");
    let text = bench.raw(bench.request("GET", "/metrics", "").as_bytes());
    for line in [
        "softplug_bus_planned_rate{bus=\"hall\"} 250000.0",
        "softplug_bus_planned_switch_seconds{bus=\"hall\"} 0.002",
        "softplug_bus_unit_level_bytes{bus=\"hall\",link=\"mill-3\"} 0",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}
