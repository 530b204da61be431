//! Server endpoints of lanes: other software connects, and a machine on a pty is
//! at the far end.
#![cfg(target_os = "linux")]

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::thread;
use std::time::Duration;

use crate::lanes::{Bench, program, settings};
use crate::net::port::{Heard, options, rfc2217, serve, write_all};
use proptest::prelude::*;
use rustix::net::sockopt;
use softplug_abi::{Failure, Micros, ModemLines};
use softplug_live::endpoint::{EndpointKind, EndpointSetup, Framing, LineAnswer, ServerEndpoint};
use softplug_live::reactor::{EndpointNews, JobOutcome, LaneEndpoint, LaneId, Report};
use softplug_live::{Blame, Port};

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;
/// So long that only something lost makes a test wait for it.
const PATIENCE: Duration = Duration::from_secs(30);

fn raw() -> EndpointSetup {
    EndpointSetup::new("127.0.0.1:0".parse().unwrap())
}

fn telnet() -> EndpointSetup {
    EndpointSetup { kind: EndpointKind::Rfc2217, ..raw() }
}

/// A lane with an endpoint, up.
fn lane(setup: EndpointSetup, plugin: &[(&str, &str)]) -> (Bench, LaneId, SocketAddr) {
    let mut bench = Bench::start();
    let endpoint = ServerEndpoint::new(setup);
    let address = endpoint.address().unwrap();
    let lane = bench.add_with(115_200, |setup| {
        setup.station.settings = settings(plugin);
        setup.endpoint = Some(LaneEndpoint {
            endpoint: Box::new(endpoint),
            job_kind: 0,
            fields: Vec::new(),
            check: false,
        });
    });
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    (bench, lane, address)
}

fn connect(address: SocketAddr) -> TcpStream {
    let client = TcpStream::connect(address).unwrap();
    client.set_read_timeout(Some(PATIENCE)).unwrap();
    client
}

fn read_exactly(client: &mut TcpStream, count: usize) -> Vec<u8> {
    let mut bytes = vec![0; count];
    client.read_exact(&mut bytes).unwrap();
    bytes
}

fn news(bench: &mut Bench, lane: LaneId, wanted: impl Fn(&EndpointNews) -> bool) {
    bench.wait_for(lane, |report| matches!(report, Report::Endpoint(news) if wanted(news)));
}

fn gone(news: &EndpointNews) -> bool {
    matches!(news, EndpointNews::Disconnected(_))
}

#[test]
fn what_a_client_sends_reaches_the_machine_and_what_it_answers_comes_back() {
    let (mut bench, lane, address) = lane(raw(), &[]);
    let mut client = connect(address);
    let program = program(3_000);
    client.write_all(&program).unwrap();
    assert_eq!(bench.read_from_machine(lane, program.len()), program);
    for round in 0..50_u8 {
        let word = [b'A' + round % 26; 16];
        client.write_all(&word).unwrap();
        assert_eq!(bench.read_from_machine(lane, 16), word);
        bench.machines[&lane].write(&word).unwrap();
        assert_eq!(read_exactly(&mut client, 16), word);
    }
    let local = client.local_addr().unwrap();
    drop(client);
    news(&mut bench, lane, |news| *news == EndpointNews::Connected(local));
    news(&mut bench, lane, |news| *news == EndpointNews::Disconnected(local));
}

#[test]
fn a_connection_is_one_job_and_the_next_client_has_the_next() {
    let (mut bench, lane, address) = lane(raw(), &[("feed_start", "25"), ("feed_end", "25")]);
    for round in 0..3 {
        let mut client = connect(address);
        let text = format!("O{round}");
        client.write_all(text.as_bytes()).unwrap();
        client.shutdown(Shutdown::Write).unwrap();
        let on_line = format!("%{text}%");
        assert_eq!(bench.read_from_machine(lane, 4), on_line.as_bytes());
        // The job is done: the connection ends from the other side.
        assert_eq!(client.read(&mut [0]).unwrap(), 0);
        news(&mut bench, lane, gone);
    }
}

#[test]
fn a_pause_ends_a_job_where_pauses_do() {
    let setup = EndpointSetup { framing: Framing::Gap(Micros::from_millis(100)), ..raw() };
    let (bench, lane, address) = lane(setup, &[("feed_end", "25")]);
    let mut client = connect(address);
    for text in ["N1", "N2", "N3"] {
        client.write_all(text.as_bytes()).unwrap();
        assert_eq!(bench.read_from_machine(lane, 3), format!("{text}%").as_bytes());
    }
}

#[test]
fn a_machine_that_holds_holds_the_client_and_nothing_is_lost() {
    let (bench, lane, address) = lane(raw(), &[]);
    let mut client = connect(address);
    sockopt::set_socket_send_buffer_size(&client, 4_096).unwrap();
    client.write_all(b"N0\n").unwrap();
    assert_eq!(bench.read_from_machine(lane, 3), b"N0\n");
    bench.machines[&lane].write(&[XOFF]).unwrap();
    let all = program(8_000_000);
    // A hold that is heeded before the next byte: then nothing leaves any more.
    thread::sleep(Duration::from_millis(50));
    client.set_nonblocking(true).unwrap();
    let (mut sent, mut refused) = (0, 0);
    while refused < 100 {
        match client.write(&all[sent..]) {
            Ok(count) => (sent, refused) = (sent + count, 0),
            Err(error) if error.kind() == ErrorKind::WouldBlock => refused += 1,
            Err(error) => panic!("{error}"),
        }
        thread::sleep(Duration::from_millis(1));
    }
    assert!(sent < all.len(), "the gateway took it all");
    bench.machines[&lane].write(&[XON]).unwrap();
    client.set_nonblocking(false).unwrap();
    let total = 40_000;
    let rest = all[sent.min(total)..total].to_vec();
    let writer = thread::spawn(move || {
        client.write_all(&rest).unwrap();
        client
    });
    assert!(bench.read_from_machine(lane, total) == all[..total]);
    drop(writer.join().unwrap());
}

#[test]
fn a_client_that_does_not_read_holds_the_machine_and_nothing_is_lost() {
    let (bench, lane, address) = lane(raw(), &[]);
    let mut client = connect(address);
    sockopt::set_socket_recv_buffer_size(&client, 4_096).unwrap();
    client.write_all(b"?").unwrap();
    let machine = &bench.machines[&lane];
    assert_eq!(bench.read_from_machine(lane, 1), b"?");
    let all = program(1_000_000);
    let (mut sent, mut held, mut idle) = (0, false, 0);
    let mut buffer = [0; 64];
    // As a machine would: it stops at XOFF.
    while !held || idle < 200 {
        idle += 1;
        if let softplug_live::ReadOutcome::Read(count) = machine.read(&mut buffer).unwrap() {
            held = buffer[..count].iter().fold(held, |_, byte| match *byte {
                XOFF => true,
                XON => false,
                byte => panic!("{byte:02X} is no control byte"),
            });
            idle = 0;
        }
        if !held {
            let end = all.len().min(sent + 64);
            sent += machine.write(&all[sent..end]).unwrap();
            assert!(sent < all.len(), "the gateway took it all");
        }
        thread::sleep(Duration::from_micros(200));
    }
    assert!(read_exactly(&mut client, sent) == all[..sent]);
    // There is room again, and the machine is told; an XOFF may have been repeated before.
    let heard = || bench.read_from_machine(lane, 1);
    assert_eq!(std::iter::repeat_with(heard).find(|heard| *heard != [XOFF]), Some(vec![XON]));
}

#[test]
fn a_second_client_is_told_and_sent_away() {
    let (mut bench, lane, address) = lane(raw(), &[]);
    let mut first = connect(address);
    first.write_all(b"G0").unwrap();
    assert_eq!(bench.read_from_machine(lane, 2), b"G0");
    let mut second = connect(address);
    let mut word = String::new();
    second.read_to_string(&mut word).unwrap();
    assert_eq!(word, format!("the link is in use by {}\r\n", first.local_addr().unwrap()));
    news(&mut bench, lane, |news| matches!(news, EndpointNews::Busy(_)));
    first.write_all(b"G1").unwrap();
    assert_eq!(bench.read_from_machine(lane, 2), b"G1");
}

#[test]
fn what_a_lost_client_sent_does_not_pass_for_whole() {
    let (mut bench, lane, address) = lane(raw(), &[("feed_end", "25")]);
    let mut client = connect(address);
    client.write_all(b"N1 G1 X1").unwrap();
    assert_eq!(bench.read_from_machine(lane, 8), b"N1 G1 X1");
    sockopt::set_socket_linger(&client, Some(Duration::ZERO)).unwrap();
    drop(client);
    let aborted = JobOutcome::Failed { failure: Failure::Aborted, status: 0 };
    news(&mut bench, lane, |news| *news == EndpointNews::JobFailed(aborted.clone()));
    // The next one begins anew, and what ended the first job was no percent sign.
    let mut client = connect(address);
    client.write_all(b"O2").unwrap();
    client.shutdown(Shutdown::Write).unwrap();
    assert_eq!(bench.read_from_machine(lane, 3), b"O2%");
}

#[test]
fn a_machine_that_is_lost_ends_the_clients_connection() {
    let (mut bench, lane, address) = lane(raw(), &[]);
    let mut client = connect(address);
    client.write_all(b"N1").unwrap();
    assert_eq!(bench.read_from_machine(lane, 2), b"N1");
    drop(bench.machines.remove(&lane));
    bench.wait_for(lane, |report| matches!(report, Report::Down { .. }));
    assert!(matches!(client.read(&mut [0]), Ok(0) | Err(_)));
    news(&mut bench, lane, gone);
}

#[test]
fn small_deliveries_are_gathered_and_all_arrive() {
    let setup = EndpointSetup { gather: Micros::from_millis(20), ..raw() };
    let (bench, lane, address) = lane(setup, &[]);
    let mut client = connect(address);
    client.write_all(b"?").unwrap();
    assert_eq!(bench.read_from_machine(lane, 1), b"?");
    let all = program(3_000);
    for byte in &all {
        while bench.machines[&lane].write(&[*byte]).unwrap() == 0 {
            thread::sleep(Duration::from_millis(1));
        }
    }
    assert_eq!(read_exactly(&mut client, all.len()), all);
}

#[test]
fn an_address_that_is_taken_is_told_and_tried_again() {
    let other = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let listen = other.local_addr().unwrap();
    let mut bench = Bench::start();
    let endpoint = ServerEndpoint::new(EndpointSetup::new(listen));
    assert_eq!(endpoint.address(), None);
    let lane = bench.add_with(115_200, |setup| {
        setup.endpoint = Some(LaneEndpoint {
            endpoint: Box::new(endpoint),
            job_kind: 0,
            fields: Vec::new(),
            check: false,
        });
    });
    news(
        &mut bench,
        lane,
        |news| matches!(news, EndpointNews::Failed(text) if text.contains(&listen.to_string())),
    );
    drop(other);
    let mut client = loop {
        match TcpStream::connect(listen) {
            Ok(client) => break client,
            Err(_) => thread::sleep(Duration::from_millis(50)),
        }
    };
    client.write_all(b"G0").unwrap();
    assert_eq!(bench.read_from_machine(lane, 2), b"G0");
}

#[test]
fn a_client_of_rfc2217_is_told_the_ports_own_settings() {
    let (bench, lane, address) = lane(telnet(), &[("control_in_data", "send"), ("speak", "false")]);
    let error = Port::open(&rfc2217(address), &options("9600 7E1")).unwrap_err();
    assert_eq!(error.blame(), Blame::Setup, "{error}");
    let differences: Vec<_> = error.differences().iter().map(ToString::to_string).collect();
    assert_eq!(
        differences,
        [
            "baud rate: asked for 9600, the port has 115200",
            "data bits: asked for 7, the port has 8",
            "parity: asked for even, the port has none",
        ]
    );
    // A rate that UARTs take for the same is none.
    let mut client = Port::open(&rfc2217(address), &options("115000 8N1")).unwrap();
    assert_eq!(client.line().baud, 115_200);
    let differences: Vec<_> = client.differences().iter().map(ToString::to_string).collect();
    assert_eq!(differences, ["baud rate: asked for 115000, the port has 115200"]);
    let all: Vec<u8> = (0..=255).chain([0xFF, 0xFF, 0, 0xFF]).cycle().take(5_000).collect();
    let mut heard = Heard::default();
    write_all(&mut client, &mut heard, &all);
    assert!(bench.read_from_machine(lane, all.len()) == all);
    // A port without modem lines has them on, for software that waits for them.
    let ready = ModemLines::CTS.union(ModemLines::DSR).union(ModemLines::DCD);
    serve(&mut client, &mut heard, |port, _| {
        port.modem_lines().is_some_and(|(_, on)| on.contains(ready))
    });
    let text: Vec<u8> = all.iter().copied().filter(|byte| ![XON, XOFF].contains(byte)).collect();
    let mut sent = 0;
    while sent < text.len() {
        sent += bench.machines[&lane].write(&text[sent..text.len().min(sent + 100)]).unwrap();
        serve(&mut client, &mut heard, |_, _| true);
    }
    serve(&mut client, &mut heard, |_, heard| heard.bytes.len() >= text.len());
    assert!(heard.bytes == text && heard.errors.is_empty());
}

#[test]
fn software_that_insists_is_told_what_it_asked_for() {
    let (_bench, _, address) = lane(EndpointSetup { line: LineAnswer::AsAsked, ..telnet() }, &[]);
    let client = Port::open(&rfc2217(address), &options("4800 7E2")).unwrap();
    assert_eq!((client.line().baud, client.differences()), (4_800, &[][..]));
}

#[test]
fn a_client_may_purge_and_ask_for_what_the_port_cannot() {
    let (mut bench, lane, address) = lane(telnet(), &[]);
    let mut client = Port::open(&rfc2217(address), &options("115200")).unwrap();
    let mut heard = Heard::default();
    write_all(&mut client, &mut heard, b"N1");
    assert_eq!(bench.read_from_machine(lane, 2), b"N1");
    // A pty has neither lines nor breaks; nothing comes of it.
    client.set_modem_lines(ModemLines::OUTPUTS, ModemLines::RTS).unwrap();
    client.start_break().unwrap();
    client.stop_break().unwrap();
    write_all(&mut client, &mut heard, b"N2");
    assert_eq!(bench.read_from_machine(lane, 2), b"N2");
    client.discard_output().unwrap();
    news(&mut bench, lane, |news| matches!(news, EndpointNews::JobFailed(_)));
    let figures = bench.figures(lane);
    assert_eq!((figures.bytes_out, figures.opened), (4, 1), "the port was not lost by it");
}

#[test]
fn nothing_of_an_overlong_subnegotiation_reaches_the_machine() {
    let (mut bench, lane, address) = lane(telnet(), &[]);
    let mut client = connect(address);
    let body = [b'B'; 3_000];
    client.write_all(&[&b"N1"[..], &[0xFF, 250, 44, 0], &body, &[0xFF, 240]].concat()).unwrap();
    let _ = client.write_all(b"N2");
    // What it says of itself is answered, and then it is hung up on.
    let mut answers = Vec::new();
    let _ = client.read_to_end(&mut answers);
    news(&mut bench, lane, gone);
    let mut next = Port::open(&rfc2217(address), &options("115200")).unwrap();
    write_all(&mut next, &mut Heard::default(), b"OK");
    let mut line = Vec::new();
    while !line.ends_with(b"OK") {
        line.extend(bench.read_from_machine(lane, 1));
    }
    // What stood before it may have left; nothing of it and nothing behind it has.
    assert!([&b"OK"[..], b"NOK", b"N1OK"].contains(&&line[..]), "{:?}", line.escape_ascii());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, ..ProptestConfig::default() })]

    /// Whatever clients send, the next one is served.
    #[test]
    fn no_client_can_harm_the_link(
        clients in prop::collection::vec(
            (prop::collection::vec(
                prop_oneof![Just(0xFF_u8), Just(250), Just(44), Just(240), any::<u8>()], 0..400),
             any::<bool>()),
            1..6,
        ),
        is_raw in any::<bool>(),
    ) {
        let setup = if is_raw { raw() } else { telnet() };
        let (mut bench, lane, address) = lane(setup, &[]);
        for (bytes, resets) in clients {
            let mut client = connect(address);
            let _ = client.write_all(&bytes);
            if resets {
                sockopt::set_socket_linger(&client, Some(Duration::ZERO)).unwrap();
            }
            drop(client);
            news(&mut bench, lane, gone);
        }
        let mut heard = Heard::default();
        if is_raw {
            connect(address).write_all(b"OK").unwrap();
        } else {
            let mut client = Port::open(&rfc2217(address), &options("115200")).unwrap();
            write_all(&mut client, &mut heard, b"OK");
        }
        let mut line = Vec::new();
        while !line.ends_with(b"OK") {
            line.extend(bench.read_from_machine(lane, 1));
        }
    }
}
