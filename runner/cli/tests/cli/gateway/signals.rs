//! Signals: a configuration read again, and another command in the place of this one, while machines
//! cut or send.

use std::fs;
use std::io::BufReader;
use std::net::TcpStream;

use rustix::process::{Pid, Signal, kill_process};
use softplug_live::pty::PtyPair;

use super::{Gateway, bench, link, ready, take, token, wait_for};
use crate::bench::Bench;

fn two_machines(bench: &Bench, ptys: &[PtyPair; 2]) -> String {
    let path = |at: usize| ptys[at].slave_path().to_str().unwrap().to_owned();
    let links = link("lathe", &path(0)) + &link("mill", &path(1));
    let text = String::from_utf8(bench.read("gateway.toml")).unwrap();
    text.split("[[link]]").next().unwrap().to_owned() + "[gateway]\nwatch = false\n" + &links
}

#[test]
fn a_configuration_is_read_again_while_a_job_runs_elsewhere() {
    let ptys = [PtyPair::open().unwrap(), PtyPair::open().unwrap()];
    let bench = bench("");
    let text = two_machines(&bench, &ptys);
    bench.write("gateway.toml", &text);
    let token = token(&bench);
    let program = format!("%\nO1\n{}M30\n%\n", "N10 G1 X12.5 Y25\n".repeat(4_000));
    bench.write("programs/O1.nc", &program);
    let gateway = Gateway::start(&bench);
    let ask = |words: &[&str]| gateway.ask(&bench, &token, words);
    ask(&["job", "submit", "lathe", "O1.nc"]).with_code(0);
    let mut got = Vec::new();
    wait_for("bytes", || {
        take(&ptys[0], &mut got);
        got.len() > 5_000
    });

    // One that is wrong changes nothing.
    bench.write("gateway.toml", format!("{text}[[link]]\nname = \"lathe\"\n"));
    gateway.signal(Signal::HUP);
    gateway.until_log_says("the configuration is not taken");
    let at = text.rfind("plugin =").unwrap();
    let changed = format!("{}buffer = {{ size = 8192 }}\n{}", &text[..at], &text[at..]);
    let size = || ask(&["link", "show", "mill", "--json"]).json()["buffer"]["size"].as_u64();
    let links = ask(&["link", "list", "--json"]).json();
    assert_eq!(links.as_array().unwrap().len(), 2);
    bench.write("gateway.toml", &changed);
    gateway.signal(Signal::HUP);
    // Nobody takes anything: the job stands, and is under way whatever the computer does.
    wait_for("the other buffer", || size() == Some(8_192));
    assert_eq!(ask(&["job", "show", "1", "--json"]).json()["state"], "running");
    wait_for("the program's end", || {
        take(&ptys[0], &mut got);
        got.len() >= program.len()
    });
    assert_eq!(got, program.as_bytes());
    ask(&["job", "wait", "1"]).with_code(0);
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(log.contains("was read again; changed mill"), "{log}");
}

#[test]
fn what_a_machine_sends_while_another_command_takes_over_is_not_lost() {
    let pty = PtyPair::open().unwrap();
    let quiet = "settings = { quiet-time = 5000 }\n";
    let bench = bench(&(link("lathe", pty.slave_path().to_str().unwrap()) + quiet));
    let token = token(&bench);
    let mut gateway = Gateway::start(&bench);
    let state = |gateway: &Gateway| {
        gateway.ask(&bench, &token, &["link", "show", "lathe", "--json"]).json()["state"].clone()
    };
    wait_for("the port", || state(&gateway) == "idle");
    let id = gateway.child.id();
    gateway.signal(Signal::USR2);
    wait_for("the old one's end", || TcpStream::connect(&gateway.address).is_err());
    // The machine knows nothing of it.
    // No end of line, no character is anything else while nobody listens.
    let sent = format!("%\r\nO5\r\n{}\u{4}\u{7f}M30\r\n%", "N10 G1 X12.5 Y25\r\n".repeat(100));
    assert_eq!(pty.write(sent.as_bytes()).unwrap(), sent.len());
    assert_eq!(pty.write(b"\xff").unwrap(), 1);
    gateway.address = ready(&mut gateway.out);
    assert_eq!(gateway.child.id(), id);
    let received =
        || gateway.ask(&bench, &token, &["link", "received", "lathe", "--json"]).json()[0].clone();
    wait_for("the reception", || received()["file"] == "O5");
    gateway.ask(&bench, &token, &["link", "received", "lathe", "O5"]).with_code(0);
    assert_eq!(bench.read("O5"), [sent.as_bytes(), b"\xff"].concat());
    // Nothing was answered meanwhile, as a terminal would.
    let mut heard = Vec::new();
    take(&pty, &mut heard);
    assert_eq!(heard, b"");
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
}

#[test]
fn a_log_that_cannot_be_written_ends_nothing() {
    let bench = bench("");
    token(&bench);
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = bench.command(&["gateway", "run", "gateway.toml", "--json", "-v"]);
    let mut child = command.stderr(full).spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    ready(&mut out);
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn a_second_signal_gives_up_what_cannot_be_put_away() {
    let pty = PtyPair::open().unwrap();
    let tape = "settings = { preset = \"tape\", quiet-time = 300, end-quiet = 50 }\n";
    let bench = bench(&(link("lathe", pty.slave_path().to_str().unwrap()) + tape));
    token(&bench);
    bench.write("state/receptions/lathe", "in the way");
    let gateway = Gateway::start(&bench);
    assert_eq!(pty.write(b"%\nO7\nM30\n%\n").unwrap(), 11);
    gateway.until_log_says("; the machine is held");
    gateway.signal(Signal::TERM);
    gateway.until_log_says("once more to give it up");
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(5), "{log}");
    assert!(log.contains("received are lost") && log.contains("11 bytes"), "{log}");
}
