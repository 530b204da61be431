//! Card, page, interface and machine are compared, second by second.

use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use crate::common::bench::Bench;
use crate::page::browser::Browser;
use crate::page::machine::Machine;

/// What a plug-in may keep by itself, and what is on the way, is not said to have left.
const BEHIND: u64 = 2_000;

/// A link on a line of 19,200 baud with its machine, and the page.
struct Hall {
    machine: Machine,
    bench: Bench,
    browser: Browser,
}

impl Hall {
    fn open(program: &[u8]) -> Self {
        let machine = Machine::start();
        let link = format!(
            "[[link]]\nname = \"lathe-1\"\nport = \"{}\"\nline = \"19200 8N1\"\nplugin = \"xon-xoff\"\n",
            machine.port
        );
        let bench = Bench::with_links(&link);
        bench.until_link("lathe-1", "idle");
        bench.upload("O1.nc", program).with(201);
        let mut browser = Browser::open();
        browser.size(1280, 900);
        browser.go(&bench.url("/"));
        browser.until("document.activeElement?.name === 'token'");
        browser.type_text(&bench.operator);
        browser.press("Enter");
        browser.until("document.querySelectorAll('.card').length === 1");
        Self { machine, bench, browser }
    }

    fn send(&self) -> u64 {
        let job = self.bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201);
        job.json()["id"].as_u64().unwrap()
    }

    fn link(&self) -> Value {
        self.bench.get("/links/lathe-1").with(200).json()
    }

    fn card(&mut self) {
        self.browser.value("location.hash = '#/links'");
        self.browser.until("document.querySelector('.card .what')");
    }

    fn page(&mut self) {
        self.browser.value("location.hash = '#/link/lathe-1'");
        self.browser.until("document.querySelector('.what.large') && document.querySelector('td')");
    }

    /// The number in front of ` of …` in the first element of this kind, once it is `least` or more.
    #[track_caller]
    fn shown(&mut self, selector: &str, least: u64) -> u64 {
        let find = format!(
            "Number((document.querySelector({})?.textContent ?? '')\
             .match(/([\\d,]+) of [\\d,]+ bytes have/)?.[1].replaceAll(',', '') ?? 0)",
            Value::from(selector)
        );
        self.browser.until(&format!("{find} >= {least}"));
        self.browser.value(&find).as_u64().unwrap()
    }
}

fn program(bytes: usize) -> Vec<u8> {
    (1..).flat_map(|n| format!("N{n} G01 X{n} Y-{n}\n").into_bytes()).take(bytes).collect()
}

fn surely(job: &Value) -> u64 {
    job["surely_left"].as_u64().unwrap()
}

const ROW: &str = "tr.running td:nth-child(4), tr.paused td:nth-child(4), tr.done td:nth-child(4)";

#[test]
fn every_second_of_a_transfer_all_tell_what_the_machine_received() {
    let program = program(24_000);
    let mut hall = Hall::open(&program);
    let id = hall.send();
    let (mut seconds, mut largest) = (0, 0);
    while hall.link()["job"].is_object() {
        hall.card();
        let at_first = hall.machine.count();
        let before = hall.link();
        // It may have ended since.
        if !before["job"].is_object() {
            break;
        }
        let card = hall.shown(".card .what", surely(&before["job"]));
        hall.page();
        let page = hall.shown(".what.large", card);
        let row = hall.shown(ROW, card);
        let job = hall.bench.get(&format!("/jobs/{id}")).with(200).json();
        let after = surely(&job);
        // None knows of less than was known before, and none of more than there is afterwards.
        assert!(card <= after && page <= after && row <= after, "{card} {page} {row} {after}");
        // What has surely left, the machine has; what the machine has may have left.
        hall.machine.has(after);
        assert!(job["maybe_left"].as_u64().unwrap() >= at_first, "{at_first}: {job:#}");
        assert!(after + BEHIND >= at_first, "it has {at_first}, and this is told: {job:#}");
        assert_eq!(job["percent"], after * 100 / 24_000);
        largest = largest.max(card);
        seconds += 1;
        sleep(Duration::from_secs(1));
    }
    assert!(seconds >= 3 && largest > 4_000, "{seconds} looks, {largest} bytes");
    hall.machine.has(24_000);
    assert_eq!(hall.machine.received(), program);
    // The last result stays where it was.
    for (open, selector) in [
        (Hall::card as fn(&mut Hall), ".card .what"),
        (Hall::page, ".what.large"),
        (Hall::page, ROW),
    ] {
        open(&mut hall);
        assert_eq!(hall.shown(selector, 24_000), 24_000, "{selector}");
    }
    assert_eq!(hall.link()["last"]["percent"], 100);
    assert_eq!(hall.link()["trouble"], json!([]));
    assert_eq!(hall.browser.complaints, Vec::<String>::new());
}

#[test]
fn held_and_paused_are_two_things_and_all_say_the_same_words() {
    let mut hall = Hall::open(&program(40_000));
    let id = hall.send();
    hall.machine.has(3_000);
    hall.machine.hold();
    hall.bench.until("/links/lathe-1", |link| link["is_held"] == true);
    // What was on its way has arrived.
    sleep(Duration::from_millis(500));
    let words = |hall: &Hall| {
        let job = hall.bench.get(&format!("/jobs/{id}")).with(200).json();
        let link = hall.link();
        assert_eq!(
            (&link["job"]["text"], &link["job"]["percent"]),
            (&job["text"], &job["percent"])
        );
        job["text"].as_str().unwrap().to_owned()
    };
    let held = words(&hall);
    assert!(held.ends_with("; held by the machine"), "{held}");
    hall.card();
    hall.browser.sees(&format!("O1.nc: {held}"));
    hall.browser
        .until("document.querySelector('.card .badge')?.textContent === '■held by the machine'");
    hall.page();
    hall.browser.sees(&format!("O1.nc: {held}"));
    hall.browser
        .until(&format!("document.querySelector('{ROW}')?.textContent === {}", json!(held)));

    hall.browser.click("button", "Pause");
    hall.bench.until("/links/lathe-1", |link| link["is_held"] == false);
    let paused = words(&hall);
    assert!(paused.ends_with("; paused") && !paused.contains("held"), "{paused}");
    hall.browser.until("document.querySelector('.badge')?.textContent.endsWith('paused by hand')");
    hall.browser.sees(&format!("O1.nc: {paused}"));
    hall.browser.until("!document.body.innerText.includes('Override hold')");
    hall.card();
    hall.browser.sees(&format!("O1.nc: {paused}"));
    hall.browser.until("!document.querySelector('.card')?.innerText.includes('held')");
    // Nothing has come meanwhile that was not told.
    let told = surely(&hall.link()["job"]);
    assert!(hall.machine.count() >= told && hall.machine.count() <= told + BEHIND);

    hall.machine.release();
    hall.page();
    hall.browser.click("button", "Resume");
    hall.machine.has(told + BEHIND + 500);
    hall.browser.click("button", "Abort");
    hall.browser.click("button", "Abort: sure?");
    hall.bench.until(&format!("/jobs/{id}"), |job| job["state"] == "aborted");
    // The banner follows the job, and the card keeps how it ended until somebody has seen it.
    hall.browser.until("document.querySelector('#message').textContent.includes(': aborted')");
    let link = hall.bench.until_link("lathe-1", "idle");
    let result = link["last"]["text"].as_str().unwrap().to_owned();
    assert_eq!(link["unseen"][0]["text"], result);
    hall.card();
    hall.browser.until(&format!(
        "document.querySelector('.card.trouble .wrong')?.textContent === {}",
        json!(format!("job {id}, O1.nc, aborted: {result}"))
    ));
    hall.browser.sees("trouble 1");
    assert_eq!(hall.link()["trouble"].as_array().unwrap().len(), 1);
    hall.browser.click("button", "Seen");
    hall.browser.until("!document.querySelector('.card.trouble')");
    hall.browser.sees(&format!("O1.nc aborted; {result}"));
    assert_eq!((&hall.link()["trouble"], &hall.link()["unseen_count"]), (&json!([]), &json!(0)));
    assert_eq!(hall.browser.complaints, Vec::<String>::new());
}

#[test]
fn an_answer_that_comes_behind_the_news_takes_nothing_back() {
    let mut hall = Hall::open(&program(40_000));
    hall.send();
    hall.page();
    hall.browser.until("document.querySelector('tr.running')");
    // Answers to what is ordered come late: the gateway has told of what came of it by then.
    hall.browser.value(
        "window.answered = 0; const fetched = window.fetch; \
         window.fetch = async (path, how) => { \
             const answer = await fetched(path, how); \
             if (how?.method === 'POST') { \
                 const body = await answer.text(); \
                 await new Promise((go) => setTimeout(go, 1500)); \
                 window.answered += 1; \
                 return new Response(body, { status: answer.status }); \
             } \
             return answer; \
         }; 0",
    );
    hall.browser.click("button", "Abort");
    hall.browser.click("button", "Abort: sure?");
    hall.browser.until("document.querySelector('tr.aborted')");
    hall.browser.until("window.answered === 1");
    hall.browser.until("document.querySelector('#message').textContent.includes(': aborted')");
    assert_eq!(hall.browser.value("Boolean(document.querySelector('tr.aborted'))"), true);
    assert_eq!(hall.browser.complaints, Vec::<String>::new());
}
