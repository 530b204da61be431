//! What cannot be done: one clear sentence, the right exit code, nothing
//! touched.

use crate::bench::{Bench, snapshot};

/// A bench with a program in it.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("O1.nc", "G1X1\n");
    bench.write("empty.nc", "");
    bench.write("folder/x", "");
    bench
}

/// Runs `softplug` with the words of `line`; its error, with the line before it.
fn refused(bench: &Bench, line: &str, code: i32) -> String {
    let words: Vec<_> = line.split(' ').collect();
    let ran = bench.run(&words).with_code(code);
    assert_eq!(ran.out, "", "{line}");
    format!("$ softplug {line}\n{}\n", ran.err)
}

#[test]
fn bad_arguments() {
    let bench = bench();
    let text: String = [
        "sent",
        "send",
        "send --port COM3 --plugin xon-xoff O1.nc",
        "send --port /dev/ttyUSB0 --line 8X1 --plugin xon-xoff O1.nc",
        "send --port /dev/ttyUSB0 --set xon --plugin xon-xoff O1.nc",
        "send --port /dev/ttyUSB0 --depth 0 --plugin xon-xoff O1.nc",
        "send --raw --port /dev/ttyUSB0 --plugin xon-xoff O1.nc",
        "simulate xon-xoff --low 600",
        "simulate xon-xoff --quiet-time 1",
        "doctor",
        "inspect xon-xoff -v -q",
    ]
    .iter()
    .map(|line| refused(&bench, line, 2))
    .collect();
    snapshot("bad-arguments", text);
    let json = bench.run(&["sent", "--json"]).with_code(2).json();
    assert_eq!(json["error"]["code"], 2);
    assert_eq!(json["error"]["message"], "unrecognized subcommand 'sent'");
    let json = bench.run(&["send", "--json"]).with_code(2).json();
    let message = json["error"]["message"].as_str().unwrap();
    assert!(message.ends_with("--port <PORT> --plugin <PLUGIN> <FILE>"), "{message}");
}

#[test]
fn bad_files() {
    let bench = bench();
    let text: String = ["none.nc", "folder", "empty.nc", "/dev/null"]
        .iter()
        .map(|file| refused(&bench, &format!("send --dry-run --plugin xon-xoff {file}"), 2))
        .collect();
    snapshot("bad-files", text);
}

/// Not read to an end that does not come.
#[cfg(unix)]
#[test]
fn files_without_an_end_are_too_long() {
    let bench = Bench::new();
    for line in [
        "replay xon-xoff /dev/zero",
        "certify xon-xoff --profile xon-xoff --baseline /dev/zero",
        "trace fmt /dev/zero",
    ] {
        let told = refused(&bench, line, 2);
        assert!(told.contains("more than"), "{told}");
    }
}

#[test]
fn bad_settings_are_found_before_the_port_is_touched() {
    let bench = bench();
    // This port would be another error, were it looked at.
    let send = "send --port /dev/none --plugin xon-xoff O1.nc --set";
    let text: String = [
        "colour=red",
        "xon=300",
        "xon=fast",
        "send_line_end=tab",
        "feed_start=1",
        "preset=best",
        "xoff=0x11",
    ]
    .iter()
    .map(|setting| refused(&bench, &format!("{send} {setting}"), 2))
    .collect();
    snapshot("bad-settings", text);
}

#[test]
fn the_first_thing_wrong_is_told() {
    let bench = bench();
    let check = |line: &str, code, what: &str| {
        let text = refused(&bench, line, code);
        assert!(text.contains(what), "{text}");
    };
    check("send --port ? --plugin none --set a=b none.nc", 2, "names no port");
    check("send --port /dev/none --plugin none --set a=b none.nc", 2, "none.nc");
    check("send --port /dev/none --plugin none --set a=b O1.nc", 2, "no plug-in \"none\"");
    check("send --port /dev/none --plugin xon-xoff --set a=b O1.nc", 2, "unknown setting");
}

#[cfg(target_os = "linux")]
#[test]
fn missing_ports_and_what_is_no_port() {
    let bench = bench();
    let line = |port: &str| format!("send --port {port} --plugin xon-xoff O1.nc");
    let mut text = refused(&bench, &line("/dev/none"), 6);
    text += &refused(&bench, &line("/dev/null"), 6);
    text += &refused(&bench, &line("./O1.nc"), 6);
    snapshot("bad-ports", text);
    // A port that nobody listens on: it was free a moment ago.
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    drop(server);
    let text = refused(&bench, &line(&format!("tcp://{address}")), 6);
    assert!(text.contains("no connection to 127.0.0.1"), "{text}");
    let json = bench.run(&["doctor", "/dev/none", "--json"]).with_code(6).json();
    assert_eq!(json["usable"], false);
}

#[cfg(target_os = "linux")]
#[test]
fn files_that_are_there_are_not_overwritten() {
    let bench = bench();
    bench.write("old.nc.partial", "half");
    let line = |out: &str| format!("receive --port /dev/none --plugin xon-xoff --out {out}");
    let text: String = ["O1.nc", "old.nc", "folder", "nowhere/O1.nc"]
        .iter()
        .map(|out| refused(&bench, &line(out), 2))
        .collect();
    snapshot("bad-outs", text);
    assert_eq!(bench.read("O1.nc"), b"G1X1\n");
    assert_eq!(bench.read("old.nc.partial"), b"half");
    // With --force the port is the next hurdle; nothing was lost on the way.
    refused(&bench, &line("O1.nc --force"), 6);
    refused(&bench, &line("old.nc --force"), 6);
    assert_eq!(bench.read("O1.nc"), b"G1X1\n");
    assert_eq!(bench.read("old.nc.partial"), b"half");
    assert_eq!(bench.names(), ["O1.nc", "empty.nc", "folder", "old.nc.partial"]);
}

#[test]
fn fields_are_checked_before_the_port_is_touched() {
    let bench = bench();
    let send = "send --port /dev/none --plugin r3964 --set layer=rk512";
    let text: String = [
        "--job write O1.nc",
        "--job wirte O1.nc",
        "--job write --field area=DB --field blok=5 O1.nc",
        "--job write --field area=DB --field block=many O1.nc",
        "--job write --field area=DB --field area=DX O1.nc",
        "--job write --field area O1.nc",
        "--job send",
        "--field colour=red O1.nc",
    ]
    .iter()
    .map(|words| refused(&bench, &format!("{send} {words}"), 2))
    .collect();
    snapshot("bad-fields", text);
}

#[cfg(target_os = "linux")]
#[test]
fn folders_are_checked_before_the_port_is_touched() {
    let bench = bench();
    let receive = "receive --port /dev/none --plugin r3964";
    let text: String = [
        "",
        " --dir nowhere",
        " --dir O1.nc",
        " --dir folder --programs nowhere",
        " --dir folder --force",
        " --out O2.nc --programs folder",
        " --out O2.nc --dir folder",
    ]
    .iter()
    .map(|words| refused(&bench, &format!("{receive}{words}"), 2))
    .collect();
    snapshot("bad-folders", text);
}

#[test]
fn simulations_that_cannot_be_are_refused() {
    let bench = bench();
    let text: String = [
        "simulate r3964 --fault nonsense",
        "simulate r3964 --fault cut=5@0",
        "simulate r3964 --memory DB5=64",
        "simulate r3964-simplified --rk512",
        "simulate fanuc-rs232 --reserve 300",
        "simulate fanuc-rs232 --press 1:dance",
        "simulate fanuc-rs232 --dc4 late",
    ]
    .iter()
    .map(|line| refused(&bench, line, 2))
    .collect();
    snapshot("bad-simulations", text);
}
