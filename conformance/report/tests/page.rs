//! The HTML page: what stands in it, and that nothing from outside gets out of its
//! place.

mod common;

use common::{SAMPLES, hostile, sample};
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
    let article = page.split("<article id=\"case-xon-xoff-tx-hold\"").nth(1).unwrap();
    let article = article.split("</article>").next().unwrap();
    for text in [
        "xon-xoff.tx.hold",
        "After XOFF no further byte is given to the port",
        "0.001146",
        "&gt; 2.000000 43 44",
        "&lt; 0.001100 13",
        "softplug certify PLUGIN --profile xon-xoff --case xon-xoff.tx.hold",
        "xon-xoff/xon-xoff.tx.hold.spt:15",
        "xon-xoff.tx.hold/swap:all",
        "And 2 more failed runs.",
        "<svg class=\"sequence\"",
        "▲",
    ] {
        assert!(article.contains(text), "{text}: {article}");
    }
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
