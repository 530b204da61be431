//! A job that waits for the machine: what is awaited, and what the operator has to do.

use rustix::process::Signal;
use softplug_live::pty::PtyPair;

use super::{Gateway, bench, link, take, token, wait_for};

const AWAITS: &str = "waits for the machine to say go (XON): start reading at the machine";

#[test]
fn what_a_job_waits_for_is_said_by_every_verb_also_while_it_is_waited_for() {
    let pty = PtyPair::open().unwrap();
    let link =
        link("lathe", pty.slave_path().to_str().unwrap()) + "settings = { wait_for_xon = true }\n";
    let bench = bench(&link);
    let token = token(&bench);
    let program = "%\nO1\nM30\n%\n".repeat(500);
    bench.write("programs/O1.nc", &program);
    let gateway = Gateway::start(&bench);
    let ask = |words: &[&str]| gateway.ask(&bench, &token, words);
    ask(&["job", "submit", "lathe", "O1.nc"]).with_code(0);
    wait_for("what is awaited", || ask(&["job", "show", "1"]).out.contains(AWAITS));
    let links = ask(&["link", "list"]).with_code(0).out;
    assert!(links.contains("sending, waits for the machine"), "{links}");
    assert!(links.contains(&format!("1: O1.nc, nothing has left yet; {AWAITS}")), "{links}");
    let jobs = ask(&["job", "list"]).with_code(0).out;
    assert!(jobs.contains(&format!("nothing has left yet; {AWAITS}")), "{jobs}");
    // Who waits for the job is told, too, on standard error and without a terminal.
    let waited = std::thread::scope(|scope| {
        let waiting = scope.spawn(|| ask(&["job", "wait", "1"]));
        wait_for("the second look", || ask(&["job", "show", "1"]).out.contains(AWAITS));
        std::thread::sleep(std::time::Duration::from_millis(500));
        assert_eq!(pty.write(b"\x11").unwrap(), 1);
        let mut got = Vec::new();
        wait_for("the program", || {
            take(&pty, &mut got);
            got.len() >= program.len()
        });
        assert_eq!(got, program.as_bytes());
        waiting.join().unwrap()
    });
    let waited = waited.with_code(0);
    assert!(waited.err.contains(AWAITS), "{}", waited.err);
    assert!(waited.out.contains("done") && !waited.out.contains("waits for"), "{}", waited.out);
    gateway.signal(Signal::TERM);
    assert_eq!(gateway.end().0, Some(0));
}
