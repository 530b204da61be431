//! What the web page costs its browser, with many links: when the links are first to be seen, and how
//! much of a core it takes to keep them up to date. Needs Chromium.
//!
//! `cargo run --release -p softplug-service --example page_load -- [LINKS JOBS SECONDS]`; so many
//! of the links send a program meanwhile. The plug-ins are those of `SOFTPLUG_PLUGINS`.

#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/common/bench.rs"]
mod bench;
#[allow(dead_code, reason = "shared with the tests of the page")]
#[path = "../tests/page/browser.rs"]
mod browser;

use std::fmt::Write as _;
use std::thread::sleep;
use std::time::{Duration, Instant};

use bench::{Bench, blocks};
use browser::Browser;
use serde_json::{Value, json};

/// What is looked at: the address, and what must be there of each link.
const VIEWS: [(&str, &str); 3] = [
    ("links", ".dense .row"),
    ("links?show=working&sort=rest", ".dense .row"),
    ("wall", ".tiles li"),
];

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse().expect("a number"));
    let links: usize = numbers.next().unwrap_or(1_000);
    let jobs: usize = numbers.next().unwrap_or(links / 3);
    let seconds = Duration::from_secs(numbers.next().unwrap_or(20) as u64);
    let mut written = String::new();
    for number in 1..=links {
        let _ = write!(
            written,
            "[[link]]\nname = \"mill-{number:04}\"\ngroup = \"Hall {}\"\nport = \"simulate:xon-xoff\"\n\
             line = \"1200 8N1\"\nplugin = \"xon-xoff\"\n",
            1 + number % 8
        );
    }
    let bench = Bench::with_links(&written);
    let program = blocks(5_000);
    bench.upload("O1.nc", program.as_bytes()).with(201);
    for number in 1..=jobs {
        let path = format!("/links/mill-{number:04}/jobs");
        bench.post(&path, &json!({ "program": "O1.nc" })).with(201);
    }
    println!("{links} links, of which {jobs} send a program");
    let mut browser = Browser::open();
    browser.size(1280, 900);
    browser.call("Performance.enable", json!({}));
    browser.go(&bench.url("/"));
    browser.until("document.activeElement?.name === 'token'");
    let token = Value::from(bench.operator.as_str());
    browser.value(&format!("sessionStorage.setItem('softplug-token', {token})"));
    for (view, kind) in VIEWS {
        let shown = if view.contains("working") { jobs } else { links };
        browser.value(&format!("location.hash = '#/{view}'"));
        browser.call("Page.reload", json!({}));
        browser.until(&format!(
            "performance.getEntriesByName('links').length && document.querySelectorAll('{kind}').length >= {shown}"
        ));
        let first = first_paint(&mut browser);
        sleep(Duration::from_secs(3));
        let (before, began) = (metrics(&mut browser), Instant::now());
        sleep(seconds);
        let (after, span) = (metrics(&mut browser), began.elapsed().as_secs_f64());
        let each = |name: &str| (value(&after, name) - value(&before, name)) * 1_000.0 / span;
        println!(
            "#/{view}: links in sight {first:.0} ms after the address; of each second {:.0} ms of one \
             core, of which scripts {:.0}, styles {:.0}, layout {:.0}; {:.0} nodes, heap {:.1} MB",
            each("TaskDuration"),
            each("ScriptDuration"),
            each("RecalcStyleDuration"),
            each("LayoutDuration"),
            value(&after, "Nodes"),
            value(&after, "JSHeapUsedSize") / 1e6
        );
    }
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Milliseconds from the request for the page until the frame that shows the links.
fn first_paint(browser: &mut Browser) -> f64 {
    let seen = browser.value("performance.getEntriesByName('links-in-sight')[0]?.startTime ?? -1");
    seen.as_f64().unwrap_or(f64::NAN)
}

fn metrics(browser: &mut Browser) -> Value {
    browser.call("Performance.getMetrics", json!({}))
}

fn value(metrics: &Value, name: &str) -> f64 {
    let mut all = metrics["metrics"].as_array().into_iter().flatten();
    all.find(|metric| metric["name"] == name)
        .and_then(|metric| metric["value"].as_f64())
        .unwrap_or(f64::NAN)
}
