//! The HTML page: what stands in it, and that nothing from outside gets out of its
//! place.

mod browser;

use crate::common::{SAMPLES, hostile, sample};
use softplug_report::html;

#[test]
fn every_page_says_its_verdict_first_in_words() {
    for (name, verdict) in SAMPLES {
        let page = html::write(&sample(name));
        let heading = page.split("<h1>").nth(1).unwrap().split("</h1>").next().unwrap();
        let heading = heading.to_lowercase();
        let words = verdict.text().replace(" with", ", with");
        assert!(heading.contains(&words), "{name}: {heading}");
        let is_green =
            page.contains("<header class=\"good\"") || page.contains("<header class=\"warn\"");
        assert_eq!(is_green, verdict.is_conformant(), "{name}");
    }
}

#[test]
fn a_failed_case_says_all_that_is_needed_to_find_it() {
    let page = html::write(&sample("not-conformant"));
    let article = page.split("<article id=\"case-xon-xoff.tx.hold\"").nth(1).unwrap();
    let article = article.split("</article>").next().unwrap();
    for text in [
        "xon-xoff.tx.hold",
        "After XOFF no further byte is given to the port",
        "0.001146",
        "&gt; 2.000000 43 44",
        "&lt; 0.001100 13",
        "softplug certify PLUGIN --profile xon-xoff --case xon-xoff.tx.hold",
        "traces/xon-xoff/xon-xoff.tx.hold.spt:15",
        "xon-xoff.tx.hold/swap:all",
        "And 2 more failed runs.",
        "<svg class=\"sequence\"",
        "▲",
    ] {
        assert!(article.contains(text), "{text}: {article}");
    }
}

#[test]
fn the_command_that_runs_it_again_is_whole() {
    for (name, _) in SAMPLES {
        let report = sample(name);
        let page = html::write(&report);
        assert!(page.contains("softplug verify conformance.json PLUGIN"), "{name}");
        let with_baseline = page.contains("PLUGIN --baseline BASELINE");
        assert_eq!(with_baseline, report.selection.baseline.is_some(), "{name}");
    }
}

#[test]
fn time_goes_downwards() {
    let page = html::write(&sample("not-conformant"));
    let article = page.split("<article id=\"case-xon-xoff.tx.hold\"").nth(1).unwrap();
    let place = |class: &str| article.find(&format!("<g class=\"{class}\"")).unwrap();
    // Expected at 2 s, observed at 1.146 ms.
    assert!(place("observed") < place("expected"));
    assert!(place("before") < place("observed"));
}

#[test]
fn pages_fetch_nothing() {
    for (name, _) in SAMPLES {
        let page = html::write(&sample(name));
        assert!(page.contains("default-src 'none'"));
        for text in ["http:", "https:", "url(", "@import", "<link", "<img", "<iframe", " src="] {
            assert!(!page.contains(text), "{name} has {text}");
        }
    }
}

#[test]
fn hostile_texts_stay_texts() {
    let page = html::write(&hostile());
    assert_eq!(page.matches("<script").count(), 1, "the page's own");
    assert!(!page.contains("<img"));
    assert!(page.contains("&lt;img src=x onerror=alert(2)&gt;&quot;"));
    assert!(page.chars().all(|c| c == '\n' || !c.is_control() && c != '\u{202E}'));
    assert!(page.contains("\\u{202E}"));
}

#[test]
fn what_links_point_at_is_there() {
    for (name, _) in SAMPLES {
        let page = html::write(&sample(name));
        for link in page.split("href=\"#").skip(1) {
            let target = link.split('"').next().unwrap();
            assert_eq!(page.matches(&format!("id=\"{target}\"")).count(), 1, "{name}: {target}");
        }
    }
}

#[test]
fn what_failed_and_what_was_not_tried_stand_before_all_else() {
    for (name, _) in SAMPLES {
        let page = html::write(&sample(name));
        let sections: Vec<_> = page
            .split("<section id=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
            .filter(|id| !matches!(*id, "signatures" | "lint"))
            .collect();
        let place = |id| sections.iter().position(|section| *section == id);
        let untried = place("untried").unwrap_or_else(|| panic!("{name}: {sections:?}"));
        let before =
            usize::from(place("failures").is_some()) + usize::from(place("found").is_some());
        assert_eq!(untried, before, "{name}: {sections:?}");
    }
    let head = |name| {
        let page = html::write(&sample(name));
        page.split("</header>").next().unwrap().to_owned()
    };
    assert!(
        head("not-conformant").contains("Failed: <a href=\"#case-xon-xoff.loop.slow-control\">")
    );
    assert!(head("partial").contains("Not executed</a>: <code>xon-xoff.line.end-mark</code>, "));
    let page = html::write(&sample("partial"));
    let untried = page.split("id=\"untried\"").nth(1).unwrap().split("</section>").next().unwrap();
    for text in ["3 required cases not executed", "xon-xoff.rx.low-mark", "filtered"] {
        assert!(untried.contains(text), "{text}: {untried}");
    }
}

#[test]
fn numbers_of_what_did_not_happen_are_not_there() {
    let page = html::write(&sample("conformant"));
    let extent = page.split("id=\"extent\"").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(extent.contains("5 of 5 required cases executed, all passed"), "{extent}");
    for text in ["failed", "<dd>0"] {
        assert!(!extent.contains(text), "{text}: {extent}");
    }
    let page = html::write(&sample("not-conformant"));
    assert!(page.contains("5 of 5 required cases executed; 2 passed; 3 failed"));
}

#[test]
fn the_head_says_what_was_judged_and_by_what() {
    let report = sample("conformant");
    let page = html::write(&report);
    let head = page.split("</header>").next().unwrap();
    for text in [
        &report.plugin.name,
        &report.plugin.version,
        &report.plugin.sha256,
        &report.profile.name,
        &report.suite.version,
        &report.suite.engine,
        &report.suite.second_engine,
    ] {
        assert!(head.contains(text.as_str()), "{text}");
    }
    assert!(page.contains(&format!("module {}", &report.plugin.sha256[..16])), "at the foot");
    // A digest that is none brings nothing into the rules for paper.
    let mut report = hostile();
    report.plugin.sha256 = "}</style>\";f00d".to_owned();
    let page = html::write(&report);
    assert_eq!(page.matches("</style").count(), 1);
    assert!(page.contains("module ef00d"), "{}", page.split("</style").next().unwrap());
}

mod needs_chromium {
    use super::browser::{self, Browser};
    use super::*;

    #[test]
    fn the_page_is_drawn_wide_and_narrow() {
        let browser = Browser::new();
        for width in [1280, 400] {
            for name in ["not-conformant", "conformant"] {
                let picture = browser.screenshot(&html::write(&sample(name)), width, 1600);
                assert_eq!((picture.width, picture.height), (width, 1600));
                let colours = picture.colours();
                assert!(colours > 50, "{name} at {width} has {colours} colours: blank");
                // Something is drawn down to the lower half, and to the right.
                let drawn = |x: u32, y: u32| picture.has_ink(x..width, y..1600);
                assert!(drawn(width / 2, 800), "{name} at {width} ends too early");
            }
        }
    }

    #[test]
    fn on_paper_there_are_lines_to_sign_and_pages() {
        let browser = Browser::new();
        for (name, least) in [("conformant", 3), ("not-conformant", 6)] {
            let pages = browser.pages_on_paper(&html::write(&sample(name)));
            assert!(pages >= least, "{name} has {pages} pages");
        }
        let page = html::write(&sample("conformant"));
        let ruler = "<p id=ruler></p><script>onload = () => ruler.textContent = \
                     `signatures ${getComputedStyle(document.querySelector('#signatures')).display}.`</script></body>";
        let page = without_policy(&page).replace("</body>", ruler);
        assert!(browser.dump(&page, 800).contains("signatures none."));
        let on_paper = page.replace("@media print", "@media all");
        assert!(browser.dump(&on_paper, 800).contains("signatures grid."));
    }

    /// The check of pictures can fail.
    #[test]
    fn an_empty_page_is_blank() {
        let picture = Browser::new().screenshot("<!DOCTYPE html><title>x</title>", 400, 300);
        assert!(picture.colours() == 1 && !picture.has_ink(0..400, 0..300));
    }

    #[test]
    fn nothing_is_wider_than_a_phone() {
        let browser = Browser::new();
        for name in ["not-conformant", "not-judged"] {
            let page = html::write(&sample(name));
            let ruler = "<p id=ruler></p><script>onload = () => ruler.textContent = \
                         `wide ${document.documentElement.scrollWidth}`</script></body>";
            // The page itself lets no other script run.
            let page = without_policy(&page).replace("</body>", ruler);
            let shown = browser.dump(&page, 500);
            assert!(shown.contains("wide 500<"), "{name}: {:?}", shown.split("wide ").nth(1));
        }
    }

    #[test]
    fn the_texts_are_there_and_the_filter_works() {
        let page = html::write(&sample("not-conformant"));
        let shown = Browser::new().dump(&page, 1280);
        for text in ["Not conformant", "3 of 5 required cases failed", "observed: nothing"] {
            assert!(shown.contains(text), "{text}");
        }
        assert!(page.contains("class=\"filter\" hidden"), "without a script there is no filter");
        assert!(!shown.contains("class=\"filter\" hidden"), "the page's own script has run");
    }

    #[test]
    fn hostile_texts_run_nothing_and_fetch_nothing() {
        let browser = Browser::new();
        let (address, heard) = browser::listen();
        let mut report = hostile();
        let lure =
            format!("<img src='http://{address}/a'><script src='http://{address}/b'></script>");
        report.plugin.name.push_str(&lure);
        report.lint = vec![lure.clone(), "<style>@import 'http://x'</style>".to_owned()];
        report.cases[0].title = lure.clone();
        let page = html::write(&report);
        let shown = browser.dump(&page, 1280);
        assert!(shown.contains("&lt;img src='http://"), "it is shown as text");
        assert!(!heard.anything(), "the page has fetched something");
        // Even a text that got through would find nothing to fetch.
        browser.dump(&page.replace("<main>", &format!("<main>{lure}")), 1280);
        assert!(!heard.anything(), "the policy has let something through");
        // The check can fail.
        browser.dump(&without_policy(&page).replace("<main>", &format!("<main>{lure}")), 1280);
        assert!(heard.anything(), "a lure without the policy must be heard");
    }

    fn without_policy(page: &str) -> String {
        assert!(page.contains("Content-Security-Policy"));
        page.replace("Content-Security-Policy", "x-none")
    }
}
