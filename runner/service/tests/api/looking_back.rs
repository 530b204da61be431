//! Jobs and journal by kind, time and text; what a link did; groups.

use std::fs;

use serde_json::{Value, json};

use crate::common::bench::{Bench, blocks};

/// Numbers in a list, by this field.
fn numbers(list: &Value, field: &str) -> Vec<u64> {
    list.as_array().unwrap().iter().map(|one| one[field].as_u64().unwrap()).collect()
}

#[test]
fn jobs_are_found_by_kind_program_and_time_a_page_at_a_time() {
    let bench = Bench::new();
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    bench.upload("shaft.nc", b"G0 X1\n").with(201);
    bench.until_link("lathe-1", "idle");
    for program in ["O1.nc", "shaft.nc", "O1.nc", "shaft.nc", "shaft.nc"] {
        let job = bench.post("/links/lathe-1/jobs", &json!({ "program": program })).with(201);
        bench.until(&format!("/jobs/{}", job.json()["id"]), |job| job["state"] == "done");
    }
    let jobs = |query: &str| bench.get(&format!("/jobs?{query}")).with(200).json();
    assert_eq!(numbers(&jobs("find=SHAFT"), "id"), [5, 4, 2]);
    assert_eq!(numbers(&jobs("find=shaft&limit=2"), "id"), [5, 4]);
    assert_eq!(numbers(&jobs("find=shaft&limit=2&before=4"), "id"), [2]);
    assert_eq!(numbers(&jobs("find=shaft&link=lathe-1&state=done&limit=1"), "id"), [5]);
    assert_eq!(numbers(&jobs("find=shaft&state=failed"), "id"), [0_u64; 0]);
    assert_eq!(numbers(&jobs("kind=send"), "id"), [5, 4, 3, 2, 1]);
    assert_eq!(numbers(&jobs("kind=receive"), "id"), [0_u64; 0]);
    let third = jobs("find=o1")[0]["created_ms"].as_u64().unwrap();
    assert_eq!(numbers(&jobs(&format!("since_ms={third}")), "id"), [5, 4, 3]);
    assert_eq!(numbers(&jobs(&format!("until_ms={third}&kind=send")), "id"), [2, 1]);
    bench.get("/jobs?since_ms=yesterday").with(400);
}

#[test]
fn the_journal_is_found_by_text_and_time_a_page_at_a_time() {
    let bench = Bench::new();
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    bench.until_link("lathe-1", "idle");
    let job = bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201);
    bench.until(&format!("/jobs/{}", job.json()["id"]), |job| job["state"] == "done");
    let is_told = |list: &Value| list.as_array().unwrap().len() == 1;
    bench.until("/journal?find=IS+DONE", is_told);
    let journal = |query: &str| bench.get(&format!("/journal?{query}")).with(200).json();
    let of_link = journal("find=LATHE-1&kind=job");
    assert_eq!(of_link.as_array().unwrap().len(), 3, "{of_link:#}");
    let page = journal("find=lathe-1&kind=job&limit=2");
    let last = numbers(&page, "number")[1];
    let rest = journal(&format!("find=lathe-1&kind=job&limit=2&before={last}"));
    let both = [numbers(&page, "number"), numbers(&rest, "number")].concat();
    assert_eq!(both, numbers(&of_link, "number"));
    let done = &journal("find=is+done")[0];
    let at = done["at_ms"].as_u64().unwrap();
    assert_eq!(journal(&format!("find=is+done&since_ms={at}"))[0], *done);
    assert_eq!(journal(&format!("find=is+done&until_ms={at}")), json!([]));
    assert_eq!(journal("find=nothing+like+this"), json!([]));
}

#[test]
fn what_a_link_did_is_kept_second_by_second() {
    let bench = Bench::new();
    let program = blocks(2_000);
    bench.upload("O1.nc", program.as_bytes()).with(201);
    bench.until_link("lathe-1", "idle");
    bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201);
    let sum =
        |list: &Value| -> u64 { list.as_array().unwrap().iter().filter_map(Value::as_u64).sum() };
    let history = bench.until("/links/lathe-1/history", |history| {
        sum(&history["seconds"]["sent"]) > 3_000 && sum(&history["seconds"]["level"]) > 0
    });
    let seconds = &history["seconds"];
    assert_eq!(seconds["step_ms"], 1_000);
    let length = seconds["sent"].as_array().unwrap().len();
    for column in ["level", "received", "held_ms", "line_errors"] {
        assert_eq!(seconds[column].as_array().unwrap().len(), length, "{column}");
    }
    let counted = bench.get("/links/lathe-1").with(200).json()["counters"]["bytes_out"].clone();
    assert!(sum(&seconds["sent"]) <= counted.as_u64().unwrap());
    // How fast, how long yet, and at which block.
    let job = bench.until("/links/lathe-1", |link| link["job"]["rate"].is_u64())["job"].clone();
    let (rate, rest) = (job["rate"].as_u64().unwrap(), job["remaining_us"].as_u64().unwrap());
    let left = job["size"].as_u64().unwrap() - job["surely_left"].as_u64().unwrap();
    assert_eq!(rest, left * 1_000_000 / rate);
    let job = bench.until("/jobs/1", |job| job["block"]["number"].as_u64() > Some(10));
    let number = job["block"]["number"].as_u64().unwrap();
    assert_eq!(job["block"]["text"], format!("N{number} G01 X{number}"));
    bench.get("/links/nobody/history").with(404);
}

#[test]
fn a_group_changes_without_touching_the_link() {
    let bench = Bench::new();
    bench.until_link("lathe-1", "idle");
    assert_eq!(bench.get("/links/lathe-1").with(200).json()["group"], Value::Null);
    bench.upload("O1.nc", blocks(2_000).as_bytes()).with(201);
    bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201);
    bench.until_link("lathe-1", "sending");
    let file = bench.path("gateway.toml");
    let text = fs::read_to_string(&file).unwrap();
    let grouped = text.replace("name = \"lathe-1\"", "name = \"lathe-1\"\ngroup = \"Hall 1\"");
    fs::write(&file, grouped).unwrap();
    let view = bench.post("/reload", &json!({})).with(200).json();
    assert_eq!(view["changed"], json!([{ "name": "lathe-1", "keys": ["group"], "waits": false }]));
    let link = bench.get("/links/lathe-1").with(200).json();
    assert_eq!((&link["group"], &link["state"]), (&json!("Hall 1"), &json!("sending")));
    fs::write(&file, text.replace("name = \"lathe-1\"", "name = \"lathe-1\"\ngroup = \"../x\""))
        .unwrap();
    bench.post("/reload", &json!({})).with(422);
}
