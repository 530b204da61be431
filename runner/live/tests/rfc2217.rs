//! The port of a device server (RFC 2217) against a simulated one.
#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::net::machine::{Machine, PATIENCE};
use crate::net::port::*;
use proptest::prelude::*;
use rfc2217::{DataBits, FlowControl, Parity, PortSettings, Purge, Server, StopBits};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros, ModemLines};
use softplug_live::device_server::{DeviceServer, Seen};
use softplug_live::port::line_text;
use softplug_live::pty::PtyPair;
use softplug_live::{Blame, Flow, Input, Port, PortError, PortOptions, ReadOutcome};
use softplug_machines::Signal;

fn any_port() -> SocketAddr {
    "127.0.0.1:0".parse().unwrap()
}

fn start(machine: &Machine) -> DeviceServer<Machine> {
    DeviceServer::start(any_port(), machine.clone()).unwrap()
}

fn open(server: &DeviceServer<Machine>, line: &str) -> Port {
    Port::open(&rfc2217(server.address()), &options(line)).unwrap()
}

fn saw(server: &DeviceServer<Machine>, wanted: Seen) -> bool {
    server.wait_until(PATIENCE, |seen| seen.contains(&wanted))
}

#[test]
fn the_servers_port_is_set_as_asked() {
    let server = start(&Machine::default());
    let mut port = Port::open(&rfc2217(server.address()), &device_options("19200 7E2")).unwrap();
    assert_eq!(port.differences(), &[]);
    assert_eq!(line_text(&port.line()), "19200 7E2");
    assert!(port.makes_parity());
    serve(&mut port, &mut Heard::default(), |port, _| match port {
        Port::Rfc2217(port) => port.signature() == Some("softplug simulated server"),
        _ => panic!("{port:?}"),
    });
    let wanted = PortSettings {
        baud_rate: 19_200,
        data_bits: DataBits::Seven,
        parity: Parity::Even,
        stop_bits: StopBits::Two,
        flow_control: FlowControl::XonXoff,
    };
    assert!(saw(&server, Seen::Settings(wanted)));
}

#[test]
fn a_rate_that_was_not_asked_for_is_the_servers() {
    let server = start(&Machine::default());
    drop(open(&server, "4800"));
    assert!(saw(&server, Seen::Disconnected));
    let mut any_rate = PortOptions::default();
    any_rate.line.baud = 0;
    let port = Port::open(&rfc2217(server.address()), &any_rate).unwrap();
    assert_eq!((port.line().baud, port.differences()), (4_800, &[][..]));
}

#[test]
fn every_byte_passes_both_ways() {
    let machine = Machine::default();
    machine.state().echoes = true;
    let server = start(&machine);
    let mut port = open(&server, "921600");
    let all: Vec<u8> = (0..=255).chain([0xFF, 0xFF, 0, 0xFF]).cycle().take(20_000).collect();
    let mut heard = Heard::default();
    write_all(&mut port, &mut heard, &all);
    serve(&mut port, &mut heard, |_, heard| heard.bytes.len() >= all.len());
    assert_eq!(heard, Heard { bytes: all.clone(), errors: Vec::new() });
    assert_eq!(machine.state().received, all);
}

#[test]
fn modem_lines_come_and_go_both_ways() {
    let machine = Machine::default();
    let server = start(&machine);
    let mut port = open(&server, "9600");
    // As long as the server has told none, there are only our own.
    assert_eq!(port.modem_lines(), Some((ModemLines::OUTPUTS, ModemLines::OUTPUTS)));
    let inputs = ModemLines(0x0F);
    let mut heard = Heard::default();
    for on in [ModemLines::CTS, ModemLines::CTS.union(ModemLines::DSR), ModemLines::DCD] {
        server.inject(Signal::ModemLines { lines: inputs, on });
        let wanted = Some((ModemLines::ALL, on.union(ModemLines::OUTPUTS)));
        serve(&mut port, &mut heard, |port, _| port.modem_lines() == wanted);
    }
    port.set_modem_lines(ModemLines::OUTPUTS, ModemLines::RTS).unwrap();
    assert!(saw(&server, Seen::Dtr(false)) && saw(&server, Seen::Rts(true)));
    let on = ModemLines::DCD.union(ModemLines::RTS);
    assert_eq!(port.modem_lines(), Some((ModemLines::ALL, on)));
    assert_eq!(
        machine.state().outputs,
        [(ModemLines::DTR, ModemLines::default()), (ModemLines::RTS, ModemLines::RTS)]
    );
    assert_eq!(heard, Heard::default());
}

#[test]
fn breaks_and_purges_reach_the_servers_port() {
    let machine = Machine::holding_after(1);
    let server = start(&machine);
    let mut port = Port::open(&rfc2217(server.address()), &device_options("19200")).unwrap();
    let mut heard = Heard::default();
    write_all(&mut port, &mut heard, b"N10 X1");
    machine.wait_until(|state| state.received == b"N");
    port.discard_output().unwrap();
    assert!(saw(&server, Seen::Purge(Purge::Transmit)));
    port.start_break().unwrap();
    port.stop_break().unwrap();
    assert!(saw(&server, Seen::Break(true)) && saw(&server, Seen::Break(false)));
    assert_eq!(machine.state().damaged, [LineErrorKind::Break]);
    server.inject(Signal::Character(0x11));
    write_all(&mut port, &mut heard, b"M30");
    // The second character was in the shift register already, where nothing
    // calls it back.
    machine.wait_until(|state| state.received.ends_with(b"M30"));
    assert!(machine.state().received.len() <= 5, "{:?}", machine.state());
}

#[test]
fn line_errors_are_a_range_behind_the_last_bytes() {
    let server = start(&Machine::default());
    let mut port = open(&server, "9600 7E1");
    for byte in *b"O100" {
        server.inject(Signal::Character(byte));
    }
    server.inject(Signal::LineError { kind: LineErrorKind::Parity, byte: Some(b'X') });
    server.inject(Signal::LineError { kind: LineErrorKind::Overrun, byte: None });
    server.inject(Signal::Character(b'Y'));
    server.inject(Signal::LineError { kind: LineErrorKind::Framing, byte: Some(0) });
    server.inject(Signal::LineError { kind: LineErrorKind::Break, byte: None });
    server.inject(Signal::Character(b'%'));
    let mut heard = Heard::default();
    serve(&mut port, &mut heard, |_, heard| heard.bytes.ends_with(b"%"));
    assert_eq!(heard.bytes, b"O100XY\0%");
    assert_eq!(
        heard.errors,
        [
            (LineErrorKind::Parity, 5, 5),
            (LineErrorKind::Overrun, 1, 5),
            (LineErrorKind::Framing, 2, 7),
            (LineErrorKind::Break, 1, 7),
        ]
    );
}

#[test]
fn a_server_that_wants_a_pause_gets_nothing() {
    let machine = Machine::default();
    let server = start(&machine);
    let mut port = open(&server, "115200");
    let mut heard = Heard::default();
    server.suspend(true);
    serve(&mut port, &mut heard, |port, _| port.is_suspended());
    assert_eq!(port.write(b"G0").unwrap(), 0);
    // What is no data goes on.
    port.set_modem_lines(ModemLines::RTS, ModemLines::default()).unwrap();
    assert!(saw(&server, Seen::Rts(false)));
    server.suspend(false);
    serve(&mut port, &mut heard, |port, _| !port.is_suspended());
    write_all(&mut port, &mut heard, b"G1");
    machine.wait_until(|state| state.received == b"G1");
}

#[test]
fn the_servers_own_flow_control_reaches_back_and_loses_nothing() {
    let machine = Machine::holding_after(100);
    let server = start(&machine);
    let mut port = Port::open(&rfc2217(server.address()), &device_options("921600")).unwrap();
    let all: Vec<u8> = (0..1_000_000_u32).map(|i| b' ' + (i % 90) as u8).collect();
    let mut written = 0;
    // Room for nothing, again and again: the server takes no more.
    let mut refused = 0;
    while refused < 200 {
        let count = port.write(&all[written..]).unwrap();
        written += count;
        refused = if count == 0 { refused + 1 } else { 0 };
        thread::sleep(Duration::from_millis(1));
    }
    assert!(written < all.len(), "the server took it all");
    assert!(port.unsent() > 0);
    assert!(machine.state().received.len() <= 101);
    // Held for longer than any question may take, and still nobody is dead.
    for at in (0..600).step_by(5) {
        port.handle_timeout(Micros::from_secs(at)).unwrap();
    }
    let rest = &all[written..written + 50_000];
    server.inject(Signal::Character(0x11));
    let mut heard = Heard::default();
    write_all(&mut port, &mut heard, rest);
    let total = written + rest.len();
    machine.wait_until(|state| state.received.len() >= total);
    assert!(machine.state().received == all[..total], "bytes were lost, doubled or reordered");
}

#[test]
fn a_server_that_a_wire_stops_holds_what_it_has_and_loses_nothing() {
    for (flow, control, wire) in [
        (Flow::RtsCts, FlowControl::RtsCts, ModemLines::CTS),
        (Flow::DsrDtr, FlowControl::Dsr, ModemLines::DSR),
    ] {
        let machine = Machine::default();
        let server = start(&machine);
        let asked = PortOptions { flow, ..options("921600") };
        let mut port = Port::open(&rfc2217(server.address()), &asked).unwrap();
        assert!(port.is_stoppable() && port.differences().is_empty(), "{:?}", port.differences());
        let is_set = |seen: &Seen| matches!(seen, Seen::Settings(settings) if settings.flow_control == control);
        assert!(server.seen().iter().any(is_set), "{:?}", server.seen());
        let mut heard = Heard::default();
        write_all(&mut port, &mut heard, b"one");
        machine.wait_until(|state| state.received == b"one");

        server.inject(Signal::ModemLines { lines: wire, on: ModemLines::default() });
        serve(&mut port, &mut heard, |port, _| {
            port.modem_lines().is_some_and(|(known, on)| known.contains(wire) && !on.contains(wire))
        });
        // XOFF is a character like any other now.
        server.inject(Signal::Character(0x13));
        write_all(&mut port, &mut heard, b"two");
        serve(&mut port, &mut heard, |_, heard| heard.bytes.contains(&0x13));
        assert_eq!(machine.state().received, b"one");
        server.inject(Signal::ModemLines { lines: wire, on: wire });
        machine.wait_until(|state| state.received == b"onetwo");
    }
}

#[test]
fn what_a_kind_of_port_cannot_do_is_one_sentence() {
    let said = |port: &str, flow| {
        let asked = PortOptions { flow, ..options("9600") };
        Port::open(&port.parse().unwrap(), &asked).map(drop).unwrap_err().to_string()
    };
    let pty = PtyPair::open().unwrap();
    let slave = pty.slave_path().display().to_string();
    assert_eq!(
        said("rfc2217://127.0.0.1:9", Flow::Rs485),
        "this port has no way to turn a line around, which RFC 2217 does not know; set the device \
         server to RS-485 itself, and take host"
    );
    assert_eq!(
        said("tcp://127.0.0.1:9", Flow::RtsCts),
        "this port has no modem lines, as a raw TCP connection; set the device server itself and \
         take host, or use rfc2217://"
    );
    assert_eq!(said("pty:", Flow::RtsCts), "this port has no modem lines, as a pty; take host");
    assert_eq!(
        said(&slave, Flow::DsrDtr),
        "this port has no DSR/DTR flow control, which the kernel does not know; lead the machine's \
         DTR to our CTS and take rts-cts, or use a device server (rfc2217://)"
    );
    assert_eq!(
        said(&slave, Flow::Rs485),
        "this port has no driver that turns an RS-485 line around with RTS; use an adapter that does \
         so by itself, and take host"
    );
    // Refused, and left as it was found.
    let asked = PortOptions { flow: Flow::RtsCts, ..options("9600") };
    let port = Port::open(&slave.parse().unwrap(), &asked).unwrap();
    assert!(port.is_stoppable());
}

#[test]
fn a_server_that_hangs_is_found() {
    let server = start(&Machine::default());
    let mut port = open(&server, "9600");
    let mut heard = Heard::default();
    // It answers as long as it lives.
    for at in (0..60).step_by(5) {
        port.handle_timeout(Micros::from_secs(at)).unwrap();
        serve(&mut port, &mut heard, |port, _| !port.has_output() && port.unsent() == 0);
        has_served(&server);
        serve(&mut port, &mut heard, |_, _| true);
    }
    server.hang(true);
    let lost = (60..200).step_by(5).find_map(|at| port.handle_timeout(Micros::from_secs(at)).err());
    assert!(matches!(lost, Some(PortError::Gone(LinkDownReason::Failed))), "{lost:?}");
}

/// Waits until the server has answered all that it has been asked: it sends others away before
/// it serves its client, so that it has served it once between two of them.
fn has_served(server: &DeviceServer<Machine>) {
    let count = |seen: &[Seen]| seen.iter().filter(|seen| matches!(seen, Seen::Busy)).count();
    for _ in 0..2 {
        let before = count(&server.seen());
        let _other = TcpStream::connect(server.address()).unwrap();
        assert!(server.wait_until(PATIENCE, |seen| count(seen) > before));
    }
}

#[test]
fn a_server_that_is_killed_is_found_and_comes_back() {
    let machine = Machine::default();
    machine.state().echoes = true;
    let server = start(&machine);
    let address = server.address();
    let mut port = open(&server, "115200");
    let mut heard = Heard::default();
    write_all(&mut port, &mut heard, b"one");
    serve(&mut port, &mut heard, |_, heard| heard.bytes == b"one");
    let machine = server.kill().unwrap();
    let lost = serve_or_lose(&mut port, &mut heard, |_, _| false);
    assert_eq!(lost, Err(LinkDownReason::Disconnected));
    assert!(matches!(port.write(b"x"), Err(PortError::Gone(_))));
    drop(port);
    let error = Port::open(&rfc2217(address), &options("115200")).unwrap_err();
    assert!(matches!(error, PortError::Connect { .. }), "{error}");

    let server = DeviceServer::start(address, machine.clone()).unwrap();
    let mut port = open(&server, "115200");
    write_all(&mut port, &mut heard, b"two");
    serve(&mut port, &mut heard, |_, heard| heard.bytes == b"onetwo");
    assert_eq!(machine.state().received, b"onetwo");
}

/// A server that does `act` with its one connection.
fn strange(act: impl FnOnce(TcpStream) + Send + 'static) -> SocketAddr {
    let listener = TcpListener::bind(any_port()).unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || act(listener.accept().unwrap().0));
    address
}

fn open_error(address: SocketAddr, connect_timeout: Duration) -> PortError {
    Port::open(&rfc2217(address), &PortOptions { connect_timeout, ..options("9600") }).unwrap_err()
}

#[test]
fn what_is_no_such_server_is_named() {
    let silent = strange(|mut stream| {
        let _ = stream.read(&mut [0; 64]);
        thread::sleep(PATIENCE);
    });
    let silent = open_error(silent, Duration::from_millis(300));
    assert_eq!(silent.blame(), Blame::Setup);
    assert!(silent.to_string().contains("does not speak RFC 2217: it does not answer"), "{silent}");

    let echo = strange(|mut stream| {
        let mut buffer = [0; 256];
        while let Ok(count @ 1..) = stream.read(&mut buffer) {
            if stream.write_all(&buffer[..count]).is_err() {
                break;
            }
        }
    });
    let echo = open_error(echo, PATIENCE);
    assert!(echo.to_string().contains("it sends back what it is sent"), "{echo}");

    let plain = strange(|mut stream| {
        // A Telnet server that wants nothing of it.
        let mut refusals = Vec::new();
        for option in [0, 3, 44] {
            refusals.extend_from_slice(&[0xFF, 0xFE, option, 0xFF, 0xFC, option]);
        }
        stream.write_all(&refusals).unwrap();
        let _ = stream.read_to_end(&mut Vec::new());
    });
    let plain = open_error(plain, PATIENCE);
    assert!(plain.to_string().contains("it refuses to set its port"), "{plain}");

    let closed = open_error(strange(drop), PATIENCE);
    assert!(matches!(closed, PortError::Connect { .. }), "{closed}");
    assert!(closed.to_string().contains("hung up at once"), "{closed}");
}

#[test]
fn a_server_that_answers_no_setting_is_taken_with_differences() {
    let address = strange(|mut stream| {
        stream.write_all(&[0xFF, 0xFD, 44]).unwrap();
        let _ = stream.read_to_end(&mut Vec::new());
    });
    let patient = PortOptions { connect_timeout: PATIENCE, ..options("19200 7E2") };
    let port = Port::open(&rfc2217(address), &patient).unwrap();
    let differences: Vec<_> = port.differences().iter().map(ToString::to_string).collect();
    assert_eq!(
        differences,
        [
            "baud rate: asked for 19200, the port has what it does not tell",
            "data bits: asked for 7, the port has what it does not tell",
            "parity: asked for even, the port has what it does not tell",
            "stop bits: asked for 2, the port has what it does not tell",
        ]
    );
}

#[test]
fn nothing_of_an_overlong_subnegotiation_is_taken_for_what_the_machine_sent() {
    let address = strange(|mut stream| {
        stream.write_all(&[0xFF, 0xFD, 44]).unwrap();
        stream.write_all(&[&b"N1"[..], &[0xFF, 250, 44, 100], &[b'B'; 3_000]].concat()).unwrap();
        stream.write_all(&[0xFF, 240, b'N', b'2']).unwrap();
        let _ = stream.read_to_end(&mut Vec::new());
    });
    let quick = PortOptions { connect_timeout: Duration::from_millis(300), ..options("9600") };
    let mut heard = Heard::default();
    // It may be found out while the port is opened, or after.
    match Port::open(&rfc2217(address), &quick) {
        Ok(mut port) => {
            let lost = serve_or_lose(&mut port, &mut heard, |_, _| false);
            assert_eq!(lost, Err(LinkDownReason::Failed));
            assert_eq!(heard.bytes, b"N1");
        }
        Err(error) => {
            assert_eq!(error.blame(), Blame::Setup);
            assert!(error.to_string().contains("longer than any can be"), "{error}");
        }
    }
}

/// A server that sets its port as asked, and after a word tells that it has another
/// rate; then it hears an X.
fn fickle(word: Receiver<u32>) -> SocketAddr {
    strange(move |mut stream| {
        stream.set_read_timeout(Some(Duration::from_millis(10))).unwrap();
        let mut server = Server::new(PortSettings::default());
        let mut buffer = [0; 512];
        let rate: u32 = loop {
            match word.try_recv() {
                Ok(rate) => break rate,
                Err(TryRecvError::Disconnected) => return,
                Err(TryRecvError::Empty) => {}
            }
            let count = stream.read(&mut buffer).unwrap_or(0);
            let mut taken = 0;
            while taken < count {
                taken += server.receive_into(&buffer[taken..count], &mut [0; 512]).consumed;
                while server.poll_event().is_some() {}
                stream.write_all(server.output()).unwrap();
                server.consume_output(server.output().len());
            }
        };
        let rate = rate.to_be_bytes();
        stream.write_all(&[&[0xFF, 250, 44, 101], &rate[..], &[0xFF, 240, b'X']].concat()).unwrap();
        while stream.read(&mut buffer).is_err() {}
    })
}

#[test]
fn a_server_whose_port_gets_another_rate_is_lost() {
    for (rate, is_lost) in [(19_230, false), (0, false), (9_600, true)] {
        let (tell, word) = channel();
        let mut port = Port::open(&rfc2217(fickle(word)), &options("19200")).unwrap();
        assert_eq!(port.differences(), &[]);
        tell.send(rate).unwrap();
        let mut heard = Vec::new();
        let begin = Instant::now();
        let lost = loop {
            assert!(begin.elapsed() < PATIENCE, "{rate}");
            let read = port.read(usize::MAX, &mut |input| {
                if let Input::Bytes(bytes) = input {
                    heard.extend_from_slice(bytes);
                }
            });
            match read.unwrap() {
                ReadOutcome::Gone(reason) => break Some(reason),
                ReadOutcome::Empty => thread::sleep(Duration::from_millis(1)),
                ReadOutcome::Read(_) if heard == b"X" && !is_lost => break None,
                ReadOutcome::Read(_) => {}
            }
        };
        assert_eq!(lost, is_lost.then_some(LinkDownReason::Failed), "{rate}");
    }
}

/// Bytes as Telnet might have them: verbs and subnegotiations more often than
/// chance would.
fn telnet() -> impl Strategy<Value = Vec<u8>> {
    let command = prop_oneof![
        (251_u8..=254, prop_oneof![Just(0_u8), Just(3), Just(44), any::<u8>()])
            .prop_map(|(verb, option)| vec![0xFF, verb, option]),
        (any::<u8>(), prop::collection::vec(any::<u8>(), 0..12)).prop_map(|(code, body)| {
            let mut bytes = vec![0xFF, 250, 44, code];
            bytes.extend(body);
            bytes.extend([0xFF, 240]);
            bytes
        }),
        (100_u8..=112, any::<u8>())
            .prop_map(|(code, value)| vec![0xFF, 250, 44, code, value, 0xFF, 240]),
        prop::collection::vec(any::<u8>(), 0..40),
    ];
    prop::collection::vec(command, 0..60).prop_map(|commands| commands.concat())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// Whatever a server sends, before it is set and after: no panic, no wait
    /// without end, and the port is lost when the server is.
    #[test]
    fn no_server_can_harm_the_port(early in telnet(), late in telnet(), agrees in any::<bool>()) {
        let address = strange(move |mut stream| {
            if agrees {
                let _ = stream.write_all(&[0xFF, 0xFD, 44]);
            }
            let _ = stream.write_all(&early);
            thread::sleep(Duration::from_millis(5));
            let _ = stream.write_all(&late);
            let _ = stream.shutdown(std::net::Shutdown::Write);
            let _ = stream.read_to_end(&mut Vec::new());
        });
        let quick = PortOptions { connect_timeout: Duration::from_millis(20), ..options("9600") };
        if let Ok(mut port) = Port::open(&rfc2217(address), &quick) {
            let mut reads = 0;
            loop {
                let _ = port.write(b"G0");
                let _ = port.set_modem_lines(ModemLines::OUTPUTS, ModemLines::RTS);
                match port.read(usize::MAX, &mut |_| {}).unwrap() {
                    ReadOutcome::Gone(_) => break,
                    ReadOutcome::Read(_) => {}
                    ReadOutcome::Empty => thread::sleep(Duration::from_micros(200)),
                }
                reads += 1;
                prop_assert!(reads < 100_000);
            }
        }
    }
}
