//! Ports over real ptys and real sockets.
#![cfg(target_os = "linux")]

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener};
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::thread;

use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{InputModes, LocalModes, OptionalActions, tcgetattr, tcsetattr};
use softplug_abi::{LineParameters, LinkDownReason, Micros, ModemLines, Parity};
use softplug_live::clock::Clock;
use softplug_live::poll::{Interest, Poller};
use softplug_live::port::parse_line;
use softplug_live::pty::PtyPair;
use softplug_live::{Input, Port, PortError, PortOptions, PortSpec, ReadOutcome};

fn options(line: &str) -> PortOptions {
    PortOptions::new(parse_line(line, LineParameters::new(9_600)).unwrap())
}

fn device(path: &Path) -> PortSpec {
    PortSpec::Device(path.to_owned())
}

fn open_slave(pair: &PtyPair) -> Port {
    Port::open(&device(pair.slave_path()), &options("9600 8N1")).unwrap()
}

/// So long that only a lost byte or event makes a test wait for it.
const NEVER: Micros = Micros::from_secs(30);

/// Reads until `count` bytes are there.
fn read_bytes(port: &mut Port, count: usize) -> Vec<u8> {
    let mut poller = Poller::new(Clock::start()).unwrap();
    let mut got = Vec::new();
    while got.len() < count {
        let ready = poller.wait(Some(&port.fd()), Interest::READ, Some(NEVER)).unwrap();
        assert!(!ready.timer, "nothing follows {got:?}");
        let outcome = port.read(usize::MAX, &mut |input| match input {
            Input::Bytes(bytes) => got.extend_from_slice(bytes),
            Input::LineError { kind, .. } => panic!("a pty has no {kind}"),
        });
        if let ReadOutcome::Gone(reason) = outcome.unwrap() {
            panic!("{reason} after {got:?}");
        }
    }
    got
}

fn wait_gone(port: &mut Port) -> LinkDownReason {
    let mut poller = Poller::new(Clock::start()).unwrap();
    loop {
        let ready = poller.wait(Some(&port.fd()), Interest::READ, Some(NEVER)).unwrap();
        assert!(!ready.timer, "the port stays");
        if let ReadOutcome::Gone(reason) = port.read(usize::MAX, &mut |_| {}).unwrap() {
            return reason;
        }
    }
}

#[test]
fn every_byte_passes_a_pty_both_ways() {
    let pair = PtyPair::open().unwrap();
    let mut port = open_slave(&pair);
    let all: Vec<u8> = (0..=255).chain([0xFF, 0xFF, 0, 0, 0xFF, 0, 0x55]).collect();
    assert_eq!(pair.write(&all).unwrap(), all.len());
    assert_eq!(read_bytes(&mut port, all.len()), all);
    assert_eq!(port.read(usize::MAX, &mut |_| {}).unwrap(), ReadOutcome::Empty);

    assert_eq!(port.write(&all).unwrap(), all.len());
    let mut back = Port::Pty(softplug_live::pty::PtyPort::new(pair, port.line()));
    assert_eq!(read_bytes(&mut back, all.len()), all);
}

#[test]
fn bytes_that_came_before_opening_are_not_lost() {
    let pair = PtyPair::open().unwrap();
    // These are not doubled by the kernel: nobody asked for marks yet.
    let early = [0x11, 0xFF, 0xFF, 0x00, b'%'];
    pair.write(&early).unwrap();
    let flags = OFlags::RDONLY | OFlags::NOCTTY | OFlags::CLOEXEC;
    let watch = open(pair.slave_path(), flags, Mode::empty()).unwrap();
    let mut poller = Poller::new(Clock::start()).unwrap();
    assert!(poller.wait(Some(&watch.as_fd()), Interest::READ, Some(NEVER)).unwrap().readable);
    let mut port = open_slave(&pair);
    pair.write(&[0xFF]).unwrap();
    assert_eq!(read_bytes(&mut port, 6), [&early[..], &[0xFF]].concat());
}

#[test]
fn a_closed_master_is_an_unplugged_port() {
    let pair = PtyPair::open().unwrap();
    let mut port = open_slave(&pair);
    let mut poller = Poller::new(Clock::start()).unwrap();
    drop(pair);
    assert!(poller.wait(Some(&port.fd()), Interest::READ, Some(NEVER)).unwrap().hangup);
    assert_eq!(wait_gone(&mut port), LinkDownReason::Unplugged);
    let error = port.write(b"G0").unwrap_err();
    assert!(matches!(error, PortError::Gone(LinkDownReason::Unplugged)), "{error}");
}

#[test]
fn a_port_in_use_names_its_holder() {
    let pair = PtyPair::open().unwrap();
    let first = open_slave(&pair);
    let error = Port::open(&device(pair.slave_path()), &options("9600")).unwrap_err();
    let PortError::InUse { holders, .. } = &error else { panic!("{error}") };
    assert!(holders.iter().any(|holder| holder.pid == std::process::id()), "{error}");
    assert!(error.to_string().contains(&std::process::id().to_string()));
    drop(first);
    open_slave(&pair);
}

#[test]
fn a_full_port_takes_nothing_and_never_blocks() {
    let pair = PtyPair::open().unwrap();
    let mut port = open_slave(&pair);
    let block = [b'X'; 4_096];
    let mut taken = 0;
    loop {
        match port.write(&block).unwrap() {
            0 => break,
            count => taken += count,
        }
    }
    assert!(taken > 4_096, "{taken}");
    // Discarding makes room again; dropping a full port returns.
    port.discard_output().unwrap();
    assert_eq!(port.write(b"Y").unwrap(), 1);
    while port.write(&block).unwrap() > 0 {}
    drop(port);
    let mut poller = Poller::new(Clock::start()).unwrap();
    assert!(poller.wait(Some(&pair.as_fd()), Interest::READ, Some(NEVER)).unwrap().readable);
    assert!(matches!(pair.read(&mut [0; 16]).unwrap(), ReadOutcome::Read(_)));
}

#[test]
fn what_was_written_before_closing_is_read_afterwards() {
    let pair = PtyPair::open().unwrap();
    let mut port = open_slave(&pair);
    assert_eq!(port.write(b"M30\r\n%").unwrap(), 6);
    drop(port);
    let mut back = Port::Pty(softplug_live::pty::PtyPort::new(pair, LineParameters::new(9_600)));
    assert_eq!(read_bytes(&mut back, 6), b"M30\r\n%");
}

#[test]
fn settings_that_a_port_does_not_take_are_reported() {
    let pair = PtyPair::open().unwrap();
    let port = Port::open(&device(pair.slave_path()), &options("4800 7E2")).unwrap();
    let differences: Vec<_> = port.differences().iter().map(ToString::to_string).collect();
    assert_eq!(
        differences,
        ["data bits: asked for 7, the port has 8", "parity: asked for even, the port has none"]
    );
    // Time and parity go by what the far end was said to do.
    assert_eq!(port.line().half_bits(), 22);
    assert!(!port.rate_known());
    assert!(!port.makes_parity());
    assert!(Port::open(&PortSpec::Pty, &options("9600 8N1")).unwrap().makes_parity());
}

#[test]
fn a_pty_has_no_modem_lines_no_break_and_no_queue() {
    let pair = PtyPair::open().unwrap();
    let mut port = open_slave(&pair);
    assert_eq!(port.modem_lines(), None);
    let error = port.set_modem_lines(ModemLines::RTS, ModemLines::RTS).unwrap_err();
    assert_eq!(
        error.to_string(),
        "this port cannot set modem lines; use a serial adapter that can"
    );
    assert!(matches!(port.start_break(), Err(PortError::Unsupported { .. })));
    assert_eq!(port.unsent(), 0);
    assert_eq!(port.transmitter_empty(), None);
}

#[test]
fn the_settings_from_before_come_back() {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
    let watch = open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    let mut before = tcgetattr(&watch).unwrap();
    before.set_speed(2_400).unwrap();
    before.input_modes.insert(InputModes::IXON | InputModes::ISTRIP);
    tcsetattr(&watch, OptionalActions::Now, &before).unwrap();

    let port = Port::open(&device(Path::new(&name)), &options("123456 8N1")).unwrap();
    let during = tcgetattr(&watch).unwrap();
    assert_eq!(during.output_speed(), 123_456);
    assert!(during.input_modes.contains(InputModes::PARMRK | InputModes::INPCK));
    let translating = InputModes::IXON | InputModes::ISTRIP | InputModes::ICRNL;
    assert!(!during.input_modes.intersects(translating));
    drop(port);
    let after = tcgetattr(&watch).unwrap();
    assert_eq!(after.output_speed(), 2_400);
    assert_eq!(after.input_modes, before.input_modes);
    assert!(after.local_modes.contains(LocalModes::ICANON));
}

#[test]
fn what_cannot_be_opened_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("program.nc");
    File::create(&file).unwrap();
    let error = |path: &Path| Port::open(&device(path), &options("9600")).unwrap_err();
    assert!(matches!(error(&folder.path().join("none")), PortError::NotFound { .. }));
    assert!(matches!(error(&file), PortError::NotATerminal { .. }));
    assert!(matches!(error(folder.path()), PortError::NotATerminal { .. }));
    assert!(matches!(error(Path::new("/dev/null")), PortError::NotATerminal { .. }));
    let pair = PtyPair::open().unwrap();
    let unknown = PortOptions::new(LineParameters::new(0));
    let error = Port::open(&device(pair.slave_path()), &unknown).unwrap_err();
    assert!(matches!(error, PortError::BadSpec(_)), "{error}");
}

#[test]
fn a_pty_made_here_outlives_its_visitors() {
    let mut port = Port::open(&PortSpec::Pty, &options("9600 7E1")).unwrap();
    let path = port.slave_path().unwrap().to_owned();
    for text in ["first", "second"] {
        let mut visitor = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(OFlags::NOCTTY.bits() as i32)
            .open(&path)
            .unwrap();
        visitor.write_all(text.as_bytes()).unwrap();
        assert_eq!(read_bytes(&mut port, text.len()), text.as_bytes());
        assert_eq!(port.write(b"\x13").unwrap(), 1);
        let mut answer = [0];
        visitor.read_exact(&mut answer).unwrap();
        assert_eq!(answer, [0x13]);
    }
    assert_eq!(port.read(usize::MAX, &mut |_| {}).unwrap(), ReadOutcome::Empty);
    assert_eq!(port.line().parity, Parity::Even);
}

#[test]
fn a_released_pty_tells_that_its_slave_was_closed() {
    let mut pair = PtyPair::open().unwrap();
    let port = open_slave(&pair);
    pair.release_slave();
    assert_eq!(pair.read(&mut [0; 8]).unwrap(), ReadOutcome::Empty);
    drop(port);
    let gone = ReadOutcome::Gone(LinkDownReason::Disconnected);
    assert_eq!(pair.read(&mut [0; 8]).unwrap(), gone);
}

#[test]
fn bytes_pass_a_device_server_until_it_hangs_up() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let server = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = [0; 5];
        stream.read_exact(&mut bytes).unwrap();
        stream.write_all(&bytes).unwrap();
        stream.shutdown(Shutdown::Both).unwrap();
    });
    let spec: PortSpec = format!("tcp://{address}").parse().unwrap();
    let mut port = Port::open(&spec, &options("9600 7E2")).unwrap();
    assert_eq!(port.read(usize::MAX, &mut |_| {}).unwrap(), ReadOutcome::Empty);
    assert_eq!(port.write(&[0xFF, 0, 1, 0x11, 0xFF]).unwrap(), 5);
    assert_eq!(read_bytes(&mut port, 5), [0xFF, 0, 1, 0x11, 0xFF]);
    server.join().unwrap();
    assert_eq!(wait_gone(&mut port), LinkDownReason::Disconnected);
    // The first bytes draw the reset, later ones meet it.
    let error = loop {
        match port.write(b"x") {
            Ok(_) => thread::yield_now(),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, PortError::Gone(LinkDownReason::Disconnected)), "{error}");
    assert!(!port.rate_known());
    assert_eq!(port.line().half_bits(), 22);
}

#[test]
fn a_server_that_does_not_read_fills_the_connection() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let spec: PortSpec = format!("tcp:{}", listener.local_addr().unwrap()).parse().unwrap();
    let mut port = Port::open(&spec, &options("9600")).unwrap();
    let (_stream, _) = listener.accept().unwrap();
    let block = vec![0; 1 << 20];
    while port.write(&block).unwrap() > 0 {}
    assert!(port.unsent() > 0);
}

#[test]
fn a_server_that_is_not_there_is_named() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    drop(listener);
    let spec: PortSpec = format!("tcp://{address}").parse().unwrap();
    let error = Port::open(&spec, &options("9600")).unwrap_err();
    assert!(matches!(error, PortError::Connect { .. }));
    assert!(error.to_string().contains(&address.to_string()), "{error}");
}

#[test]
fn a_deadline_passes_while_a_port_is_silent() {
    let pair = PtyPair::open().unwrap();
    let port = open_slave(&pair);
    let clock = Clock::start();
    let mut poller = Poller::new(clock).unwrap();
    let ready = poller.wait(Some(&port.fd()), Interest::READ, Some(clock.now() + Micros(500)));
    let ready = ready.unwrap();
    assert!(ready.timer && !ready.readable && !ready.hangup);
    assert!(poller.wait(Some(&port.fd()), Interest::BOTH, None).unwrap().writable);
    pair.write(b"N").unwrap();
    assert!(poller.wait(Some(&port.fd()), Interest::READ, Some(NEVER)).unwrap().readable);
}

#[test]
fn a_port_that_is_handed_over_stays_as_it_is_until_it_is_opened_again() {
    let pair = PtyPair::open().unwrap();
    let mut port = open_slave(&pair);
    let kept = port.hand_over().unwrap();
    drop(port);
    assert!(tcgetattr(&kept).unwrap().input_modes.contains(InputModes::PARMRK));
    assert_eq!(pair.write(b"a\r\xff\x03").unwrap(), 4);
    let mut port = open_slave(&pair);
    drop(kept);
    assert_eq!(read_bytes(&mut port, 4), b"a\r\xff\x03");
    // It belongs to one again.
    let second = Port::open(&device(pair.slave_path()), &options("9600 8N1"));
    assert!(matches!(second, Err(PortError::InUse { .. })), "{second:?}");
}
