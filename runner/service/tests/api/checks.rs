//! What a program cannot say on a link's line, asked before anything is sent.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};
use softplug_service::library::Library;

use crate::common::bench::{Bench, blocks, plugins};

/// A plug-in that does this when its job begins, and at each timer.
fn tried(name: &str, how: &str) -> Vec<u8> {
    let text = include_str!("tried.wat").replace("NAME", name);
    wat::parse_str(text.replace("HOW", how)).unwrap()
}

/// Computes without end.
const SPINS: &str = "(loop $on (br $on))";
/// Sets a timer for the next µs.
const TICKS: &str = "(i64.store align=1 (i32.const 2053) (i64.add (local.get $now) (i64.const 1)))
    (return (i32.const 13))";
/// Traps.
const TRAPS: &str = "unreachable";
/// Waits for somebody who is not there.
const WAITS: &str = "nop";

fn add(folder: &Path, module: &[u8]) {
    Library::open(&folder.join("plugins")).unwrap().add(module).unwrap();
}

fn link(name: &str, plugin: &str, more: &str) -> String {
    format!(
        "[[link]]\nname = \"{name}\"\nport = \"simulate:xon-xoff\"\nplugin = \"{plugin}\"\n{more}\n"
    )
}

/// What the check of a program is on a link.
fn checked(bench: &Bench, link: &str, program: &str) -> Value {
    bench.get(&format!("/links/{link}/check?program={program}")).with(200).json()
}

/// The sentence of a refusal.
#[track_caller]
fn refused(bench: &Bench, link: &str, program: &str, status: u16) -> String {
    let answer = bench.get(&format!("/links/{link}/check?program={program}")).with(status);
    answer.json()["detail"].as_str().unwrap().to_owned()
}

#[test]
fn each_character_is_tried_through_the_plug_in_of_the_link() {
    let fanuc = link("mill-2", "fanuc-rs232", "line = \"4800 7E2\"");
    let bench = Bench::with_links_and(
        &format!("{}{fanuc}", link("lathe-1", "xon-xoff", "line = \"9600 8N1\"")),
        |folder| add(folder, &fs::read(plugins().join("fanuc-rs232.wasm")).unwrap()),
    );
    bench.upload("plain.nc", b"%\nO1\nG1 X1\nM30\n%\n").with(201);
    bench.upload("odd.nc", "%\nO1 (Gr\u{f6}\u{df}e)\nM30\n%\n".as_bytes()).with(201);
    let own = env!("CARGO_PKG_VERSION");
    assert_eq!(
        checked(&bench, "lathe-1", "plain.nc"),
        json!({
            "result": "passes", "plugin": format!("xon-xoff {own}"), "line": "9600 8N1",
            "bytes": 17, "different": 10, "characters": [],
        })
    );
    let odd = checked(&bench, "lathe-1", "odd.nc");
    assert_eq!(odd["result"], "altered");
    assert_eq!(
        odd["characters"][0],
        json!({
            "character": "\u{f6}", "bytes": "c3b6", "count": 1, "line": 2, "column": 7,
            "fate": "foreign", "what": "sent as c3b6, which few controls know", "instead": "OE",
        })
    );
    let odd = checked(&bench, "mill-2", "odd.nc");
    assert_eq!((&odd["result"], &odd["line"]), (&json!("refused"), &json!("4800 7E2")));
    assert_eq!(
        odd["message"],
        "odd.nc, line 2, column 7 cannot be sent: a character that cannot be sent on this link"
    );
    let fates: Vec<_> =
        odd["characters"].as_array().unwrap().iter().map(|of| &of["fate"]).collect();
    assert_eq!(fates, ["replaced", "refused", "refused", "replaced"]);
    // Who may read programs may ask, and nothing was ordered by it.
    let path = "/links/lathe-1/check?program=plain.nc";
    bench.ask("GET", path, &bench.viewer, b"").with(200);
    bench.ask("GET", path, "nobody", b"").with(401);
    assert_eq!(bench.get("/jobs").with(200).json(), json!([]));
}

#[test]
fn what_cannot_be_checked_is_refused_in_a_sentence() {
    let bench = Bench::new();
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    fs::write(bench.path("programs/empty.nc"), b"").unwrap();
    assert_eq!(refused(&bench, "nobody", "O1.nc", 404), "there is no link \"nobody\"");
    assert!(refused(&bench, "lathe-1", "none.nc", 404).contains("none.nc"));
    assert!(refused(&bench, "lathe-1", "empty.nc", 422).contains("empty"));
    for name in ["..%2Fgateway.toml", "", "%2Fetc%2Fpasswd"] {
        refused(&bench, "lathe-1", name, 422);
    }
    assert!(refused(&bench, "lathe-1", "O1.nc&kind=sned", 422).contains("has no job \"sned\""));
    assert!(
        refused(&bench, "lathe-1", "O1.nc&fields=%7B%22x%22:%221%22%7D", 422).contains("fields")
    );
    refused(&bench, "lathe-1", "O1.nc&fields=x", 400);
    refused(&bench, "lathe-1", "O1.nc&from_block=2", 400);
    bench.get("/links/lathe-1/check").with(400);
    bench.post("/links/lathe-1/check?program=O1.nc", &json!({})).with(405);
}

#[test]
fn whatever_a_program_is_made_of_it_is_checked_or_refused() {
    let bench = Bench::new();
    bench.upload("no-lines.nc", b"G0X1Y1").with(201);
    assert_eq!(checked(&bench, "lathe-1", "no-lines.nc")["result"], "passes");
    let binary: Vec<u8> = (0..=255).cycle().take(4_096).collect();
    bench.upload("binary.nc", &binary).with(201);
    let view = checked(&bench, "lathe-1", "binary.nc");
    let bytes: Vec<_> = view["characters"].as_array().unwrap().iter().collect();
    // All bytes that are no ASCII, and those that the plug-in does not send.
    assert!(bytes.len() >= 128, "{view:#}");
    assert!(bytes.iter().all(|of| of["count"] == 16), "{view:#}");
    // A text of every sign there is is no program.
    let signs: String = ('\u{4e00}'..'\u{5200}').collect();
    bench.upload("signs.nc", signs.as_bytes()).with(201);
    assert!(refused(&bench, "lathe-1", "signs.nc", 413).contains("more than 1000 different"));
    // A file that nobody should wait for.
    let large = File::create(bench.path("programs/large.nc")).unwrap();
    large.set_len((64 << 20) + 1).unwrap();
    assert_eq!(
        refused(&bench, "lathe-1", "large.nc", 413),
        "large.nc has 67108865 bytes; programs of at most 64 MiB are checked"
    );
}

#[test]
fn a_plug_in_that_fails_a_check_fails_nothing_else() {
    let names = [("spins", SPINS), ("ticks", TICKS), ("traps", TRAPS), ("waits", WAITS)];
    let links = names.map(|(name, _)| link(name, name, "line = \"9600 8N1\"")).concat();
    let bench = Bench::with_links_and(&links, |folder| {
        for (name, how) in names {
            add(folder, &tried(name, how));
        }
    });
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    for (name, _) in names {
        bench.until_link(name, "idle");
    }
    let detail = refused(&bench, "spins", "O1.nc", 409);
    let begin = "O1.nc cannot be tried with spins: the plug-in cannot go on: the plug-in failed on";
    assert!(detail.starts_with(begin), "{detail}");
    let detail = refused(&bench, "traps", "O1.nc", 409);
    assert!(detail.contains("with traps: the plug-in cannot go on"), "{detail}");
    assert_eq!(
        refused(&bench, "ticks", "O1.nc", 413),
        "O1.nc cannot be tried with ticks: it takes more computing than a trial may"
    );
    assert_eq!(
        refused(&bench, "waits", "O1.nc", 409),
        "O1.nc cannot be tried with waits: the plug-in waits for something that only a real partner sends"
    );
    for (name, _) in names {
        let view = bench.get(&format!("/links/{name}")).with(200).json();
        assert_eq!((&view["state"], &view["trouble"]), (&json!("idle"), &json!([])), "{name}");
        assert_eq!(view["counters"]["restarts"], 0, "{name}");
    }
}

#[test]
fn what_is_written_to_while_it_is_checked_has_no_answer() {
    let bench = Bench::new();
    bench.upload("O1.nc", blocks(20_000).as_bytes()).with(201);
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut file = File::options().write(true).open(bench.path("programs/O1.nc")).unwrap();
            // Bounded: where the answer is another one, the test fails instead of going on for ever.
            for _ in 0..60_000 {
                if is_over.load(Ordering::Relaxed) {
                    break;
                }
                file.write_all(b"G2 ").unwrap();
                thread::sleep(Duration::from_millis(1));
            }
        });
        let detail = refused(&bench, "lathe-1", "O1.nc", 409);
        is_over.store(true, Ordering::Relaxed);
        assert_eq!(detail, "O1.nc was written to while it was checked; check it again");
    });
}

#[test]
fn a_send_that_is_under_way_goes_on_while_others_are_checked() {
    let bench = Bench::new();
    let program = blocks(300);
    bench.upload("O1.nc", program.as_bytes()).with(201);
    bench.upload("other.nc", blocks(20_000).as_bytes()).with(201);
    bench.until_link("lathe-1", "idle");
    let job = bench.post("/links/lathe-1/jobs", &json!({ "program": "O1.nc" })).with(201).json();
    bench.until_link("lathe-1", "sending");
    thread::scope(|scope| {
        let checks: Vec<_> =
            (0..4).map(|_| scope.spawn(|| checked(&bench, "lathe-1", "other.nc"))).collect();
        for check in checks {
            assert_eq!(check.join().unwrap()["result"], "passes");
        }
    });
    let done = bench.until(&format!("/jobs/{}", job["id"]), |job| job["ended_ms"].is_u64());
    assert_eq!((&done["state"], &done["sent"]), (&json!("done"), &json!(program.len())));
    let link = bench.get("/links/lathe-1").with(200).json();
    assert_eq!(link["counters"]["bytes_out"], program.len());
    assert_eq!(link["counters"]["restarts"], 0);
}

#[test]
fn a_link_is_checked_for_wherever_its_plug_in_runs_and_whatever_it_does() {
    // Of units that nobody has switched on.
    let bench = Bench::with_bus();
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    assert_eq!(checked(&bench, "mill-1", "O1.nc")["result"], "passes");
    // In quarantine.
    let bench = Bench::new();
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    bench.until_link("lathe-1", "idle");
    bench.post("/links/lathe-1/quarantine", &json!({})).with(200);
    assert_eq!(checked(&bench, "lathe-1", "O1.nc")["result"], "passes");
    assert_eq!(bench.get("/links/lathe-1").with(200).json()["state"], "quarantined");
}

#[test]
fn what_the_machine_does_not_get_of_a_channels_program_is_not_checked() {
    let links: String =
        ["lathe-1", "lathe-2"].map(|name| link(name, "xon-xoff", "line = \"9600 8N1\"")).concat();
    let cell =
        "[[cell]]\nname = \"shafts\"\nchannels = [\"lathe-1\", \"lathe-2\"]\nwords = \"wai\"\n";
    let bench = Bench::with_links(&format!("{links}{cell}"));
    bench.upload("O1.nc", b"G0 X1\nWAI 10 lathe-1 lathe-2\nM30\n").with(201);
    let view = checked(&bench, "lathe-1", "O1.nc");
    assert_eq!((&view["result"], &view["bytes"]), (&json!("passes"), &json!(10)), "{view:#}");
}

#[test]
fn how_a_program_says_its_name_is_told_for_the_links_machine() {
    let bench = Bench::with_links(
        "[[link]]\nname = \"mill-1\"\nport = \"simulate:xon-xoff\"\nmachine = \"haas-vf\"\n",
    );
    bench.upload("O1.nc", b"%\nO00001\nM30\n%\n").with(201);
    bench.upload("P.nc", b"G0 X1\n").with(201);
    let named = checked(&bench, "mill-1", "O1.nc");
    assert_eq!((&named["line"], &named["remark"]), (&json!("9600 7E2"), &Value::Null));
    let unnamed = checked(&bench, "mill-1", "P.nc");
    assert_eq!(unnamed["remark"], "P.nc does not say its name as haas-vf wants it: O{number}");
    assert_eq!(unnamed["result"], "passes");
}
