//! `softplug record` between two ptys: in real time, with a partner on each side.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use softplug_abi::LineParameters;
use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_live::{Input, Port, PortOptions, PortSpec};
use softplug_trace::{NoFiles, Trace, What};

use crate::bench::{Bench, Ran};

/// Longer than anything here takes; only a hang gets there.
const HANG: Duration = Duration::from_mins(2);

/// `softplug record`, started, with the paths that it gives out for `pty:`.
struct Recording {
    child: Child,
    err: BufReader<ChildStderr>,
    ptys: Vec<String>,
}

impl Recording {
    /// Waits until `ptys` paths were told.
    fn start(bench: &Bench, ports: [&str; 2], ptys: usize, options: &[&str]) -> Self {
        let words = ["record", "--json", "--a", ports[0], "--b", ports[1], "--out", "s.spt"];
        let mut child = bench.command(&[&words[..], options].concat()).spawn().unwrap();
        let mut err = BufReader::new(child.stderr.take().unwrap());
        let mut found = Vec::new();
        let mut line = String::new();
        while found.len() < ptys {
            line.clear();
            assert!(err.read_line(&mut line).unwrap() > 0, "it ended: {found:?}");
            if let Some((_, path)) = line.trim_end().split_once("may open ") {
                found.push(path.to_owned());
            }
        }
        Self { child, err, ptys: found }
    }

    fn interrupt(&self) {
        kill_process(Pid::from_child(&self.child), Signal::INT).unwrap();
    }

    fn end(mut self) -> Ran {
        let mut rest = String::new();
        self.err.read_to_string(&mut rest).unwrap();
        let mut ran: Ran = self.child.wait_with_output().unwrap().into();
        ran.err = rest;
        ran
    }
}

fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !there() {
        assert!(begin.elapsed() < HANG, "{what} did not come about");
        sleep(Duration::from_millis(2));
    }
}

fn open(path: &str) -> Port {
    let options = PortOptions::new(LineParameters::new(9_600));
    Port::open(&PortSpec::Device(path.into()), &options).unwrap()
}

/// One partner says it, the other hears it.
fn say(from: &mut Port, to: &mut Port, bytes: &[u8]) {
    assert_eq!(from.write(bytes).unwrap(), bytes.len());
    let mut got = Vec::new();
    wait_for("what was said", || {
        to.read(usize::MAX, &mut |input| match input {
            Input::Bytes(bytes) => got.extend_from_slice(bytes),
            other @ Input::LineError { .. } => panic!("{other:?}"),
        })
        .unwrap();
        got.len() >= bytes.len()
    });
    assert_eq!(got, bytes);
}

/// The trace, which is canonical, and its bytes by direction.
fn trace(bench: &Bench) -> (Trace, Vec<u8>, Vec<u8>) {
    let text = String::from_utf8(bench.read("s.spt")).unwrap();
    let trace = Trace::parse(&text).unwrap();
    assert_eq!(trace.format(), text);
    let joined = |sign: &str| -> Vec<u8> {
        let entries = trace.entries().filter(|entry| entry.what.sign().starts_with(sign));
        entries.flat_map(|entry| entry.what.payload().unwrap().bytes(&NoFiles).unwrap()).collect()
    };
    let (given, sent) = (joined("<"), joined(">"));
    (trace, given, sent)
}

#[test]
fn the_trace_is_what_was_exchanged() {
    for side in ["a", "b"] {
        let bench = Bench::new();
        let options = ["--as", side, "--line", "4800 7E2", "--device", "a lathe"];
        let recording = Recording::start(&bench, ["pty:", "pty:"], 2, &options);
        let (mut a, mut b) = (open(&recording.ptys[0]), open(&recording.ptys[1]));
        let all: Vec<u8> = (0..=255).collect();
        say(&mut a, &mut b, b"%\nO1\n");
        say(&mut b, &mut a, b"\x13");
        say(&mut b, &mut a, b"\x11");
        say(&mut a, &mut b, &all);
        recording.interrupt();
        let json = recording.end().with_code(0).json();
        assert_eq!((&json["result"], &json["files"][0]), (&"stopped".into(), &"s.spt".into()));
        assert_eq!((&json["a_to_b"], &json["b_to_a"]), (&261.into(), &2.into()));
        let (trace, given, sent) = trace(&bench);
        let (from_a, from_b) = if side == "a" { (sent, given) } else { (given, sent) };
        assert_eq!(from_a, [b"%\nO1\n", &all[..]].concat());
        assert_eq!(from_b, b"\x13\x11");
        assert_eq!(trace.front.id, "recorded.s");
        assert_eq!((trace.front.line.baud, trace.front.line.data_bits), (4_800, 7));
        let signs: Vec<_> = trace.entries().map(|entry| entry.what.sign()).collect();
        assert!(matches!(trace.entries().last().unwrap().what, What::Quiet));
        let (ours, theirs) = if side == "a" { (">", "<") } else { ("<", ">") };
        assert_eq!(signs.first(), Some(&ours));
        assert!(signs.iter().any(|sign| sign.starts_with(theirs)));
        assert_eq!(trace.entries().next().unwrap().when.from.0, 0);
        assert_eq!(bench.names(), ["s.spt"]);
    }
}

/// As [`open`], by a program that sets this rate.
fn open_at(path: &str, baud: u32) -> Port {
    let options = PortOptions::new(LineParameters::new(baud));
    Port::open(&PortSpec::Device(path.into()), &options).unwrap()
}

#[test]
fn the_rate_that_a_program_sets_on_its_pty_is_the_lines() {
    for (options, recorded, is_told) in
        [(&[][..], 115_200, false), (&["--line", "9600 8N1"][..], 9_600, true)]
    {
        let bench = Bench::new();
        let recording = Recording::start(&bench, ["pty:", "pty:"], 2, options);
        let mut a = open_at(&recording.ptys[0], 115_200);
        let mut b = open_at(&recording.ptys[1], 115_200);
        say(&mut a, &mut b, b"G1X1");
        recording.interrupt();
        let ran = recording.end().with_code(0);
        let told = "set its port to 115200 baud, the line is at 9600";
        assert_eq!(ran.err.contains(told), is_told, "{ran}");
        let (trace, _, sent) = trace(&bench);
        assert_eq!((trace.front.line.baud, &sent[..]), (recorded, &b"G1X1"[..]));
    }
}

#[test]
fn a_port_that_is_unplugged_ends_it_and_the_trace_stays() {
    let bench = Bench::new();
    let machine = PtyPair::open().unwrap();
    let path = machine.slave_path().to_str().unwrap().to_owned();
    let recording = Recording::start(&bench, ["pty:", &path], 1, &[]);
    let mut software = open(&recording.ptys[0]);
    assert_eq!(software.write(b"G1X1").unwrap(), 4);
    let mut buffer = [0; 16];
    wait_for("the bytes", || matches!(machine.read(&mut buffer).unwrap(), ReadOutcome::Read(4)));
    machine.write(b"\x13\x11").unwrap();
    let mut got = 0;
    wait_for("the answer", || {
        software.read(usize::MAX, &mut |_| got += 1).unwrap();
        got > 0
    });
    drop(machine);
    let json = recording.end().with_code(6).json();
    assert_eq!(json["result"], "port-lost");
    assert!(json["message"].as_str().unwrap().contains("side b"), "{json}");
    let (_, given, sent) = trace(&bench);
    assert_eq!((&given[..], &sent[..]), (&b"\x13\x11"[..], &b"G1X1"[..]));
    assert_eq!(bench.names(), ["s.spt"]);
}

#[test]
fn what_a_stalled_side_does_not_take_is_told() {
    let bench = Bench::new();
    let recording = Recording::start(&bench, ["pty:", "pty:"], 2, &[]);
    let mut a = open(&recording.ptys[0]);
    // Nobody reads on side b: the ptys and the tap fill up, with more than one pty holds.
    let block = [b'X'; 4_096];
    let (mut written, mut idle) = (0, 0);
    while written < 24_576 || idle < 1_000 {
        let count = a.write(&block).unwrap();
        written += count;
        idle = if count > 0 { 0 } else { idle + 1 };
        sleep(Duration::from_millis(1));
    }
    recording.interrupt();
    let json = recording.end().with_code(5).json();
    assert!(json["not_passed"].as_u64().unwrap() > 0, "{json}");
    let (_, given, sent) = trace(&bench);
    let (passed, held) = (json["a_to_b"].as_u64(), json["not_passed"].as_u64());
    assert_eq!(sent.len() as u64, passed.unwrap() + held.unwrap());
    assert!(given.is_empty());
}

#[test]
fn a_plug_in_is_compared_and_a_program_redacted() {
    let bench = Bench::new();
    let plugin = ["--plugin", "r3964", "--set", "nak_at_start=off", "--set", "zvz=60000"];
    let options = [&plugin[..], &["--redact", "--idle", "3"]].concat();
    let recording = Recording::start(&bench, ["pty:", "pty:"], 2, &options);
    let (mut a, mut b) = (open(&recording.ptys[0]), open(&recording.ptys[1]));
    let block = b"SECRET7\x10\x03";
    let check = |data: &[u8]| data.iter().fold(0, |sum, byte| sum ^ byte);
    say(&mut b, &mut a, b"\x02");
    say(&mut a, &mut b, b"\x10");
    say(&mut b, &mut a, &[block, &[check(block)][..]].concat());
    // The plug-in would have acknowledged this.
    say(&mut a, &mut b, b"\x15");
    say(&mut b, &mut a, b"\x02");
    recording.end().with_code(0);
    let (trace, given, _) = trace(&bench);
    let text = trace.format();
    assert_eq!((&*trace.front.profile, &*trace.front.id), ("r3964", "r3964.s"));
    assert_eq!((given[0], given.len()), (0x02, 12));
    assert_eq!(check(&given[1..10]), given[10], "the check fits the redacted block");
    assert_ne!(&given[1..8], &block[..7]);
    assert!(!text.contains("SECRET") && text.contains("# Redacted"), "{text}");
    assert!(
        text.contains("# r3964 would have sent 1 byte at") && text.contains("not 1 byte"),
        "{text}"
    );
    assert!(text.contains("# r3964 would have delivered 7 bytes"), "{text}");
}

/// What comes, until something is there that `is_all` takes for all.
fn hear(port: &mut Port, is_all: impl Fn(&[u8]) -> bool) -> Vec<u8> {
    let mut got = Vec::new();
    wait_for("what our side says", || {
        let mut take = |input: Input<'_>| {
            if let Input::Bytes(bytes) = input {
                got.extend_from_slice(bytes);
            }
        };
        port.read(usize::MAX, &mut take).unwrap();
        is_all(&got)
    });
    got
}

/// Says it when a line would have brought all that was said before.
fn answer(port: &mut Port, bytes: &[u8]) {
    sleep(Duration::from_millis(10));
    assert_eq!(port.write(bytes).unwrap(), bytes.len());
}

/// Our own command on one side, a partner on the other: with the settings and the file that the
/// command was given, the record is a case, unchanged.
#[test]
fn a_live_session_is_a_case_as_it_was_recorded() {
    let bench = Bench::new();
    bench.write("telegram.bin", "LATHE\x10\x03 7");
    let plugin = ["--line", "9600 8E1", "--plugin", "r3964", "--set", "nak_at_start=off"];
    let options = [&plugin[..], &["--send", "telegram.bin", "--device", "a press"]].concat();
    let recording = Recording::start(&bench, ["pty:", "pty:"], 2, &options);
    let path = recording.ptys[0].clone();
    let mut partner = open(&recording.ptys[1]);
    let words = [&["send", "--port", &path, "--depth", "1"], &plugin[..], &["telegram.bin"]];
    let ours = bench.command(&words.concat()).spawn().unwrap();
    assert_eq!(hear(&mut partner, |got| !got.is_empty()), b"\x02");
    answer(&mut partner, b"\x10");
    // The end of a block: DLE, ETX, which stand in the data as DLE DLE ETX, and a check.
    let is_block = |got: &[u8]| {
        let end = got.windows(2).enumerate().rev().find(|(_, pair)| *pair == b"\x10\x03");
        end.is_some_and(|(at, _)| got.len() == at + 3 && at > 8)
    };
    let block = hear(&mut partner, is_block);
    assert_eq!(&block[..10], b"LATHE\x10\x10\x03 7");
    answer(&mut partner, b"\x10");
    let sent: Ran = ours.wait_with_output().unwrap().into();
    sent.with_code(0);
    recording.interrupt();
    let json = recording.end().with_code(0).json();
    assert_eq!(json["case"], true, "{json}");
    let (trace, _, sent) = trace(&bench);
    assert_eq!(sent, [b"\x02", &block[..]].concat());
    let text = trace.format();
    assert!(text.contains("\nconfig: nak_at_start=off\n"), "{text}");
    assert!(text.contains("\n? 0.000000 send 1 4C 41 54 48 45 10 03 20 37"), "{text}");
    assert!(text.contains(" done 1 sent=") && !text.contains("would have"), "{text}");
    bench.run(&["replay", "r3964", "s.spt"]).with_code(0);
    assert_eq!(bench.read("s.spt"), text.as_bytes());
}

/// The other way round nothing needs to be said: who receives is asked for nothing.
#[test]
fn what_our_side_received_is_a_case_with_the_plug_in_alone() {
    let bench = Bench::new();
    let plugin = ["--plugin", "xon-xoff", "--set", "quiet_time=500"];
    let recording = Recording::start(&bench, ["pty:", "pty:"], 2, &plugin);
    let path = recording.ptys[0].clone();
    let mut partner = open(&recording.ptys[1]);
    let words = [&["receive", "--port", &path, "--out", "O1.nc"], &plugin[..]].concat();
    let ours = bench.command(&words).stderr(std::process::Stdio::null()).spawn().unwrap();
    // It reads only when it is there: a pty keeps what came before.
    for part in [&b"%\nO1\n"[..], b"G1 X1\n", b"M30\n%\n"] {
        answer(&mut partner, part);
    }
    let received: Ran = ours.wait_with_output().unwrap().into();
    received.with_code(0);
    assert_eq!(bench.read("O1.nc"), b"%\nO1\nG1 X1\nM30\n%\n");
    recording.interrupt();
    let json = recording.end().with_code(0).json();
    assert_eq!(json["case"], true, "{json}");
    let text = String::from_utf8(bench.read("s.spt")).unwrap();
    assert!(text.contains("= ") && text.contains(" deliver 1 \"%\\nO1\\n"), "{text}");
    bench.run(&["replay", "xon-xoff", "s.spt"]).with_code(0);
}

#[test]
fn a_recording_ends_after_its_time_even_if_nothing_came() {
    let bench = Bench::new();
    let recording = Recording::start(&bench, ["pty:", "pty:"], 2, &["--duration", "1"]);
    let json = recording.end().with_code(0).json();
    assert_eq!((&json["result"], &json["a_to_b"]), (&"duration".into(), &0.into()));
    let (trace, ..) = trace(&bench);
    assert_eq!(trace.entries().count(), 1);
}

#[test]
fn what_cannot_be_recorded_is_refused() {
    let bench = Bench::new();
    bench.write("old.spt", "precious");
    let refused = |words: &str, code: i32, what: &str| {
        let words: Vec<_> = words.split(' ').collect();
        let ran = bench.run(&[&["record"], &words[..]].concat()).with_code(code);
        assert!(ran.err.contains(what), "{}", ran.err);
    };
    refused("--a pty: --b pty:", 2, "--out");
    refused("--a /dev/none --b /dev/none --out s.spt", 2, "the same port");
    refused("--a pty: --b COM3 --out s.spt", 2, "names no port");
    refused("--a pty: --b pty: --out old.spt", 2, "there already");
    refused("--a pty: --b pty: --out s.spt --id Lathe", 2, "an id is");
    refused("--a pty: --b pty: --out s.spt --device a,b", 2, "without commas");
    refused("--a pty: --b pty: --out s.spt --set xon=1", 2, "--plugin");
    refused("--a pty: --b pty: --out s.spt --plugin xon-xoff --set xon=999", 2, "xon");
    refused("--a pty: --b pty: --out s.spt --send old.spt", 2, "--plugin");
    refused("--a pty: --b pty: --out s.spt --plugin xon-xoff --send none.nc", 2, "none.nc");
    refused("--a pty: --b pty: --out s.spt --plugin xon-xoff --ask swap --redact", 2, "--redact");
    bench.write("bad.wasm", "no module");
    refused("--a pty: --b pty: --out s.spt --plugin bad.wasm", 3, "bad.wasm");
    refused("--a pty: --b /dev/none --out s.spt", 6, "there is no /dev/none");
    assert_eq!(bench.read("old.spt"), b"precious");
    assert_eq!(bench.names(), ["bad.wasm", "old.spt"]);
}
