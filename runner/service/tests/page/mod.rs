//! The web page in a real browser.
#![cfg(target_os = "linux")]

mod browser;
mod machine;
mod picture;

mod needs_chromium {
    mod access;
    mod check;
    mod gcode;
    mod lathe;
    mod many;
    mod program;
    mod shift;
    mod shop;
    mod truth;

    use std::fmt::Write as _;
    use std::fs;

    use serde_json::Value;

    use crate::common::bench::Bench;
    use crate::page::browser::Browser;
    use crate::page::picture::Picture;

    /// A program that takes a simulated machine minutes.
    fn long_program() -> Vec<u8> {
        let blocks = (1..=5_000).fold(String::new(), |mut text, n| {
            let _ = writeln!(text, "N{n} G01 X{n} Y-{n}");
            text
        });
        blocks.into_bytes()
    }

    /// Signs in by mouse.
    fn sign_in(browser: &mut Browser, bench: &Bench, token: &str) {
        browser.go(&bench.url("/"));
        browser.until("document.activeElement?.name === 'token'");
        browser.type_text(token);
        browser.click("button", "Sign in");
        browser.until("document.querySelectorAll('.card').length === 3");
    }

    #[test]
    fn upload_send_watch_swap_and_abort_by_mouse() {
        let bench = Bench::new();
        bench.add_plugin_of_version("9.9.9");
        let mut browser = Browser::open();
        browser.size(1280, 900);
        sign_in(&mut browser, &bench, &bench.admin);
        browser.sees("live, admin");

        browser.click("nav a", "Programs");
        let file = bench.path("long.nc");
        fs::write(&file, long_program()).unwrap();
        browser.choose("file", &[file]);
        browser.click("button", "Upload");
        browser.sees("Uploaded long.nc");
        assert_eq!(bench.get("/programs/long.nc").with(200).body, long_program());

        browser.click("nav a", "Links");
        browser.click(".card a", "lathe-1");
        browser.click("button", "Watch the line");
        browser.sees("watching");
        browser.until("document.querySelector('select[name=program]').value === 'long.nc'");
        browser.click("form button", "Send");
        browser.sees("sending");
        browser.until("[...document.querySelectorAll('.sequence .out')].some((row) => row.innerText.includes('G01'))");
        browser.until("document.querySelector('.history .line').getAttribute('d').length > 20");

        browser.click("button", "Swap to xon-xoff 9.9.9");
        browser.sees("Runs xon-xoff 9.9.9");
        let link = bench.get("/links/lathe-1").with(200).json();
        assert_eq!(link["plugin"]["version"], "9.9.9");
        assert_eq!(link["job"]["program"], "long.nc", "the job goes on: {link:#}");

        browser.click("button", "Pause");
        browser.sees("paused");
        browser.click("button", "Resume");
        browser.click("button", "Abort");
        browser.click("button", "Abort: sure?");
        browser.sees("aborted");
        bench.until("/jobs?link=lathe-1", |jobs| jobs[0]["state"] == "aborted");
        bench.until_link("lathe-1", "idle");

        browser.click("button", "Stop the plug-in");
        browser.click("button", "Stop the plug-in: sure?");
        browser.sees("stopped by hand");
        bench.until_link("lathe-1", "quarantined");
        browser.click("button", "Release");
        bench.until_link("lathe-1", "idle");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn all_of_it_by_keyboard() {
        let bench = Bench::new();
        bench.upload("long.nc", &long_program()).with(201);
        let mut browser = Browser::open();
        browser.size(1280, 900);
        browser.go(&bench.url("/"));
        browser.until("document.activeElement?.name === 'token'");
        browser.type_text(&bench.operator);
        browser.press("Enter");
        browser.until("document.querySelectorAll('.card').length === 3");
        browser.tab_to("lathe-1");
        browser.press("Enter");
        browser.until("document.querySelector('select[name=program]')?.value === 'long.nc'");
        browser.tab_to("Send");
        browser.press("Enter");
        browser.sees("sending");
        bench.until("/jobs", |jobs| jobs[0]["state"] == "running");
        browser.value("document.querySelector('.skip').focus()");
        browser.tab_to("Abort");
        browser.press("Enter");
        browser.until("document.activeElement?.innerText === 'Abort: sure?'");
        browser.press("Space");
        bench.until("/jobs", |jobs| jobs[0]["state"] == "aborted");
        // What has the focus can be seen.
        browser.press("Tab");
        let outline = browser.value("getComputedStyle(document.activeElement).outlineStyle");
        assert_eq!(outline, "solid");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn every_page_fits_a_phone_in_light_and_dark() {
        let bench = Bench::new();
        let name = "a-folder/a-program-with-a-name-that-is-rather-long-for-a-phone.nc";
        bench.upload(&name.replace('/', "%2F"), b"G0 X1\n").with(201);
        bench.until_link("lathe-1", "idle");
        bench.post("/links/lathe-1/jobs", &serde_json::json!({ "program": name })).with(201);
        let mut browser = Browser::open();
        browser.size(360, 740);
        sign_in(&mut browser, &bench, &bench.admin);
        for scheme in ["light", "dark"] {
            browser.prefer(scheme);
            for page in [
                "links",
                "link/lathe-1",
                "buses",
                "cells",
                "jobs",
                "programs",
                "plugins",
                "journal",
            ] {
                browser.value(&format!("location.hash = '#/{page}'"));
                browser.until("document.querySelector('main h1')");
                browser.value("new Promise((go) => setTimeout(go, 300))");
                assert!(browser.overhang() <= 0, "{page} is wider than a phone");
                let small = browser.value(
                    "[...document.querySelectorAll('button, nav a, select, input')] \
                     .filter((of) => of.checkVisibility() && of.getBoundingClientRect().height < 22) \
                     .map((of) => of.outerHTML)",
                );
                assert_eq!(small, Value::Array(Vec::new()), "too small for a thumb");
                let picture = Picture::read(&browser.screenshot());
                assert_eq!((picture.width, picture.height), (360, 740));
                assert!(picture.colours() > 10, "{page} shows nothing");
                let is_dark = picture.brightness() < 100;
                assert_eq!(is_dark, scheme == "dark", "{page}: {}", picture.brightness());
            }
        }
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn a_bus_is_shown_with_what_is_planned_and_its_units() {
        let bench = Bench::with_bus();
        let mut browser = Browser::open();
        browser.size(1280, 900);
        sign_in(&mut browser, &bench, &bench.operator);
        browser.click("nav a", "Buses");
        browser.until("document.querySelector('main h2')?.textContent === 'hall'");
        for text in ["100,000 bit/s are data", "40.0 %", "2.0 ms", "A empty · B empty"] {
            browser.sees(text);
        }
        browser.until("document.querySelectorAll('td.level progress').length === 3");
        browser.click("td a", "mill-2");
        browser.until("document.querySelector('main h1')?.textContent.includes('mill-2')");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn a_cell_is_shown_with_who_waits_and_can_be_helped() {
        let bench = Bench::with_cell();
        let cut = "G1 X10 Z-20 F200\n".repeat(60);
        bench.upload(
            "loader.nc",
            format!("(SOFTPLUG GET GANTRY)\n{cut}(SOFTPLUG WAIT 1 lathe-1)\n").as_bytes(),
        );
        bench.upload(
            "one.nc",
            format!("{cut}(SOFTPLUG GET GANTRY)\n(SOFTPLUG WAIT 1 loader)\n").as_bytes(),
        );
        bench.upload("two.nc", cut.as_bytes());
        for link in ["loader", "lathe-1", "lathe-2"] {
            bench.until_link(link, "idle");
        }
        let mut browser = Browser::open();
        browser.size(1280, 900);
        sign_in(&mut browser, &bench, &bench.operator);
        for (link, program) in
            [("lathe-2", "two.nc"), ("loader", "loader.nc"), ("lathe-1", "one.nc")]
        {
            let order = serde_json::json!({ "program": program });
            bench.post(&format!("/links/{link}/jobs"), &order).with(201);
        }
        browser.click("nav a", "Cells");
        browser.until("document.querySelector('main h2')?.textContent === 'shafts'");
        browser.sees("runs two.nc");
        // The loader has what the lathe wants, and waits for it.
        browser.sees("Deadlock: lathe-1 waits for GANTRY, which loader has: release GANTRY");
        browser.sees("waits at mark 1 for lathe-1");
        browser.until("document.querySelectorAll('svg.spans rect.runs').length >= 3");
        browser.until("document.querySelectorAll('svg.spans rect.waits').length >= 2");
        if let Some(folder) = std::env::var_os("SOFTPLUG_PICTURES") {
            std::fs::write(std::path::Path::new(&folder).join("cell.png"), browser.screenshot())
                .unwrap();
        }
        browser.click("button", "Release");
        browser.click("button", "Release: sure?");
        browser.until("!document.querySelector('ul.stuck li')");
        bench.until("/cells/shafts", |cell| {
            cell["channels"].as_array().unwrap().iter().all(|channel| channel["state"] == "idle")
        });
        browser.sees("no program");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn texts_from_outside_are_only_texts() {
        let bench = Bench::new();
        bench.until_link("press-3", "idle");
        let marked =
            "<img src=x onerror=document.title='owned'><script>document.title='owned'</script>";
        let path =
            format!("/links/press-3/feed?program={}", "%3Cimg%20src=x%20onerror=alert(1)%3E");
        let kind = "application/octet-stream";
        let fed = bench.ask_as("POST", &path, &bench.operator, kind, marked.as_bytes());
        assert!([201, 422].contains(&fed.status), "{fed:?}");
        let mut browser = Browser::open();
        browser.size(1280, 900);
        sign_in(&mut browser, &bench, &bench.operator);
        for page in ["link/lathe-1", "jobs", "journal", "link/%3Cimg%20src=x%20onerror=alert(1)%3E"]
        {
            browser.value(&format!("location.hash = '#/{page}'"));
            browser.until("document.querySelector('main h1')");
            browser.value("new Promise((go) => setTimeout(go, 300))");
            assert_eq!(browser.value("document.querySelectorAll('main img').length"), 0);
            assert_ne!(browser.value("document.title"), "owned");
        }
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn a_token_that_is_not_known_is_said_so() {
        let bench = Bench::new();
        let mut browser = Browser::open();
        browser.go(&bench.url("/"));
        browser.until("document.activeElement?.name === 'token'");
        browser.type_text("softplug_wrong");
        browser.press("Enter");
        browser.sees("this token is not known");
        assert_eq!(browser.value("document.querySelectorAll('.card').length"), 0);
    }
}
