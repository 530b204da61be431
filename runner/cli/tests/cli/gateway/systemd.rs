//! Under systemd: what its socket is told, its watchdog, a log for machines, and the unit itself.

use std::os::unix::net::UnixDatagram;

use rustix::process::Signal;
use serde_json::Value;

use super::{Gateway, HANG, bench, link, token};

/// The next message of which a line is this.
fn until_told(socket: &UnixDatagram, line: &str) -> String {
    let mut buffer = [0; 1_024];
    loop {
        let count = socket.recv(&mut buffer).unwrap_or_else(|error| panic!("{line}: {error}"));
        let said = String::from_utf8_lossy(&buffer[..count]).into_owned();
        if said.lines().any(|said| said == line) {
            return said;
        }
    }
}

#[test]
fn systemd_is_told_of_start_reload_and_stop_and_its_watchdog_is_tended() {
    let bench = bench(&link("lathe", "pty:"));
    token(&bench);
    let path = bench.path("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(HANG)).unwrap();
    let mut command = bench.command(&["gateway", "run", "gateway.toml", "--json"]);
    command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "200000");
    let gateway = Gateway::of(command);
    assert!(until_told(&socket, "READY=1").contains("STATUS=1 link"));
    until_told(&socket, "WATCHDOG=1");
    until_told(&socket, "WATCHDOG=1");
    gateway.signal(Signal::HUP);
    assert!(until_told(&socket, "RELOADING=1").contains("MONOTONIC_USEC="));
    until_told(&socket, "READY=1");
    gateway.signal(Signal::TERM);
    until_told(&socket, "STOPPING=1");
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");

    // One object a line, for machines.
    let lines: Vec<Value> = log
        .lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}")))
        .collect();
    assert!(lines.iter().any(|line| line["message"] == "the gateway has stopped"), "{log}");
    assert!(lines.iter().all(|line| line["level"].is_string() && line["timestamp"].is_string()));
}

mod needs_systemd_analyze {
    use std::path::Path;
    use std::process::Command;

    use crate::bench::Bench;

    #[test]
    fn the_unit_is_sound() {
        let unit =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/gateway/softplug.service");
        let unit = std::fs::read_to_string(unit).unwrap();
        // Installed elsewhere, and under a user that is not here.
        let unit = unit
            .replace("/usr/local/bin/softplug", env!("CARGO_BIN_EXE_softplug"))
            .replace("User=softplug\nGroup=softplug\n", "User=root\n");
        let bench = Bench::new();
        let path = bench.write("softplug.service", unit);
        let ran = Command::new("systemd-analyze").args(["verify", "--man=no"]).arg(path).output();
        let ran = ran.unwrap();
        let said = String::from_utf8_lossy(&ran.stderr);
        let ours = said.lines().filter(|line| line.contains("softplug.service"));
        assert!(ran.status.success() && ours.clone().count() == 0, "{said}");
    }
}
