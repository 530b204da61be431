//! A plug-in that fails on a link: what is told of it, and its trace, replayed elsewhere.

use softplug_live::pty::PtyPair;
use softplug_service::library::Library;

use super::{Gateway, bench, token, wait_for};

#[test]
fn the_trace_of_a_quarantined_plug_in_shows_the_fault_again() {
    let pty = PtyPair::open().unwrap();
    let port = pty.slave_path().to_str().unwrap().to_owned();
    let bench = bench(&format!(
        "[supervision]\nfaults = 2\n[[link]]\nname = \"lathe\"\nport = \"{port}\"\n\
         line = \"115200 8N1\"\nplugin = \"fragile\"\n"
    ));
    let wat = include_str!("../../../../service/tests/gateway/fragile.wat");
    let wat = wat.replace("VERSION", "1.0.0").replace("LETTER", "88");
    let module = wat::parse_str(wat).unwrap();
    let plugin = bench.write("fragile.wasm", &module);
    Library::open(&bench.path("state/plugins")).unwrap().add(&module).unwrap();
    let token = token(&bench);
    let gateway = Gateway::start(&bench);
    let ask = |words: &[&str]| gateway.ask(&bench, &token, words);
    let shown = || ask(&["link", "show", "lathe", "--json"]).json();
    wait_for("the port", || shown()["state"] == "idle");
    pty.write(b"good").unwrap();
    pty.write(b"X").unwrap();
    wait_for("the new start", || shown()["counters"]["restarts"] == 1);
    ask(&["link", "release", "lathe"]).with_code(1);
    pty.write(b"X").unwrap();
    wait_for("the quarantine", || shown()["state"] == "quarantined");
    let faults = shown()["quarantine"]["faults"].clone();
    assert_eq!(faults.as_array().unwrap().len(), 2, "{faults:#}");
    assert_eq!(
        (&faults[0]["event"], &faults[0]["last_words"]),
        (&"received".into(), &"letter!".into())
    );

    let file = faults[0]["trace"].as_str().unwrap();
    let url = format!("http://{}/api/v1/links/lathe/traces/{file}", gateway.address);
    let mut trace = String::new();
    wait_for("the trace", || {
        let asked = ureq::get(&url).header("Authorization", format!("Bearer {token}")).call();
        asked.is_ok_and(|mut answer| {
            trace = answer.body_mut().read_to_string().unwrap();
            true
        })
    });
    bench.write("fault.spt", &trace);
    let words = ["replay", plugin.to_str().unwrap(), "fault.spt", "--no-permutations"];
    let ran = bench.run(&words).with_code(1);
    assert!(ran.out.contains("letter!") || ran.err.contains("letter!"), "{ran}");

    ask(&["link", "release", "lathe"]).with_code(0);
    wait_for("work", || shown()["state"] == "idle");
    gateway.signal(rustix::process::Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
}
