//! Names, roles and contrast of every view, as axe-core judges them.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::bench::{Bench, blocks};
use crate::page::browser::Browser;

/// Where the page's pinned tools are, as .ci/run puts them.
const AXE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../target/tools/page/node_modules/axe-core/axe.min.js"
);

const VIEWS: [&str; 14] = [
    "links?view=cards",
    "links?view=table",
    "links?show=trouble",
    "wall",
    "link/lathe-1",
    "link/press-3",
    "buses",
    "cells",
    "jobs",
    "programs",
    "program/O1.nc",
    "compare/lathe-1%2FO1",
    "plugins",
    "journal",
];

pub(super) fn axe() -> String {
    assert!(
        Path::new(AXE).exists(),
        "axe-core is not there: `npm ci` in target/tools/page, with the package.json of runner/service/tests/page"
    );
    std::fs::read_to_string(AXE).unwrap()
}

/// What is wrong with what is seen, in a line each.
pub(super) fn violations(browser: &mut Browser) -> Vec<String> {
    let found = browser.value(
        "axe.run(document, { resultTypes: ['violations'] }).then(({ violations }) => violations\
         .flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) => `${id}: ${target.join(' ')}: ${failureSummary}`)))",
    );
    let texts = found.as_array().unwrap().iter();
    texts.filter_map(Value::as_str).map(ToOwned::to_owned).collect()
}

#[test]
fn no_view_has_a_fault_that_axe_finds() {
    let axe = axe();
    let bench = Bench::with_bus_and_cell();
    let long = blocks(5_000);
    bench.upload("O1.nc", long.as_bytes()).with(201);
    let folder = bench.path("state/receptions/lathe-1");
    std::fs::create_dir_all(&folder).unwrap();
    let received = long.replace("N7 G01 X7\n", "N7 G01 X8\n").replace("N9 ", "n9  ");
    std::fs::write(folder.join("O1"), received).unwrap();
    bench.until_link("lathe-1", "idle");
    bench.until_link("press-3", "idle");
    bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201);
    bench.post("/links/press-3/quarantine", &json!({})).with(200);
    let aborted = bench.post("/links/lathe-2/jobs", &json!({ "program": "O1.nc" })).with(201);
    bench.post(&format!("/jobs/{}/abort", aborted.json()["id"]), &json!({})).with(200);

    let mut browser = Browser::open();
    browser.size(1280, 900);
    browser.go(&bench.url("/"));
    browser.until("document.activeElement?.name === 'token'");
    browser.value(&axe);
    assert_eq!(violations(&mut browser), Vec::<String>::new(), "signing in");
    browser.type_text(&bench.admin);
    browser.press("Enter");
    browser.until("document.querySelector('.card')");
    let mut found = Vec::new();
    for (width, height) in [(1280, 900), (390, 844)] {
        browser.size(width, height);
        for scheme in ["light", "dark"] {
            browser.prefer(scheme);
            for view in VIEWS {
                browser.value(&format!("location.hash = '#/{view}'"));
                browser.until("document.querySelector('main h1')");
                browser.value("new Promise((go) => setTimeout(go, 500))");
                if view == "links?view=table" {
                    browser.value("document.querySelector('.dense [aria-label^=Choose]').click()");
                    browser.pick("bulk-program", "O1.nc");
                }
                let here = violations(&mut browser);
                found.extend(here.iter().map(|text| format!("{view}, {scheme}, {width}: {text}")));
                assert!(browser.overhang() <= 0, "{view} is wider than {width}");
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
