//! The doctor over real ptys.
#![cfg(target_os = "linux")]

use std::net::TcpListener;
use std::path::Path;
use std::time::Duration;

use softplug_abi::{LineParameters, Parity};
use softplug_live::clock::Clock;
use softplug_live::device_server::DeviceServer;
use softplug_live::doctor::{COMMON_BAUDS, Severity, examine, examine_server, listen};
use softplug_live::poll::Poller;
use softplug_live::port::{TtyPort, line_text, parse_line};
use softplug_live::pty::PtyPair;
use softplug_live::suggest::suggest;
use softplug_live::{PortError, PortOptions, PortSpec};

use crate::net::machine::Machine;
use crate::net::port::rfc2217;

const PROGRAM: &[u8] = b"%\r\nO0001\r\nN10 G0 X10. Y-20.5\r\nN20 G1 Z-1.5 F200\r\nN30 M30\r\n%\r\n";

/// Parity made in software, as a pty's far end has to.
fn even(byte: u8) -> u8 {
    byte | ((byte.count_ones() as u8 & 1) << 7)
}

#[test]
fn a_free_port_is_found_usable() {
    let pair = PtyPair::open().unwrap();
    let line = parse_line("9600 7E1", LineParameters::new(9_600)).unwrap();
    let report = examine(pair.slave_path(), &PortOptions::new(line));
    assert!(report.is_usable(), "{report}");
    let us = std::process::id();
    assert!(report.holders.iter().any(|holder| holder.pid == us), "{report:?}");
    assert_eq!(report.modem_lines, None);
    assert_eq!(report.differences.len(), 2, "{report}");
    let notes = report.findings.iter().filter(|finding| finding.severity == Severity::Note);
    assert_eq!(notes.count(), 2, "{report}");
    assert_eq!(report.line_before.map(|line| line_text(&line)).as_deref(), Some("38400 8N1"));
    assert!(report.to_string().contains("ok: it has no modem lines\n"), "{report}");
}

#[test]
fn a_port_in_use_is_a_problem() {
    let pair = PtyPair::open().unwrap();
    let port = TtyPort::open(pair.slave_path(), &PortOptions::default()).unwrap();
    let report = examine(pair.slave_path(), &PortOptions::default());
    assert!(!report.is_usable(), "{report}");
    assert!(report.to_string().contains("is in use by"), "{report}");
    drop(port);
}

#[test]
fn what_is_no_port_is_a_problem() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().join("none"), folder.path().to_owned(), "/dev/null".into()] {
        let report = examine(&path, &PortOptions::default());
        assert!(!report.is_usable(), "{report}");
        assert_eq!(report.line_before, None);
    }
    let report = examine(Path::new("/dev/ttyNONE"), &PortOptions::default());
    assert!(report.to_string().starts_with("problem: there is no /dev/ttyNONE; "), "{report}");
}

#[test]
fn a_device_server_is_connected_to() {
    let options = PortOptions::default();
    let server = DeviceServer::start("127.0.0.1:0".parse().unwrap(), Machine::default()).unwrap();
    let report = examine_server(&rfc2217(server.address()), &options);
    assert!(report.is_usable(), "{report}");
    let said = "ok: a device server answers, speaks RFC 2217 ";
    assert!(report.to_string().starts_with(said), "{report}");

    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let raw = PortSpec::Tcp { host: "127.0.0.1".into(), port };
    let report = examine_server(&raw, &options);
    assert!(report.is_usable(), "{report}");
    assert!(report.to_string().starts_with("ok: it takes connections; "), "{report}");
    drop(listener);
    let report = examine_server(&raw, &options);
    assert!(!report.is_usable(), "{report}");
    assert!(report.to_string().starts_with("problem: no connection to 127.0.0.1:"), "{report}");
}

#[test]
fn parity_in_bit_seven_is_heard() {
    let pair = PtyPair::open().unwrap();
    let mut port = TtyPort::open(pair.slave_path(), &PortOptions::default()).unwrap();
    let mut poller = Poller::new(Clock::start()).unwrap();
    let bytes: Vec<_> = PROGRAM.iter().copied().map(even).collect();
    pair.write(&bytes).unwrap();
    let each = Duration::from_millis(200);
    let samples = listen(&mut port, &COMMON_BAUDS, each, &mut poller).unwrap();
    assert_eq!(samples.len(), 1, "a pty has no rate");
    assert_eq!(samples[0].good, bytes);
    let found = suggest(&samples);
    assert!(found[0].is_good());
    assert_eq!((found[0].line.data_bits, found[0].line.parity), (7, Parity::Even));
    assert_eq!(line_text(&found[0].line), "7E1");
}

#[test]
fn listening_ends_when_woken_or_when_the_port_goes() {
    let pair = PtyPair::open().unwrap();
    let mut port = TtyPort::open(pair.slave_path(), &PortOptions::default()).unwrap();
    let mut poller = Poller::new(Clock::start()).unwrap();
    let day = Duration::from_hours(24);
    poller.waker().wake();
    let samples = listen(&mut port, &COMMON_BAUDS, day, &mut poller).unwrap();
    assert_eq!(suggest(&samples), []);
    drop(pair);
    let error = listen(&mut port, &COMMON_BAUDS, day, &mut poller).unwrap_err();
    assert!(matches!(error, PortError::Gone(_)), "{error}");
}
