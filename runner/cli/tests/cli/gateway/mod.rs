//! `softplug gateway`: configurations checked, and the real process from its start to
//! its end, orderly or not.

mod bombs;
mod checks;
mod full;
mod lines;
mod real_time;
mod signals;
mod supervision;
mod systemd;
mod visitors;
mod waiting;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_service::library::Library;

use crate::bench::{Bench, Ran, plugins, snapshot};

/// Longer than anything here takes; only a hang gets there.
const HANG: Duration = Duration::from_mins(2);

fn bench(links: &str) -> Bench {
    let bench = Bench::new();
    let library = Library::open(&bench.path("state/plugins")).unwrap();
    library.add_file(&plugins().join("xon-xoff.wasm")).unwrap();
    bench.write(
        "gateway.toml",
        format!("[http]\nlisten = \"127.0.0.1:0\"\ntokens = \"t.toml\"\n{links}"),
    );
    bench
}

fn link(name: &str, port: &str) -> String {
    format!(
        "[[link]]\nname = \"{name}\"\nport = \"{port}\"\nline = \"115200 8N1\"\nplugin = \"xon-xoff\"\n"
    )
}

/// A gateway's process.
pub(crate) struct Gateway {
    child: Child,
    out: BufReader<ChildStdout>,
    /// What it has written to stderr so far, and who reads that.
    log: Arc<Mutex<String>>,
    reader: JoinHandle<()>,
    pub(crate) address: String,
}

impl Gateway {
    pub(crate) fn start(bench: &Bench) -> Self {
        Self::of(bench.command(&["gateway", "run", "gateway.toml", "--json"]))
    }

    /// What the command starts.
    fn of(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let log = Arc::new(Mutex::new(String::new()));
        let (written, said) = (Arc::clone(&log), child.stderr.take().unwrap());
        let reader = std::thread::spawn(move || {
            for line in BufReader::new(said).lines() {
                *written.lock().unwrap() += &(line.unwrap() + "\n");
            }
        });
        let address = ready(&mut out);
        Self { child, out, log, reader, address }
    }

    /// Waits until it has written this to its log.
    #[track_caller]
    fn until_log_says(&self, text: &str) {
        wait_for(text, || self.log.lock().unwrap().contains(text));
    }

    /// What a verb that speaks with it says.
    fn ask(&self, bench: &Bench, token: &str, words: &[&str]) -> Ran {
        let mut command = bench.command(words);
        let address = format!("http://{}", self.address);
        command.env("SOFTPLUG_GATEWAY", address).env("SOFTPLUG_TOKEN", token);
        command.output().unwrap().into()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    pub(crate) fn end(mut self) -> (Option<i32>, String) {
        let code = self.child.wait().unwrap().code();
        self.reader.join().unwrap();
        let log = self.log.lock().unwrap().clone();
        (code, log)
    }
}

fn ready(out: &mut BufReader<ChildStdout>) -> String {
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    let ready: Value = serde_json::from_str(&line).unwrap_or_else(|_| panic!("not ready: {line}"));
    ready["address"].as_str().unwrap().to_owned()
}

pub(crate) fn token(bench: &Bench) -> String {
    let ran = bench.run(&["gateway", "token", "--name", "t", "--role", "admin", "--json"]);
    let made = ran.with_code(0).json();
    let entry = &made["entry"];
    let (role, sha256) = (entry["role"].as_str().unwrap(), entry["sha256"].as_str().unwrap());
    let text = format!("[[token]]\nname = \"t\"\nrole = \"{role}\"\nsha256 = \"{sha256}\"\n");
    bench.write("t.toml", text);
    made["token"].as_str().unwrap().to_owned()
}

pub(crate) fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !there() {
        assert!(begin.elapsed() < HANG, "{what} did not come about");
        sleep(Duration::from_millis(20));
    }
}

/// Takes what the machine gets, without XON and XOFF.
fn take(pty: &PtyPair, got: &mut Vec<u8>) {
    let mut buffer = [0; 4_096];
    while let ReadOutcome::Read(count) = pty.read(&mut buffer).unwrap() {
        got.extend(buffer[..count].iter().filter(|byte| !matches!(byte, 0x11..=0x14)));
    }
}

#[test]
fn every_problem_of_a_configuration_is_told_with_its_place() {
    let bench = bench(&link("lathe", "pty:"));
    let right = bench.run(&["gateway", "check", "gateway.toml"]).with_code(0);
    snapshot("gateway-right", right);
    let mut wrong = link("lathe", "COM3") + &link("lathe", "pty:");
    wrong += "[[link]]\nname = \"mill\"\nport = \"pty:\"\nplugin = \"xonxoff\"\n[defaults]\nflow = \"hots\"\n";
    bench.write("wrong.toml", &wrong);
    let ran = bench.run(&["gateway", "check", "wrong.toml"]).with_code(2);
    assert_eq!(bench.run(&["gateway", "run", "wrong.toml"]).with_code(2).err, ran.err);
    snapshot("gateway-wrong", ran);
    let unknown = link("lathe", "pty:").replace("\"xon-xoff\"", "\"xonxoff\"")
        + &link("mill", "pty:")
            .replace("plugin = \"xon-xoff\"", "plugin = \"xon-xoff\"\nsettings = { xon = 999 }");
    bench.write("plugins.toml", &unknown);
    snapshot("gateway-plugins", bench.run(&["gateway", "check", "plugins.toml"]).with_code(2));
    let json = bench.run(&["gateway", "check", "plugins.toml", "--json"]).with_code(2).json();
    let problems = json["problems"].as_array().unwrap();
    let places: Vec<_> =
        problems.iter().map(|p| (p["line"].as_u64(), p["column"].as_u64())).collect();
    assert_eq!(places, [(Some(5), Some(10)), (Some(11), Some(20))]);
}

#[test]
fn a_gateway_that_is_killed_knows_what_was_under_way() {
    let pty = PtyPair::open().unwrap();
    let bench = bench(&link("lathe", pty.slave_path().to_str().unwrap()));
    let token = token(&bench);
    let program = format!("%\nO1\n{}M30\n%\n", "N10 G1 X12.5 Y25\n".repeat(40_000));
    bench.write("programs/O1.nc", &program);
    let gateway = Gateway::start(&bench);
    gateway.ask(&bench, &token, &["job", "submit", "lathe", "O1.nc", "--json"]).with_code(0);
    let mut got = Vec::new();
    wait_for("bytes", || {
        take(&pty, &mut got);
        got.len() > 20_000
    });
    // While it is busy, no other command takes its place.
    gateway.signal(Signal::USR2);
    gateway.until_log_says("cannot be replaced now: lathe is busy");
    let reached = got.len() + 5_000;
    wait_for("more bytes", || {
        take(&pty, &mut got);
        got.len() > reached
    });
    gateway.signal(Signal::KILL);
    assert_eq!(gateway.end().0, None);
    take(&pty, &mut got);
    assert_eq!(got, program.as_bytes()[..got.len()]);

    let mut gateway = Gateway::start(&bench);
    let job = gateway.ask(&bench, &token, &["job", "show", "1", "--json"]).json();
    assert_eq!(job["state"], "interrupted", "{job}");
    let (surely, maybe) =
        (job["surely_left"].as_u64().unwrap(), job["maybe_left"].as_u64().unwrap());
    assert!(surely <= got.len() as u64 && got.len() as u64 <= maybe, "{surely} {maybe} {job}");
    // In every list the same words, and trouble until somebody has seen it.
    let text = job["text"].as_str().unwrap();
    let jobs = gateway.ask(&bench, &token, &["job", "list"]).with_code(0).out;
    assert!(jobs.contains(text), "{text}\n{jobs}");
    let links = gateway.ask(&bench, &token, &["link", "list"]).with_code(0).out;
    assert!(links.contains("last 1: O1.nc interrupted") && links.contains(text), "{text}\n{links}");
    assert!(links.contains("job 1, O1.nc, interrupted: the gateway ended"), "{links}");
    let seen = gateway.ask(&bench, &token, &["job", "acknowledge", "1"]).with_code(0).out;
    assert!(seen.contains(text), "{text}\n{seen}");
    let shown = gateway.ask(&bench, &token, &["link", "show", "lathe"]).with_code(0).out;
    assert!(shown.contains(&format!("last 1: O1.nc interrupted, {text}")), "{text}\n{shown}");
    assert!(!shown.contains("trouble"), "{shown}");
    // Jobs and journal, by what they are about and when.
    let listed = |words: &[&str]| gateway.ask(&bench, &token, words).with_code(0).json();
    let count = |words: &[&str]| listed(words).as_array().unwrap().len();
    assert_eq!(
        count(&["job", "list", "--find", "o1.N", "--kind", "send", "--since", "1h", "--json"]),
        1
    );
    assert_eq!(count(&["job", "list", "--find", "O2", "--json"]), 0);
    assert_eq!(count(&["job", "list", "--until", "1h", "--json"]), 0);
    let journal = listed(&["journal", "--job", "1", "--kind", "job", "--link", "lathe", "--json"]);
    let entries = journal.as_array().unwrap();
    assert!(entries.len() > 1 && entries.is_sorted_by_key(|of| of["number"].as_u64()), "{journal}");
    assert!(entries.iter().all(|of| of["job"] == 1 && of["kind"] == "job"), "{journal}");
    assert_eq!(count(&["journal", "--until", "1d", "--json"]), 0);
    let told = gateway.ask(&bench, &token, &["journal", "--find", "INTERRUPTED"]).with_code(0).out;
    assert!(told.contains("UTC  lathe  1"), "{told}");
    let odd = gateway.ask(&bench, &token, &["journal", "--kind", "jobs"]);
    assert!(odd.code != 0 && odd.err.contains("jobs"), "{odd}");
    // Nothing is sent again unasked, also by the command that takes its place.
    gateway.signal(Signal::USR2);
    gateway.address = ready(&mut gateway.out);
    gateway.ask(&bench, &token, &["job", "list", "--json"]).with_code(0);
    let before = got.len();
    take(&pty, &mut got);
    assert_eq!(got.len(), before);
    fs::write(bench.path("gateway.toml"), "[[link]]\n").unwrap();
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
}
