//! Transfers over ptys, in real time: against the simulated control, and
//! against a master in this process.

use std::io::Read as _;
use std::process::{Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_live::{Port, PortOptions, PortSpec};

use crate::bench::{Bench, Ran, program, snapshot};
use crate::simulation::{LINE, Simulation, alone, ended, interrupt, wait_for};

/// Reads from a pty's master until so many bytes have come.
fn read(pty: &PtyPair, count: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut buffer = [0; 4_096];
    wait_for("the data", || {
        while let ReadOutcome::Read(count) = pty.read(&mut buffer).unwrap() {
            bytes.extend_from_slice(&buffer[..count]);
        }
        bytes.len() >= count
    });
    bytes
}

fn slave(pty: &PtyPair) -> String {
    pty.slave_path().to_str().unwrap().to_owned()
}

#[test]
fn a_program_goes_to_a_control_that_holds_and_comes_back() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("O1.nc", program("surfacing.nc"));
    // Marks that leave room for all that a pty holds: no lateness of a busy
    // computer overflows it.
    let control = ["--baud", "921600", "--buffer", "32768", "--low", "32000", "--high", "32400"];
    let once = ["--rate", "20000", "--once", "--quiet-time", "3"];
    let expect = ["--expect", "O1.nc", "--out", "got.nc"];
    let simulation = Simulation::start(&bench, &[&control[..], &once, &expect].concat());
    let send = ["send", "--port", &simulation.port, "--plugin", "xon-xoff", "O1.nc", "--json"];
    let sent = bench.run(&[&send[..], &LINE].concat()).with_code(0).json();
    assert_eq!((&sent["result"], &sent["bytes"]), (&"done".into(), &40_000.into()));
    assert!(sent["holds"].as_u64().unwrap() > 0, "{sent}");
    assert!(sent["held_seconds"].as_f64().unwrap() > 0.0, "{sent}");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (0, &true.into()), "{report}");
    assert_eq!((&report["alarms"], &report["received"]), (&0.into(), &40_000.into()));
    assert_eq!(bench.read("got.nc"), bench.read("O1.nc"));

    let punch = ["--baud", "921600", "--punch", "got.nc", "--once"];
    let simulation = Simulation::start(&bench, &punch);
    let receive = ["receive", "--port", &simulation.port, "--plugin", "xon-xoff", "--json"];
    let more = ["--out", "back.nc", "--set", "quiet_time=3000", "--set", "xon_at_open=on"];
    let ran = bench.run(&[&receive[..], &more, &LINE].concat()).with_code(0);
    assert_eq!(ran.json()["result"], "complete", "{ran}");
    assert_eq!(ran.json()["bytes"], 40_000);
    assert_eq!(bench.read("back.nc"), bench.read("O1.nc"));
    assert!(!bench.path("back.nc.partial").exists());
    let (code, report) = simulation.end();
    assert_eq!((code, &report["punched"]), (0, &40_000.into()), "{report}");
}

#[test]
fn a_control_that_got_something_else_says_so() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("O1.nc", "G1X1\n");
    bench.write("O2.nc", "G1X2\n");
    let options = ["--baud", "921600", "--expect", "O2.nc", "--once", "--quiet-time", "2"];
    let simulation = Simulation::start(&bench, &options);
    let send = ["send", "--port", &simulation.port, "--plugin", "native:xon-xoff", "O1.nc"];
    let ran = bench.run(&[&send[..], &LINE].concat()).with_code(0);
    assert!(ran.out.starts_with("sent 5 bytes in "), "{ran}");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (1, &false.into()), "{report}");
}

#[test]
fn ctrl_c_aborts_a_sending_in_the_middle() {
    let bench = Bench::new();
    bench.write("O1.nc", program("surfacing.nc"));
    let pty = PtyPair::open().unwrap();
    let send = ["send", "--port", &slave(&pty), "--plugin", "xon-xoff", "O1.nc", "--json"];
    let child = bench.command(&send).spawn().unwrap();
    read(&pty, 10);
    pty.write(&[0x13]).unwrap();
    interrupt(&child);
    let json = ended(child).with_code(5).json();
    assert_eq!(json["result"], "aborted", "{json}");
}

#[test]
fn a_file_is_sent_as_it_was_when_the_command_began() {
    let bench = Bench::new();
    let text = program("surfacing.nc");
    bench.write("O1.nc", &text);
    let pty = PtyPair::open().unwrap();
    let send = ["send", "--port", &slave(&pty), "--plugin", "xon-xoff", "O1.nc", "--json"];
    let child = bench.command(&[&send[..], &LINE].concat()).spawn().unwrap();
    let mut got = read(&pty, 10);
    // The control holds, and somebody saves another program under this name.
    pty.write(&[0x13]).unwrap();
    std::fs::write(bench.path("O1.nc"), "M30\n").unwrap();
    pty.write(&[0x11]).unwrap();
    got.extend(read(&pty, text.len() - got.len()));
    let json = ended(child).with_code(0).json();
    assert_eq!((&json["result"], &json["sent"]), (&"done".into(), &text.len().into()), "{json}");
    assert!(got == text, "what arrived is not what the file was");
}

#[test]
fn a_file_that_is_being_written_is_not_sent() {
    let bench = Bench::new();
    // Its length never fits what is read of it.
    let send = ["send", "--dry-run", "--plugin", "xon-xoff", "/proc/self/status"];
    let ran = bench.run(&send).with_code(2);
    let said = "/proc/self/status is being written: try again when that has ended";
    assert!(ran.err.contains(said), "{ran}");
}

#[test]
fn a_terminal_that_closes_aborts_as_ctrl_c_does() {
    let bench = Bench::new();
    bench.write("O1.nc", program("surfacing.nc"));
    let pty = PtyPair::open().unwrap();
    let send = ["send", "--port", &slave(&pty), "--plugin", "xon-xoff", "O1.nc", "--json"];
    let child = bench.command(&send).spawn().unwrap();
    read(&pty, 10);
    pty.write(&[0x13]).unwrap();
    // The shell sends it, and the kernel when the shell has ended.
    let pid = Pid::from_child(&child);
    kill_process(pid, Signal::HUP).unwrap();
    kill_process(pid, Signal::HUP).unwrap();
    let json = ended(child).with_code(5).json();
    assert_eq!(json["result"], "aborted", "{json}");

    let simulation = Simulation::start(&bench, &[]);
    kill_process(Pid::from_child(&simulation.child), Signal::HUP).unwrap();
    let (code, report) = simulation.end();
    assert_eq!((code, &report["result"]), (0, &"done".into()), "{report}");
}

#[test]
fn under_nohup_a_terminal_may_close() {
    let bench = Bench::new();
    bench.write("O1.nc", "G1X1\n".repeat(40));
    let pty = PtyPair::open().unwrap();
    let send = ["send", "--port", &slave(&pty), "--plugin", "xon-xoff", "O1.nc", "--json"];
    let asked = bench.command(&send);
    let mut child = Command::new("sh");
    // As nohup does it.
    child.args(["-c", "trap '' HUP; exec \"$0\" \"$@\""]).arg(asked.get_program());
    child.args(asked.get_args()).current_dir(asked.get_current_dir().unwrap());
    child.envs(asked.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let child = child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let got = read(&pty, 10);
    kill_process(Pid::from_child(&child), Signal::HUP).unwrap();
    let rest = read(&pty, 200 - got.len());
    assert_eq!(got.len() + rest.len(), 200);
    let json = ended(child).with_code(0).json();
    assert_eq!(json["result"], "done", "{json}");
}

#[test]
fn ctrl_c_keeps_what_was_received() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--out", "O1.nc"];
    let child = bench.command(&receive).spawn().unwrap();
    pty.write(b"G1X1\nG1X2\n").unwrap();
    let partial = bench.path("O1.nc.partial");
    wait_for("the data", || std::fs::read(&partial).is_ok_and(|bytes| bytes.len() == 10));
    interrupt(&child);
    let ran = ended(child).with_code(5);
    snapshot("receive-aborted", ran);
    assert_eq!(bench.names(), ["O1.nc.failed"]);
    assert_eq!(bench.read("O1.nc.failed"), b"G1X1\nG1X2\n");
}

#[test]
fn ctrl_c_in_the_middle_of_a_delivery_into_a_folder_ends_as_into_a_file() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--dir", "."];
    let child = bench.command(&[&receive[..], &["--json"]].concat()).spawn().unwrap();
    pty.write(b"G1X1\n").unwrap();
    let partial = bench.path("delivery.partial");
    wait_for("the data", || std::fs::read(&partial).is_ok_and(|bytes| bytes.len() == 5));
    interrupt(&child);
    let ran = ended(child).with_code(5);
    let end = lines(&ran).pop().unwrap();
    assert_eq!((&end["result"], &end["failed"]), (&"aborted".into(), &1.into()), "{ran}");
    assert_eq!(bench.read("000001.failed"), b"G1X1\n");
}

#[test]
fn ctrl_c_before_anything_came_leaves_nothing() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--out", "O1.nc"];
    let child = bench.command(&receive).spawn().unwrap();
    wait_for("the file", || bench.path("O1.nc.partial").exists());
    interrupt(&child);
    ended(child).with_code(5);
    assert_eq!(bench.names(), Vec::<String>::new());
}

#[test]
fn a_port_that_goes_away_is_told_and_what_came_is_kept() {
    let bench = Bench::new();
    bench.write("O1.nc", program("surfacing.nc"));
    let pty = PtyPair::open().unwrap();
    let send = ["send", "--port", &slave(&pty), "--plugin", "xon-xoff", "O1.nc"];
    let child = bench.command(&send).spawn().unwrap();
    read(&pty, 10);
    drop(pty);
    let ran = ended(child).with_code(6);
    assert!(ran.err.contains("the port is gone or the connection is closed"), "{ran}");

    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--out", "O2.nc"];
    let child = bench.command(&receive).spawn().unwrap();
    pty.write(b"G1X1\n").unwrap();
    let partial = bench.path("O2.nc.partial");
    wait_for("the data", || std::fs::read(&partial).is_ok_and(|bytes| bytes.len() == 5));
    drop(pty);
    let ran = ended(child).with_code(6);
    assert!(ran.err.contains("O2.nc.failed"), "{ran}");
    assert_eq!(bench.read("O2.nc.failed"), b"G1X1\n");
    assert!(!bench.path("O2.nc").exists());
}

#[test]
fn a_reception_without_its_end_mark_fails_and_is_kept() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let settings = ["--set", "end_mark=25", "--set", "quiet_time=200"];
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--out", "O1.nc"];
    let child = bench.command(&[&receive[..], &settings].concat()).spawn().unwrap();
    pty.write(b"G1X1\n").unwrap();
    let ran = ended(child).with_code(1);
    snapshot("receive-failed", ran);
    assert_eq!(bench.names(), ["O1.nc.failed"]);

    // The next attempt overwrites nothing.
    let child = bench.command(&[&receive[..], &settings].concat()).spawn().unwrap();
    pty.write(b"G1X2\n%").unwrap();
    let ran = ended(child).with_code(0);
    assert!(ran.out.starts_with("received 6 bytes in "), "{ran}");
    assert_eq!(bench.names(), ["O1.nc", "O1.nc.failed"]);
    assert_eq!(bench.read("O1.nc"), b"G1X2\n%");
}

#[test]
fn a_reception_that_never_begins_is_given_up() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--out", "O1.nc"];
    let ran = bench.run(&[&receive[..], &["--wait", "1"]].concat()).with_code(5);
    assert!(ran.err.starts_with("waiting for the machine to send: "), "{ran}");
    assert!(ran.err.ends_with("error: nothing came in the time given\n"), "{ran}");
    assert_eq!(bench.names(), Vec::<String>::new());
}

#[test]
fn a_program_goes_over_a_device_server() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("O1.nc", program("drilling.nc"));
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp://{}", server.local_addr().unwrap());
    let send = ["send", "--port", &port, "--plugin", "xon-xoff", "O1.nc", "--quiet"];
    let child = bench.command(&[&send[..], &LINE].concat()).spawn().unwrap();
    let mut got = Vec::new();
    server.accept().unwrap().0.read_to_end(&mut got).unwrap();
    let ran = ended(child).with_code(0);
    assert_eq!(ran.err, "");
    assert_eq!(got, bench.read("O1.nc"));
}

#[test]
fn a_port_in_use_is_told_with_its_holder() {
    let bench = Bench::new();
    bench.write("O1.nc", "G1X1\n");
    let pty = PtyPair::open().unwrap();
    let spec = PortSpec::Device(pty.slave_path().to_owned());
    let _port = Port::open(&spec, &PortOptions::default()).unwrap();
    let ran = bench.run(&["send", "--port", &slave(&pty), "--plugin", "xon-xoff", "O1.nc"]);
    let ran = ran.with_code(6);
    assert!(ran.err.contains("is in use by"), "{ran}");
    assert!(ran.err.contains(&format!("process {}", std::process::id())), "{ran}");
}

#[test]
fn the_doctor_hears_what_comes() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    pty.write(&program("turning.nc")).unwrap();
    let doctor = ["doctor", &slave(&pty), "--listen", "1", "--json"];
    let json = bench.run(&doctor).with_code(0).json();
    assert_eq!(json["usable"], true, "{json}");
    assert!(json["heard"].is_array(), "{json}");
    let ran = bench.run(&["doctor", &slave(&pty)]).with_code(0);
    assert!(ran.out.starts_with("ok: "), "{ran}");
}

#[test]
fn the_doctor_says_whether_a_device_server_answers() {
    let bench = Bench::new();
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp://{}", server.local_addr().unwrap());
    let json = bench.run(&["doctor", &port, "--json"]).with_code(0).json();
    assert_eq!((&json["usable"], &json["port"]), (&true.into(), &(&*port).into()), "{json}");
    let ran = bench.run(&["doctor", &port, "--listen", "1"]).with_code(2);
    assert!(ran.err.contains("at a port of this computer only"), "{ran}");
    drop(server);
    let ran = bench.run(&["doctor", &port]).with_code(6);
    assert!(ran.out.starts_with("problem: no connection to 127.0.0.1:"), "{ran}");
    let ran = bench.run(&["doctor", "unit://127.0.0.1:7640/lathe"]).with_code(2);
    assert!(ran.err.contains("names no port"), "{ran}");
}

#[test]
fn the_doctor_does_not_name_itself() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    // On a console its own streams are the port.
    let console = || std::fs::File::options().read(true).write(true).open(slave(&pty)).unwrap();
    let mut doctor = bench.command(&["doctor", &slave(&pty), "--json"]);
    let doctor = doctor.stdin(console()).spawn().unwrap();
    let pid = doctor.id();
    let json = ended(doctor).json();
    let holders = json["holders"].as_array().unwrap();
    assert!(holders.iter().any(|holder| holder["pid"] == std::process::id()), "{json}");
    assert!(holders.iter().all(|holder| holder["pid"] != pid), "{json}");
    // Its own standard input, which half of all programs have open too.
    let ran = bench.run(&["doctor", "/dev/null"]).with_code(6);
    assert_eq!(
        ran.out,
        "problem: /dev/null is not a serial port; give a device such as /dev/ttyUSB0\n"
    );
}

#[test]
fn the_demonstration_goes_all_the_way() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("traces/xon-xoff/xon-xoff.tx.first.spt", crate::files::TRACE);
    let demo = ["demo", "--bytes", "30000", "--traces", "traces"];
    let ran = bench.run(&demo).with_code(0);
    // A part is shown again where this computer was too busy for it; half of it may have
    // gone well.
    let again = ran.err.matches("once more").count();
    assert!((8..=8 + again).contains(&ran.out.matches("Identical").count()), "{ran}");
    assert!(ran.out.contains("All passed"), "{ran}");
}

fn lines(ran: &Ran) -> Vec<Value> {
    ran.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn blocks_come_into_a_folder_over_a_faulty_line() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("blocks.bin", (0..=255).collect::<Vec<u8>>());
    bench.write("in/000001", "theirs");
    let options = ["--baud", "115200", "--send", "blocks.bin", "--block-size", "100"];
    let faults = ["--fault", "wrong-check@2", "--send-after", "3", "--once", "--quiet-time", "1"];
    let simulation = Simulation::of("r3964", &bench, &[&options[..], &faults].concat());
    let receive = ["receive", "--port", &simulation.port, "--plugin", "r3964", "--dir", "in"];
    let patient = ["--set", "zvz=20000", "--count", "3", "--json"];
    let ran = bench.run(&[&receive[..], &LINE, &patient].concat()).with_code(0);
    let end = lines(&ran).pop().unwrap();
    assert_eq!((&end["event"], &end["complete"]), (&"end".into(), &3.into()), "{ran}");
    let got = ["in/000002", "in/000003", "in/000004"].map(|name| bench.read(name));
    assert_eq!(got.concat(), bench.read("blocks.bin"));
    assert_eq!(bench.read("in/000001"), b"theirs");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["blocks_sent"], &report["repetitions"]), (0, &3.into(), &1.into()));
}

#[test]
fn an_area_is_written_and_read_by_rk512() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("words.bin", [0x12, 0x34, 0x10, 0x03]);
    let options = ["--baud", "115200", "--rk512", "--memory", "DB5=64"];
    let simulation = Simulation::of("r3964", &bench, &options);
    let job = |words: &[&str], code| {
        let send = ["send", "--port", &simulation.port, "--plugin", "r3964", "--json"];
        let area = ["--set", "layer=rk512", "--field", "area=DB", "--field", "block=5"];
        let offset = ["--field", "offset=10"];
        bench.run(&[&send[..], &LINE, &area, &offset, words].concat()).with_code(code)
    };
    job(&["--job", "write", "words.bin"], 0);
    let read = ["--job", "read", "--field", "count=2"];
    let ran = job(&[&read[..], &["--out", "back.bin"]].concat(), 0);
    assert_eq!(ran.json()["answered"], 4, "{ran}");
    assert_eq!(bench.read("back.bin"), bench.read("words.bin"));
    let shown = job(&read, 0).json();
    assert_eq!(shown["answer"], "12341003", "{shown}");
    // A block that is not there: nothing is left of the answer.
    let refused = [&read[..], &["--out", "none.bin"]].concat();
    let send = ["send", "--port", &simulation.port, "--plugin", "r3964", "--json"];
    let fields = ["--set", "layer=rk512", "--field", "area=DB", "--field", "block=6"];
    let words = [&send[..], &LINE, &fields, &refused].concat();
    let ran = bench.run(&words).with_code(1);
    assert_eq!(ran.json()["failure"], "not-found", "{ran}");
    assert_eq!(bench.names(), ["back.bin", "words.bin"]);
    interrupt(&simulation.child);
    let (code, report) = simulation.end();
    assert_eq!((code, &report["commands_refused"]), (0, &1.into()), "{report}");
}

#[test]
fn an_operator_asks_for_programs_at_the_panel() {
    let _alone = alone();
    let bench = Bench::new();
    let program = "%\nO1234\nG1 X1\nM30\n%\n";
    bench.write("programs/O1234.nc", program);
    bench.write("secret.nc", program);
    bench.write("in/O1234", "theirs");
    let press = [
        "--press",
        "0.3:punch=programs/O1234.nc",
        "--press",
        "1.5:request=../secret",
        "--press",
        "2.5:reset",
    ];
    let more = ["--press", "3:request=1234", "--once", "--quiet-time", "1.5"];
    let expect = ["--baud", "9600", "--expect", "programs/O1234.nc"];
    let simulation = Simulation::of("fanuc-rs232", &bench, &[&press[..], &more, &expect].concat());
    let receive = ["receive", "--port", &simulation.port, "--plugin", "fanuc-rs232"];
    let folders = ["--dir", "in", "--programs", "programs", "--wait", "3", "--json"];
    let line = ["--line", "9600 8N2"];
    let ran = bench.run(&[&receive[..], &line, &folders].concat());
    let lines = lines(&ran);
    let of = |event: &'static str| lines.iter().filter(move |line| line["event"] == event);
    let requests: Vec<_> = of("request")
        .map(|line| (line["fields"]["name"].clone(), line["refused"].clone()))
        .collect();
    let expected = [("../secret".into(), "not-found".into()), ("1234".into(), Value::Null)];
    assert_eq!(requests, expected, "{ran}");
    assert_eq!(of("job").map(|line| &line["result"]).collect::<Vec<_>>(), ["done"], "{ran}");
    assert_eq!(bench.read("in/O1234-2"), program.as_bytes());
    assert_eq!(bench.read("in/O1234"), b"theirs");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (0, &true.into()), "{report}");
}

/// The block "A", and the partner's "XY".
const OURS: [u8; 4] = [b'A', 0x10, 0x03, 0x52];
const THEIRS: [u8; 5] = [b'X', b'Y', 0x10, 0x03, 0x12];

/// Sends "A" to a partner that begins at the same time with "XY", and says what is to be said.
fn in_conflict(bench: &Bench, more: &[&str], says: &[(usize, &[u8])]) -> Ran {
    bench.write("block.bin", "A");
    let pty = PtyPair::open().unwrap();
    let send = ["send", "--port", &slave(&pty), "--plugin", "r3964", "--json", "block.bin"];
    let quiet = ["--set", "nak_at_start=off", "--set", "zvz=20000", "--set", "qvz=20000"];
    let child = bench.command(&[&send[..], &quiet, more].concat()).spawn().unwrap();
    let mut heard = Vec::new();
    for (count, answer) in says {
        heard.extend(read(&pty, *count));
        pty.write(answer).unwrap();
    }
    let expected: &[u8] = if more.is_empty() { &[2, 0x15, 2] } else { &[2, 0x10, 0x10, 2] };
    assert_eq!(heard, [expected, &OURS].concat());
    ended(child).with_code(0)
}

#[test]
fn what_a_partner_sends_meanwhile_is_refused_or_kept_and_never_dropped() {
    let _alone = alone();
    let bench = Bench::new();
    let refused = in_conflict(&bench, &[], &[(1, &[2]), (2, &[0x10]), (4, &[0x10])]);
    assert_eq!((&refused.json()["refused"], &refused.json()["received"]), (&1.into(), &0.into()));
    assert!(refused.err.contains("wanted to send meanwhile, 1 time"), "{refused}");

    std::fs::create_dir(bench.path("in")).unwrap();
    let says: [(usize, &[u8]); 4] = [(1, &[2]), (1, &THEIRS), (2, &[0x10]), (4, &[0x10])];
    let kept = in_conflict(&bench, &["--keep", "in"], &says).json();
    assert_eq!((&kept["refused"], &kept["kept"][0]["bytes"]), (&0.into(), &2.into()));
    assert_eq!(kept["kept"][0]["file"], "in/000001");
    assert_eq!(bench.read("in/000001"), b"XY");
}

#[test]
fn fewer_deliveries_than_were_asked_for_are_not_done() {
    let _alone = alone();
    let bench = Bench::new();
    std::fs::create_dir(bench.path("in")).unwrap();
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--dir", "in"];
    let more = ["--count", "3", "--wait", "1", "--set", "quiet_time=200", "--json"];
    let child = bench.command(&[&receive[..], &more].concat()).spawn().unwrap();
    pty.write(b"G1X1\n").unwrap();
    let ran = ended(child).with_code(5);
    let end = lines(&ran).pop().unwrap();
    assert_eq!((&end["result"], &end["complete"]), (&"incomplete".into(), &1.into()), "{ran}");
    assert_eq!(end["heard"], 5);
}

#[test]
fn what_comes_without_a_name_gets_the_one_that_stands_in_it() {
    let _alone = alone();
    let bench = Bench::new();
    std::fs::create_dir(bench.path("in")).unwrap();
    bench.write("in/SHAFT 7", "theirs");
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "xon-xoff", "--dir", "in"];
    let more = ["--count", "1", "--set", "quiet_time=200", "--json"];
    let child = bench.command(&[&receive[..], &more].concat()).spawn().unwrap();
    pty.write(b"%\nO<SHAFT 7>\nM30\n%\n").unwrap();
    let ran = ended(child).with_code(0);
    let delivery = lines(&ran).into_iter().find(|line| line["event"] == "delivery").unwrap();
    assert_eq!((&delivery["file"], &delivery["name"]), (&"in/SHAFT 7-2".into(), &"SHAFT 7".into()));
    assert_eq!(bench.read("in/SHAFT 7-2"), b"%\nO<SHAFT 7>\nM30\n%\n");
}

#[test]
fn an_operator_gets_the_program_whose_text_says_the_name() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("programs/flange.nc", "%\nO1234 (FLANGE)\nG1 X1\nM30\n%\n");
    std::fs::create_dir(bench.path("in")).unwrap();
    let press = ["--press", "0.3:request=1234", "--once", "--quiet-time", "1.5"];
    let expect = ["--baud", "9600", "--expect", "programs/flange.nc"];
    let simulation = Simulation::of("fanuc-rs232", &bench, &[&press[..], &expect].concat());
    let receive = ["receive", "--port", &simulation.port, "--plugin", "fanuc-rs232"];
    let folders = ["--dir", "in", "--programs", "programs", "--wait", "3", "--json"];
    let ran = bench.run(&[&receive[..], &["--line", "9600 8N2"], &folders].concat());
    let jobs: Vec<_> = lines(&ran).into_iter().filter(|line| line["event"] == "job").collect();
    assert_eq!(jobs.len(), 1, "{ran}");
    assert_eq!(jobs[0]["result"], "done", "{ran}");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (0, &true.into()), "{report}");
}

#[test]
fn characters_that_begin_no_program_are_told() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let receive = ["receive", "--port", &slave(&pty), "--plugin", "fanuc-rs232", "--wait", "1"];
    let child = bench.command(&[&receive[..], &["--out", "O1.nc"]].concat()).spawn().unwrap();
    pty.write(b"%\nO1\nM30\n%\n").unwrap();
    let ran = ended(child).with_code(5);
    let said = "11 bytes came in the time given, but nothing that begins a program of FANUC RS-232";
    assert!(ran.err.contains(said), "{ran}");
}

#[test]
fn a_plug_ins_own_line_is_taken_and_told() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let carried = "; a pty carries 8 data bits and no parity: it is neither made nor looked at\n";
    let told = |plugin: &str, more: &[&str]| {
        let port = slave(&pty);
        let words = ["receive", "--port", &port, "--plugin", plugin, "--out", "O1.nc"];
        bench.run(&[&words[..], &["--wait", "1"], more].concat()).with_code(5).err
    };
    let fanuc = told("fanuc-rs232", &[]);
    assert!(
        fanuc.starts_with(&format!("note: the line is 4800 7E2, as the plug-in names it{carried}")),
        "{fanuc}"
    );
    let rated = told("fanuc-rs232", &["--line", "19200"]);
    assert!(rated.starts_with(&format!("note: the line is 19200 7E2{carried}")), "{rated}");
    let eia = told("fanuc-rs232", &["--set", "preset=eia"]);
    assert!(eia.starts_with("note: the line is 4800 8N2, as the plug-in names it\n"), "{eia}");
    let plain = told("fanuc-rs232", &["--line", "9600 8N1"]);
    assert!(!plain.contains("the line is"), "{plain}");
    // It names none, and of a pty there is nothing to say.
    let nothing = told("xon-xoff", &[]);
    assert!(nothing.starts_with("waiting for the machine to send: "), "{nothing}");
    assert!(nothing.ends_with("error: nothing came in the time given\n"), "{nothing}");

    let ran = bench.run(&["inspect", "fanuc-rs232"]).with_code(0);
    let line = "\nline      4800 7E2, 4800 8N2 with parity=software, 4800 8N2 with parity=none, \
                4800 8N2 with code=eia\n";
    assert!(ran.out.contains(line), "{ran}");
    let json = bench.run(&["inspect", "fanuc-rs232", "--json"]).with_code(0).json();
    assert_eq!((&json["abi"], &json["manifest"]["line"]), (&"1.1".into(), &"4800 7E2".into()));
}
