//! What would arrive of a program is told before it is sent.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use softplug_service::library::Library;

use super::access::{axe, violations};
use crate::common::bench::{Bench, plugins};
use crate::page::browser::Browser;

/// Umlauts, a tab and small letters.
const ODD: &str = "%\nO7 (Gr\u{f6}\u{df}e)\nG0\tX1\nM30\n%\n";

/// A lathe that takes 8 bits, and a mill that reads ISO code.
fn bench() -> Bench {
    let link = |name: &str, plugin: &str, line: &str| {
        format!(
            "[[link]]\nname = \"{name}\"\nport = \"simulate:{plugin}\"\nplugin = \"{plugin}\"\nline = \"{line}\"\n"
        )
    };
    let links =
        link("lathe-1", "xon-xoff", "9600 8N1") + &link("mill-2", "fanuc-rs232", "4800 7E2");
    let bench = Bench::with_links_and(&links, |folder: &Path| {
        let library = Library::open(&folder.join("plugins")).unwrap();
        library.add(&fs::read(plugins().join("fanuc-rs232.wasm")).unwrap()).unwrap();
    });
    bench.upload("odd.nc", ODD.as_bytes()).with(201);
    bench.upload("plain.nc", b"%\nO1\nG0 X1\nM30\n%\n").with(201);
    bench.until_link("lathe-1", "idle");
    bench.until_link("mill-2", "idle");
    bench
}

fn open(bench: &Bench, token: &str, page: &str) -> Browser {
    let mut browser = Browser::open();
    browser.size(1280, 900);
    browser.go(&bench.url(&format!("/#/{page}")));
    browser.until("document.activeElement?.name === 'token'");
    browser.type_text(token);
    browser.press("Enter");
    browser.until("document.querySelector('nav a[aria-current]')");
    browser
}

fn keep(browser: &mut Browser, name: &str) {
    if let Some(folder) = std::env::var_os("SOFTPLUG_PICTURES") {
        fs::write(Path::new(&folder).join(name), browser.screenshot()).unwrap();
    }
}

/// Cells of the rows of the table of characters.
const ROWS: &str = "[...document.querySelectorAll('[aria-label^=\"Table of characters\"] tbody tr')]\
    .map((row) => [...row.children].map((cell) => cell.textContent))";

/// What is read aloud of it.
const SAID: &str = "document.querySelector('.checked[role=status]').textContent";

#[test]
fn what_arrives_is_told_on_the_page_of_the_program_as_soon_as_a_link_is_chosen() {
    let bench = bench();
    let mut browser = open(&bench, &bench.operator, "program/odd.nc");
    browser.sees("choose the link above");
    // By the keys alone.
    browser.tab_to("Link to send to");
    browser.press("ArrowDown");
    browser.sees("What arrives at lathe-1");
    browser.sees("2 of its 18 different characters do not arrive as written");
    assert_eq!(
        browser.value(ROWS),
        json!([
            ["\u{f6}", "1", "line 2, column 7", "sent as c3b6, which few controls know", "OE"],
            ["\u{df}", "1", "line 2, column 8", "sent as c39f, which few controls know", "SS"],
        ])
    );
    assert!(!browser.shows("h2", "Signs that not every control takes"));
    keep(&mut browser, "program-check.png");
    // The place leads to the text.
    browser.click("button.link", "line 2, column 7");
    browser.until("document.querySelector('.listing .chosen .number')?.textContent === '2'");
    browser.value("document.querySelector('select[aria-label=\"Link to send to\"]').focus()");
    browser.press("ArrowDown");
    browser.sees("mill-2 refuses it with fanuc-rs232");
    let said = browser.value(SAID);
    let why =
        "odd.nc, line 2, column 7 cannot be sent: a character that cannot be sent on this link.";
    assert!(said.as_str().unwrap().ends_with(why), "{said}");
    let rows = browser.value(ROWS);
    assert_eq!(rows[0], json!(["r", "1", "line 2, column 6", "sent as R", "a capital"]));

    // On a phone, light and dark, as axe judges it.
    browser.value(&axe());
    let mut found = Vec::new();
    for (width, height) in [(1280, 900), (390, 844)] {
        browser.size(width, height);
        for scheme in ["light", "dark"] {
            browser.prefer(scheme);
            found.extend(violations(&mut browser));
            assert!(browser.overhang() <= 0, "wider than {width}");
        }
    }
    assert_eq!(found, Vec::<String>::new());
    // Nothing was sent by looking.
    assert_eq!(bench.get("/jobs").with(200).json(), json!([]));
    browser.value("location.hash = '#/program/plain.nc'");
    browser.sees("5 lines");
    browser.value(
        "(() => { const select = document.querySelector('select[aria-label=\"Link to send to\"]'); \
         select.value = 'mill-2'; select.dispatchEvent(new Event('change')); })()",
    );
    browser.sees("plain.nc passes as it is written to mill-2, with fanuc-rs232");
    browser.until(
        "!document.querySelector('[aria-label^=\"Table of characters\"]').checkVisibility()",
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_program_that_changes_is_tried_anew() {
    let bench = bench();
    let mut browser = open(&bench, &bench.operator, "link/mill-2");
    browser.pick("program", "odd.nc");
    browser.sees("mill-2 refuses it");
    let path = "/programs/odd.nc?overwrite=true";
    let plain = b"%\nO7\nM30\n%\n";
    bench.ask_as("PUT", path, &bench.operator, "application/octet-stream", plain).with(201);
    browser.sees("odd.nc passes as it is written to mill-2");
    browser.value(&axe());
    browser.size(390, 844);
    assert_eq!(violations(&mut browser), Vec::<String>::new());
    assert!(browser.overhang() <= 0);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_viewer_may_look_at_what_would_arrive() {
    let bench = bench();
    let mut browser = open(&bench, &bench.viewer, "program/odd.nc");
    browser.until("document.querySelectorAll('select[aria-label=\"Link that it would be sent to\"] option').length === 3");
    browser.value(
        "(() => { const select = document.querySelector('select[aria-label=\"Link that it would be sent to\"]'); \
         select.value = 'lathe-1'; select.dispatchEvent(new Event('change')); })()",
    );
    browser.sees("do not arrive as written");
    assert!(!browser.shows("button", "Send to lathe-1"));
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn the_worst_is_told_before_a_program_goes_to_many_links() {
    let bench = bench();
    let mut browser = open(&bench, &bench.operator, "links?view=table");
    browser.until("document.querySelectorAll('.dense .row').length === 2");
    browser.click("[aria-label^='Choose all']", "");
    browser.pick("bulk-program", "plain.nc");
    browser.sees("It passes as it is written to all 2 links.");
    browser.sees("begins at once; passes as it is written");
    browser.pick("bulk-program", "odd.nc");
    browser.sees("At worst it is refused by 1 of 2 links: mill-2.");
    let rows = "[...document.querySelectorAll('.fate tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))";
    let rows = browser.value(rows);
    let what = |row: usize| rows[row][1].as_str().unwrap();
    assert_eq!((&rows[0][2], &rows[1][2]), (&json!("mill-2"), &json!("lathe-1")));
    assert!(what(0).starts_with("begins at once; refused: odd.nc, line 2, column 7"), "{rows}");
    assert!(
        what(1).starts_with("begins at once; 2 characters not as written: \u{f6} sent as"),
        "{rows}"
    );
    browser.value(&axe());
    for width in [1280, 390] {
        browser.size(width, 844);
        assert_eq!(violations(&mut browser), Vec::<String>::new(), "{width}");
        assert!(browser.overhang() <= 0, "{width}");
    }
    // It is still up to the operator.
    browser.click("button", "Send odd.nc to 2 links");
    browser.sees("2 of 2 links ordered");
    let jobs = bench.get("/jobs").with(200).json();
    assert_eq!(jobs.as_array().map(Vec::len), Some(2), "{jobs:#}");
    assert!(jobs.as_array().unwrap().iter().all(|job: &Value| job["program"] == "odd.nc"));
    assert_eq!(browser.complaints, Vec::<String>::new());
}
