//! A shift of three people in a shop of two hundred links: each step from the start page, with at
//! most three clicks, on a phone and at a desk.

use std::fmt::Write as _;

use serde_json::json;

use super::access::{axe, violations};
use super::shop::{LINKS, Shop};
use crate::gateway::plugins::fragile;

const PHONE: (u32, u32) = (390, 844);
const DESK: (u32, u32) = (1280, 900);
const SCREEN: (u32, u32) = (1920, 1080);

fn program(name: &str, blocks: u32) -> String {
    let mut text = format!("%\n{name}\n");
    for n in 1..=blocks {
        let feed = if n == 1 { " F2000" } else { "" };
        let _ = writeln!(text, "N{n} G01 X{n} Y-{n}{feed}");
    }
    text + "M30\n%\n"
}

#[test]
fn a_shift_of_three_people_takes_three_clicks_a_step() {
    let mut shop = Shop::open();
    let long = program("O1234", 5_000);
    shop.bench.upload("O1234.nc", long.as_bytes()).with(201);
    shop.bench.upload("O77.nc", program("O77", 40).as_bytes()).with(201);
    shop.bench.until_link("lathe-001", "idle");
    shop.bench.until_link("press-002", "idle");

    let (operator, admin, viewer) =
        (shop.bench.operator.clone(), shop.bench.admin.clone(), shop.bench.viewer.clone());
    shop.sign_in(&operator, PHONE);
    send_and_watch(&mut shop);
    hold_and_pause(&mut shop);
    abort_and_restart(&mut shop);
    compare(&mut shop);
    shop.sign_in(&admin, DESK);
    swap_and_send_to_many(&mut shop);
    quarantine_and_release(&mut shop);
    look_back(&mut shop);
    // The shop at work.
    for number in 60..=100 {
        let order = json!({ "program": "O1234.nc" });
        shop.bench.post(&format!("/links/mill-{number:03}/jobs"), &order).with(201);
    }
    shop.bench.post("/links/mill-077/quarantine", &json!({})).with(200);
    shop.sign_in(&viewer, SCREEN);
    watch_the_wall(&mut shop);
    assert_eq!(shop.browser.complaints, Vec::<String>::new());
}

/// The machinist, on a phone at the machine.
fn send_and_watch(shop: &mut Shop) {
    shop.keep_picture("gateway-links-phone");
    shop.step("finding a link", |shop| {
        shop.find("lathe");
        shop.browser.until("document.querySelectorAll('.dense .row').length === 1");
        // A reload shows the same.
        let hash = shop.browser.value("location.hash");
        assert_eq!(hash, "#/links?find=lathe");
    });
    shop.step("looking at a program", |shop| {
        shop.click("nav a", "Programs");
        shop.click("td a", "O1234.nc");
        shop.browser.sees("5,004 lines");
        shop.browser.sees("Everything in this program was understood.");
    });
    shop.step("checking a program, and sending it", |shop| {
        shop.go_to("lathe-001");
        shop.pick("program", "O1234.nc");
        shop.browser.sees("O1234.nc passes as it is written to lathe-001");
        shop.click("form button", "Send");
        shop.browser.sees("sending");
    });
    shop.lathe.has(3_000);
    shop.step("watching the line", |shop| {
        shop.go_to("lathe-001");
        shop.click("button", "Watch the line");
        shop.browser.until(
            "[...document.querySelectorAll('.sequence .out')].some((row) => row.innerText.includes('G01'))",
        );
        for fact in ["Sent, at most", "Confirmed", "To go", "Rate", "Time to go", "Block"] {
            shop.browser.until(&format!(
                "[...document.querySelectorAll('.numbers dt')].some((of) => of.textContent === '{fact}')"
            ));
        }
        shop.browser.until("/^[\\d,]+: N\\d+ G01/.test(document.querySelector('.numbers .block dd').textContent)");
        shop.browser.value("scrollTo(0, 0)");
        shop.keep_picture("gateway-link-phone");
    });
}

fn hold_and_pause(shop: &mut Shop) {
    shop.lathe.hold();
    shop.bench.until("/links/lathe-001", |link| link["is_held"] == true);
    shop.step("seeing that the machine holds", |shop| {
        shop.find("held");
        shop.browser.until("document.querySelectorAll('.dense .row').length === 1");
        shop.browser.sees("held by the machine");
    });
    let before = shop.lathe.count();
    shop.step("going on although the machine holds", |shop| {
        shop.go_to("lathe-001");
        shop.browser.sees("The machine has said stop");
        assert!(!shop.browser.shows("button", "Resume"), "it is not ours to resume");
        shop.keep_picture("gateway-held");
        shop.click("button", "Override hold");
        shop.click("button", "Override hold: sure?");
        shop.lathe.has(before + 500);
    });
    shop.lathe.release();
    shop.step("pausing", |shop| {
        shop.go_to("lathe-001");
        shop.click("button", "Pause");
        shop.browser.sees("paused by hand");
        assert!(!shop.browser.shows("button", "Override hold"), "the machine holds nothing");
    });
    shop.step("resuming", |shop| {
        shop.go_to("lathe-001");
        shop.click("button", "Resume");
        shop.browser.sees("sending");
    });
}

fn abort_and_restart(shop: &mut Shop) {
    shop.step("aborting", |shop| {
        shop.go_to("lathe-001");
        shop.click("button", "Abort");
        shop.click("button", "Abort: sure?");
        shop.browser.sees("aborted");
    });
    shop.bench.until_link("lathe-001", "idle");
    shop.step("beginning again at a block", |shop| {
        shop.go_to("lathe-001");
        let find = "[...document.querySelectorAll('td button')].find((of) => \
            of.checkVisibility() && /^From block \\d+$/.test(of.textContent))?.textContent";
        shop.browser.until(find);
        let text = shop.browser.value(find);
        shop.click("td button", text.as_str().unwrap());
        shop.browser.sees("it began behind byte");
    });
    let jobs = shop.bench.get("/jobs?link=lathe-001").with(200).json();
    assert!(jobs[0]["start_block"].as_u64().unwrap() > 100, "{jobs:#}");
    assert_eq!(jobs[0]["restart_of"], jobs[1]["id"]);
    // It goes on for minutes.
    for order in ["abort", "acknowledge"] {
        let path = format!("/jobs/{}", jobs[0]["id"]);
        shop.bench.post(&format!("{path}/{order}"), &json!({})).with(200);
        shop.bench.until(&path, |job| job["state"] == "aborted");
    }
    shop.bench.until_link("lathe-001", "idle");
}

/// The machine sends back what it was sent, a little otherwise.
fn compare(shop: &mut Shop) {
    let order = json!({ "program": "O77.nc" });
    let job = shop.bench.post("/links/lathe-001/jobs", &order).with(201).json();
    shop.bench.until(&format!("/jobs/{}", job["id"]), |job| job["state"] == "done");
    let changed = program("O77", 40).replace("N20 G01 X20", "N20 G01 X21");
    shop.lathe.send(changed.as_bytes());
    shop.bench.until("/links/lathe-001/receptions", |all| all[0]["compared"].is_object());
    shop.step("comparing what came with what was sent", |shop| {
        shop.go_to("lathe-001");
        shop.browser.sees("differs from what was sent");
        shop.click("td a", "Compare");
        shop.browser.sees("says something else");
        shop.browser.value(&axe());
        assert_eq!(violations(&mut shop.browser), Vec::<String>::new());
    });
}

/// The one who looks after the plug-ins, at a desk.
fn swap_and_send_to_many(shop: &mut Shop) {
    shop.bench.add_plugin_of_version("9.9.9");
    shop.step("swapping", |shop| {
        shop.go_to("lathe-001");
        shop.click("button", "Swap to xon-xoff 9.9.9");
        shop.browser.sees("Runs xon-xoff 9.9.9");
    });
    shop.browser.value("document.getElementById('message').click()");
    shop.step("sending to many", |shop| {
        shop.find("Hall 3");
        shop.browser.until("document.querySelectorAll('.dense .row').length === 50");
        shop.click("[aria-label^='Choose all']", "");
        shop.pick("bulk-program", "O77.nc");
        shop.browser.sees("It passes as it is written to all 50 links.");
        shop.browser.sees("begins at once; passes as it is written");
        shop.keep_picture("gateway-many");
        shop.click("button", "Send O77.nc to 50 links");
        shop.browser.sees("50 of 50 links ordered");
    });
    let sent = shop.bench.get("/jobs?find=o77&kind=send&limit=1000").with(200).json();
    assert_eq!(sent.as_array().unwrap().len(), 51);
    shop.step("swapping many", |shop| {
        shop.find("Hall 4");
        shop.browser.until("document.querySelectorAll('.dense .row').length === 50");
        shop.click("[aria-label^='Choose all']", "");
        shop.pick("bulk-plugin", "xon-xoff 9.9.9");
        shop.browser.sees("at once");
        shop.click("button", "Swap 50 links to xon-xoff 9.9.9");
        shop.browser.sees("50 of 50 links ordered");
    });
    for number in (51..=100).step_by(3) {
        let order = json!({ "program": "O1234.nc" });
        shop.bench.post(&format!("/links/mill-{number:03}/jobs"), &order).with(201);
    }
    let links = shop.bench.get("/links").with(200).json();
    let swapped = links.as_array().unwrap().iter();
    assert_eq!(swapped.filter(|link| link["plugin"]["version"] == "9.9.9").count(), 51);
    shop.step("the shop at work", |shop| {
        shop.find("Hall 2");
        shop.browser.until("document.querySelectorAll('.dense .row').length === 50");
        shop.click("button", "Program");
        shop.browser.until("document.querySelectorAll('.dense .rest:not(:empty)').length >= 10");
        shop.keep_picture("gateway-links");
    });
}

fn quarantine_and_release(shop: &mut Shop) {
    let kind = "application/wasm";
    let worse = fragile("1.1.0", Some('X'));
    shop.bench.ask_as("POST", "/plugins", &shop.bench.admin, kind, &worse).with(201);
    shop.step("taking a newer version", |shop| {
        shop.go_to("press-002");
        shop.click("button", "Swap to fragile 1.1.0");
        shop.browser.sees("Runs fragile 1.1.0");
    });
    for faults in 1..=5 {
        shop.press.send(b"X");
        shop.bench.until("/links/press-002", |link| {
            link["state"] == "quarantined"
                || (link["counters"]["restarts"] == faults && link["state"] == "idle")
        });
    }
    shop.bench.until_link("press-002", "quarantined");
    shop.step("going back to what ran well", |shop| {
        shop.go_to("press-002");
        shop.browser.sees("5 times");
        assert_eq!(shop.browser.value("document.querySelectorAll('.faults li').length"), 1);
        shop.keep_picture("gateway-quarantine");
        shop.click("button", "Back to fragile 1.0.0");
        shop.browser.sees("Runs fragile 1.0.0");
    });
    shop.bench.until_link("press-002", "idle");
    shop.step("stopping a plug-in", |shop| {
        shop.go_to("press-002");
        shop.click("button", "Stop the plug-in");
        shop.click("button", "Stop the plug-in: sure?");
        shop.browser.sees("Quarantine");
    });
    shop.bench.until_link("press-002", "quarantined");
    shop.step("releasing", |shop| {
        shop.go_to("press-002");
        shop.click("button", "Release");
        shop.browser.until("!document.querySelector('.panel.bad')?.checkVisibility()");
    });
    shop.bench.until_link("press-002", "idle");
}

/// Jobs and journal, as the address asks for them.
fn look_back(shop: &mut Shop) {
    shop.step("finding a job", |shop| {
        shop.click("nav a", "Jobs");
        shop.browser.until("document.querySelectorAll('main tbody tr').length > 50");
        shop.pick("state", "aborted");
        shop.browser.until("document.querySelectorAll('main tbody tr').length === 2");
        assert_eq!(shop.browser.value("location.hash"), "#/jobs?state=aborted");
    });
    shop.step("finding what failed", |shop| {
        shop.click("nav a", "Journal");
        shop.pick("kind", "fault");
        shop.pick("link", "press-002");
        shop.browser.until(
            "document.querySelectorAll('main tbody tr').length > 5 && \
             [...document.querySelectorAll('main tbody tr td:nth-child(3)')].every((of) => of.textContent === 'press-002')",
        );
        shop.keep_picture("gateway-journal");
    });
    // It is there after a reload.
    let page = shop.bench.url("/?again#/journal?kind=swap&link=lathe-001");
    shop.browser.go(&page);
    shop.browser.until("document.querySelector('select[name=kind]')?.value === 'swap'");
    shop.browser.until("document.querySelectorAll('main tbody tr').length === 1");
    shop.browser.value("location.hash = '#/link/lathe-001'");
    shop.browser
        .until("(document.querySelector('.history .line')?.getAttribute('d') ?? '').length > 200");
    shop.keep_picture("gateway-link");
}

/// A screen in the shop.
fn watch_the_wall(shop: &mut Shop) {
    shop.step("the wall", |shop| {
        assert!(!shop.browser.shows("input[type=checkbox]", ""), "a viewer chooses nothing");
        shop.click("a", "Wall");
        shop.browser.until(&format!("document.querySelectorAll('.tiles li').length === {LINKS}"));
        shop.browser.until("document.documentElement.scrollHeight <= innerHeight");
        shop.browser.until("document.querySelectorAll('.tiles .work').length >= 40");
        shop.browser.until("document.querySelectorAll('.tiles .bad').length === 1");
        shop.keep_picture("gateway-wall");
    });
    shop.step("a link, as a viewer", |shop| {
        shop.go_to("lathe-001");
        for name in ["Abort", "Pause", "Send", "Stop the plug-in", "Open the port again"] {
            assert!(!shop.browser.shows("button", name), "{name}");
        }
    });
}

/// From the sign-in to the end of a job without a mouse.
#[test]
fn many_links_by_keyboard() {
    let mut shop = Shop::open();
    shop.bench.upload("O1234.nc", program("O1234", 5_000).as_bytes()).with(201);
    shop.bench.until_link("lathe-001", "idle");
    let browser = &mut shop.browser;
    browser.size(DESK.0, DESK.1);
    browser.go(&shop.bench.url("/"));
    browser.until("document.activeElement?.name === 'token'");
    browser.type_text(&shop.bench.operator);
    browser.press("Enter");
    browser.until("document.querySelectorAll('.dense .row').length === 200");
    browser.tab_to("find");
    browser.type_text("lathe");
    browser.until("document.querySelectorAll('.dense .row').length === 1");
    browser.tab_to("Choose lathe-001");
    browser.press("Space");
    browser.sees("1 link is chosen");
    browser.value("document.querySelector('.skip').focus()");
    browser.tab_to("bulk-program");
    browser.press("ArrowDown");
    browser.tab_to("Send O1234.nc to 1 link");
    browser.press("Enter");
    browser.sees("1 of 1 link ordered");
    browser.tab_to("lathe-001");
    browser.press("Enter");
    browser.tab_to("Abort");
    browser.press("Enter");
    browser.until("document.activeElement?.innerText === 'Abort: sure?'");
    browser.press("Space");
    browser.sees("aborted");
    assert_eq!(browser.complaints, Vec::<String>::new());
}
