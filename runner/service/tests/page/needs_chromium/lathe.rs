//! What a simulated lathe cuts can be watched.

use serde_json::json;

use crate::common::bench::Bench;
use crate::page::browser::Browser;

/// A ring: a spindle, a way to the work, a cylinder and a quarter of a circle.
const RING: &[u8] = b"G91 S20 T1 M3\nG00 X-12 Z-5\nG01 X-4 Z-20 F900\nG02 X20 Z-10 I10 F900\nM30\n";

#[test]
fn what_a_simulated_lathe_cuts_is_drawn_while_it_works() {
    let bench = Bench::with_lathe();
    bench.until_link("lathe-1", "idle");
    bench.upload("ring.nc", RING).with(201);
    let mut browser = Browser::open();
    browser.size(1280, 1000);
    browser.go(&bench.url("/"));
    browser.until("document.activeElement?.name === 'token'");
    browser.type_text(&bench.operator);
    browser.press("Enter");
    browser.until("document.querySelectorAll('.card').length === 1");
    browser.click(".card a", "lathe-1");
    browser.until("document.querySelector('.part svg #part')");
    let places =
        "document.querySelector('.part svg #way').getAttribute('points').split(' ').length";
    let before = browser.value(places).as_u64().unwrap();
    bench.post("/links/lathe-1/jobs", &json!({ "program": "ring.nc" })).with(201);
    browser.until(&format!("{places} > {}", before + 5));
    bench.until("/links/lathe-1/lathe", |lathe| lathe["programs"] == 1);
    // Of the taper 4 mm of diameter, of the arc 20, of the way to the work 12.
    browser.sees("x 2.000 mm, z -35.00 mm from where they began");
    let cut = browser.value("document.querySelector('.part svg #part').getAttribute('d').length");
    assert!(cut.as_u64().unwrap() > 400, "nothing was cut");
    if let Some(folder) = std::env::var_os("SOFTPLUG_PICTURES") {
        let file = std::path::Path::new(&folder).join("lathe.png");
        std::fs::write(file, browser.screenshot()).unwrap();
    }
    assert_eq!(bench.get("/links/press-3/lathe").status, 404);
    assert_eq!(browser.complaints, Vec::<String>::new());
}
