//! What the page does for hundreds of links: counted, not timed.

use serde_json::{Value, json};

use super::shop::Shop;
use crate::common::bench::blocks;

/// Counts, for each row that is changed, whether it was near the window.
const OBSERVE: &str = "(() => { window.touched = new Set(); window.far = 0; \
    new MutationObserver((changes) => { for (const { target } of changes) { \
        const row = (target.nodeType === 1 ? target : target.parentElement)?.closest('.dense .row'); \
        if (!row) continue; \
        const { top, bottom } = row.getBoundingClientRect(); \
        window.touched.add(row); \
        if (bottom < -400 || top > innerHeight + 400) window.far += 1; \
    } }).observe(document.querySelector('.dense'), \
        { subtree: true, childList: true, characterData: true, attributes: true }); })()";

/// Requests so far, but for streams that go on.
const REQUESTS: &str = "performance.getEntriesByType('resource').length";

#[test]
fn only_what_is_in_sight_is_brought_up_to_date_and_nothing_is_asked_for() {
    let mut shop = Shop::open();
    let program = blocks(3_000);
    shop.bench.upload("O1.nc", program.as_bytes()).with(201);
    for number in (4..=200).step_by(2) {
        let order = json!({ "program": "O1.nc" });
        shop.bench.post(&format!("/links/mill-{number:03}/jobs"), &order).with(201);
    }
    let token = shop.bench.viewer.clone();
    shop.sign_in(&token, (1280, 900));
    // All is there, and the first of what is told has come.
    shop.browser.until("document.querySelectorAll('.dense .row .rest:not(:empty)').length >= 5");
    let before = shop.browser.value(REQUESTS);
    shop.browser.value(OBSERVE);
    shop.browser.until("window.touched.size >= 5");
    let first = shop.browser.value("window.touched.size").as_u64().unwrap();
    shop.browser.value("window.touched.clear()");
    shop.browser.until(&format!("window.touched.size >= {}", first.min(5)));
    assert_eq!(shop.browser.value("window.far"), Value::from(0), "rows that nobody sees");
    assert!(shop.browser.value("window.touched.size").as_u64().unwrap() < 40);
    assert_eq!(shop.browser.value(REQUESTS), before, "what is told is not asked for again");
    // What comes into sight is as it is now.
    shop.browser.value("document.querySelector('.dense .row:nth-last-child(2)').scrollIntoView()");
    shop.browser.until(
        "document.querySelector('.dense .row:nth-last-child(2) .badge').textContent === '▶sending'",
    );
    assert_eq!(shop.browser.complaints, Vec::<String>::new());
}
