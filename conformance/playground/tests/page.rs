//! The page in a real browser, with every reference plug-in.

#[path = "../../../runner/service/tests/page/browser.rs"]
#[allow(dead_code, reason = "the gateway's page needs more of it")]
mod browser;

mod needs_chromium {
    use super::browser::Browser;
    use crate::common::endless;
    use serde_json::{Value, json};
    use std::path::{Path, PathBuf};

    /// The page with everything in it.
    fn page() -> PathBuf {
        let built = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/playground.html");
        let page = std::env::var_os("SOFTPLUG_PLAYGROUND").map_or(built, PathBuf::from);
        assert!(page.is_file(), "{}: build it with `cargo xtask playground`", page.display());
        page.canonicalize().unwrap()
    }

    fn open(width: u32, height: u32) -> Browser {
        let mut browser = Browser::open();
        browser.size(width, height);
        browser.go(&format!("file://{}", page().display()));
        passes(&mut browser);
        browser
    }

    fn passes(browser: &mut Browser) {
        browser.until("document.getElementById('verdict')?.className === 'good'");
    }

    fn fails(browser: &mut Browser) {
        browser.until("document.getElementById('verdict')?.className === 'bad'");
    }

    /// Chooses in a list, as a person would.
    fn choose(browser: &mut Browser, list: &str, value: &str) {
        set(browser, list, value, "change");
        assert_eq!(browser.value(&format!("document.getElementById('{list}').value")), value);
    }

    fn set(browser: &mut Browser, id: &str, value: &str, event: &str) {
        let (id, value) = (Value::from(id), Value::from(value));
        browser.value(&format!(
            "(() => {{ const of = document.getElementById({id}); of.value = {value}; \
             of.dispatchEvent(new Event('{event}', {{ bubbles: true }})); }})()"
        ));
    }

    fn text(browser: &mut Browser, id: &str) -> String {
        let text = browser.value(&format!("document.getElementById('{id}').innerText"));
        text.as_str().unwrap().to_owned()
    }

    fn trace(browser: &mut Browser) -> String {
        browser.value("document.getElementById('trace').value").as_str().unwrap().to_owned()
    }

    #[test]
    fn every_reference_plug_in_runs_and_is_walked_through() {
        let mut browser = open(1_280, 900);
        for name in softplug_native::NativePlugin::ALL.iter().map(|plugin| plugin.name()) {
            choose(&mut browser, "plugin", name);
            browser.until(&format!(
                "document.getElementById('about').textContent.startsWith('{name} ')"
            ));
            passes(&mut browser);
            browser.click("button", "▶|");
            browser.until("document.getElementById('forward').disabled");
            let steps = text(&mut browser, "count");
            let (at, of) = steps.trim_start_matches("step ").split_once(" of ").unwrap();
            assert_eq!(at, of, "{name}");
            let count: usize = of.parse().unwrap();
            assert!(count > 3, "{name}: {steps}");
            for _ in 0..3 {
                browser.click("button", "◀");
            }
            browser.until(&format!(
                "document.getElementById('count').textContent === 'step {} of {count}'",
                count - 3
            ));
            assert!(browser.value("document.querySelectorAll('svg g.moment').length") != 0);
            assert!(text(&mut browser, "standing").contains("in all"), "{name}");
        }
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn an_edited_trace_shows_its_first_difference_and_faults_have_their_place() {
        let mut browser = open(1_280, 900);
        choose(&mut browser, "case", "xon-xoff.tx.hold");
        passes(&mut browser);
        let right = trace(&mut browser);
        let wrong = right.replacen("> 2.000000 43 44", "> 2.000000 43 45", 1);
        assert_ne!(wrong, right);
        set(&mut browser, "trace", &wrong, "input");
        fails(&mut browser);
        let verdict = text(&mut browser, "verdict");
        assert!(verdict.contains("does not do what the trace demands"), "{verdict}");
        assert!(verdict.contains("45") && verdict.contains("44"), "{verdict}");
        assert_eq!(browser.value("document.querySelectorAll('g.differs').length"), 1);

        set(&mut browser, "trace", &right.replacen("? 0.0", "? x.0", 1), "input");
        browser.sees("Not run");
        let fault = text(&mut browser, "fault");
        let line = 1 + right.lines().position(|line| line.starts_with("? 0.0")).unwrap();
        assert!(fault.starts_with(&format!("line {line}, column 3: ")), "{fault}");
        set(&mut browser, "trace", &right, "input");
        passes(&mut browser);
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn time_goes_on_by_hand_and_by_itself() {
        let mut browser = open(1_280, 900);
        choose(&mut browser, "case", "xon-xoff.tx.hold");
        browser.until("document.getElementById('verdict').innerText.includes('5.000000')");
        let time = "document.getElementById('time').value";
        browser.until(&format!("{time} === '0.000000'"));
        browser.click("button", "+1 s");
        browser.until(&format!("{time} === '1.000000'"));
        // XOFF has come: the queue is held.
        assert!(text(&mut browser, "standing").contains("held"));
        browser.click("button", "+1 s");
        browser.until(&format!("{time} === '2.000000'"));
        assert!(text(&mut browser, "standing").contains("free"));
        set(&mut browser, "time", "1.5", "change");
        assert!(text(&mut browser, "standing").contains("held"));

        // Another XOFF right behind XON: the queue is held once more.
        set(&mut browser, "more", "< 2.000100 13", "input");
        browser.click("button", "Put in");
        fails(&mut browser);
        assert!(trace(&mut browser).contains("\n< 2.000100 13\n"));

        choose(&mut browser, "case", "xon-xoff.tx.hold");
        passes(&mut browser);
        choose(&mut browser, "speed", "10");
        browser.click("button", "Play");
        browser.until("document.getElementById('forward').disabled");
        browser.until("document.getElementById('play').textContent === 'Play'");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn noise_is_injected_and_can_be_kept() {
        let mut browser = open(1_280, 900);
        choose(&mut browser, "case", "xon-xoff.tx.hold");
        browser.until("document.getElementById('verdict').innerText.includes('5.000000')");
        browser.click("summary", "Noise on the line");
        set(&mut browser, "lose", "1000", "input");
        browser.sees("2 characters damaged");
        fails(&mut browser);
        browser.click("button", "Put the damage into the trace");
        browser.until("document.getElementById('trace').value.includes('# lost: < 0.001500')");
        assert_eq!(browser.value("document.getElementById('lose').value"), "0");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn a_hostile_module_neither_hangs_the_page_nor_puts_anything_in_it() {
        let mut browser = open(1_280, 900);
        let folder = tempfile::tempdir().unwrap();
        let files = [
            ("endless.wasm", endless(), "budget"),
            ("<img src=x onerror=alert(1)>.wasm", b"\0asm junk".to_vec(), "<img src=x"),
        ];
        for (name, module, seen) in files {
            let file = folder.path().join(name);
            std::fs::write(&file, module).unwrap();
            browser.choose("file", &[file]);
            browser.sees(seen);
        }
        assert_eq!(browser.value("document.querySelectorAll('img').length"), 0);
        choose(&mut browser, "plugin", "xon-xoff");
        passes(&mut browser);
        assert_eq!(browser.complaints, Vec::<String>::new());
    }

    #[test]
    fn it_fits_a_phone_in_light_and_dark_and_needs_no_mouse() {
        let mut browser = open(390, 844);
        let mut seen = Vec::new();
        for scheme in ["light", "dark"] {
            browser.prefer(scheme);
            assert_eq!(browser.overhang(), 0, "{scheme}");
            seen.push(browser.value("getComputedStyle(document.body).backgroundColor"));
            assert!(browser.screenshot().len() > 10_000, "{scheme} is blank");
        }
        assert_ne!(seen[0], seen[1]);
        browser.tab_to("Play");
        choose(&mut browser, "speed", "0.001");
        browser.press("Enter");
        browser.until("document.getElementById('play').getAttribute('aria-pressed') === 'true'");
        browser.press("Enter");
        browser.until("document.getElementById('play').getAttribute('aria-pressed') === 'false'");
        browser.value("document.getElementById('picture').focus()");
        let end = json!({ "type": "keyDown", "key": "End", "code": "End" });
        browser.call("Input.dispatchKeyEvent", end);
        browser.until("document.getElementById('forward').disabled");
        assert_eq!(browser.complaints, Vec::<String>::new());
    }
}
