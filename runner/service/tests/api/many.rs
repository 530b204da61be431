//! Many clients that ask for much: machines are fed as if nobody asked.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use redb::{Database, TableDefinition};
use serde_json::json;

use crate::common::bench::Bench;

const CLIENTS: usize = 16;
const JOBS: u32 = 20_000;

/// A database as an older gateway left it: without what leads to jobs by link and state.
fn twenty_thousand_jobs(folder: &Path) {
    fs::create_dir(folder.join("state")).unwrap();
    let database = Database::create(folder.join("state/jobs.redb")).unwrap();
    let writing = database.begin_write().unwrap();
    {
        let jobs: TableDefinition<'_, u32, &[u8]> = TableDefinition::new("jobs");
        let mut jobs = writing.open_table(jobs).unwrap();
        for id in 1..=JOBS {
            let job = json!({
                "id": id, "link": "mill 2", "kind": "send", "job_kind": "send", "state": "done",
                "program": format!("O{id}.nc"), "created": 1, "began": 2, "ended": 3,
                "data": { "sha256": "0".repeat(64), "size": 1_000 },
            });
            jobs.insert(id, job.to_string().as_bytes()).unwrap();
        }
        let numbers: TableDefinition<'_, &str, u64> = TableDefinition::new("numbers");
        let mut numbers = writing.open_table(numbers).unwrap();
        numbers.insert("next-job", u64::from(JOBS) + 1).unwrap();
        numbers.insert("next-entry", 1).unwrap();
    }
    writing.commit().unwrap();
}

fn spans(mut spans: Vec<Duration>) -> String {
    spans.sort();
    let at = |hundredth: usize| spans[(spans.len() - 1) * hundredth / 100];
    format!("p50 {:?}, p99 {:?}, {} calls", at(50), at(99), spans.len())
}

/// Whatever comes in between, the clients stop.
struct AtTheEnd<'a>(&'a AtomicBool);

impl Drop for AtTheEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn clients_that_list_twenty_thousand_jobs_starve_no_machine() {
    let quick = |options: &mut softplug_service::http::Options| {
        options.limits.requests_per_second = 100_000;
        options.limits.burst = 100_000;
    };
    let bench = Bench::prepared(quick, twenty_thousand_jobs);
    // Some twelve seconds on the line, of which the buffer holds one and a half.
    let program = b"N10 G1 X12.5 Y-3.25\n".repeat(1_200);
    bench.upload("O1.nc", &program).with(201);
    let stop = AtomicBool::new(false);
    let lists = AtomicUsize::new(0);
    let (mut asked, mut submitted) = (Vec::new(), Vec::new());
    thread::scope(|scope| {
        let _at_the_end = AtTheEnd(&stop);
        let clients: Vec<_> = (0..CLIENTS)
            .map(|client| {
                let (bench, stop, lists) = (&bench, &stop, &lists);
                scope.spawn(move || {
                    let path = [
                        "/jobs?limit=1000",
                        "/jobs?limit=1000&state=queued",
                        "/jobs?limit=1000&link=lathe-1",
                        "/jobs?limit=500&link=mill%202&state=done&before=9000",
                    ][client % 4];
                    let mut spans = Vec::new();
                    while !stop.load(Ordering::Relaxed) {
                        let at = Instant::now();
                        bench.get(path).with(200);
                        spans.push(at.elapsed());
                        lists.fetch_add(1, Ordering::Relaxed);
                    }
                    spans
                })
            })
            .collect();
        let order = json!({ "program": "O1.nc" });
        let job = bench.post("/links/lathe-1/jobs", &order).with(201).json()["id"].clone();
        let began = Instant::now();
        loop {
            let at = Instant::now();
            let job = bench.post("/links/press-3/jobs", &order).with(201).json()["id"].clone();
            submitted.push(at.elapsed());
            // Unless it has begun and failed meanwhile.
            bench.post(&format!("/jobs/{job}/abort"), &json!({}));
            let link = bench.get("/links/lathe-1").with(200).json();
            if link["job"].is_null() && link["queued"] == 0 {
                break;
            }
            assert!(began.elapsed() < Duration::from_mins(3), "{link:#}");
            thread::sleep(Duration::from_millis(100));
        }
        stop.store(true, Ordering::Relaxed);
        for client in clients {
            asked.extend(client.join().unwrap());
        }
        let job = bench.get(&format!("/jobs/{job}")).with(200).json();
        assert_eq!((job["state"].as_str(), job["taken"].as_u64()), (Some("done"), Some(24_000)));
    });
    let link = bench.get("/links/lathe-1").with(200).json();
    println!("lists: {}", spans(asked));
    println!("submitting beside them: {}", spans(submitted));
    println!("smallest level of the buffer: {}", link["buffer"]["smallest"]);
    assert!(lists.load(Ordering::Relaxed) >= CLIENTS);
    // A moment where the job begins or ends means nothing; the machine never waited in between.
    let starved = |count: &str| link["counters"][count].as_u64().unwrap();
    println!("starved {} times, {} µs", starved("starved"), starved("starved_us"));
    assert!(starved("starved") <= 1 && starved("starved_us") < 250_000, "{link:#}");
    // What leads to jobs was made for those that were there.
    let page = bench.get("/jobs?limit=3&link=mill%202&state=done&before=9000").with(200).json();
    let ids: Vec<_> = page.as_array().unwrap().iter().map(|job| job["id"].as_u64()).collect();
    assert_eq!(ids, [Some(8_999), Some(8_998), Some(8_997)]);
    let failed = bench.get("/jobs?state=failed&limit=1000").with(200).json();
    let is_failed = |job: &serde_json::Value| job["state"] == "failed" && job["link"] == "press-3";
    assert!(failed.as_array().unwrap().iter().all(is_failed));
}
