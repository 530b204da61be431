//! Lanes whose ports are those of a simulated device server (RFC 2217).
#![cfg(target_os = "linux")]

use crate::net::killed;
use std::net::SocketAddr;
use std::thread;
use std::time::Duration;

use crate::lanes::{Bench, program};
use crate::net::machine::{Machine, PATIENCE};
use crate::net::port::{device_options, rfc2217};
use softplug_abi::{JobId, LineErrorKind, ModemLines};
use softplug_live::PortOptions;
use softplug_live::device_server::{DeviceServer, Seen};
use softplug_live::reactor::{JobOutcome, LaneId, Report};
use softplug_machines::Signal;

const ANYWHERE: &str = "127.0.0.1:0";

fn start(machine: &Machine) -> DeviceServer<Machine> {
    DeviceServer::start(ANYWHERE.parse().unwrap(), machine.clone()).unwrap()
}

fn add(bench: &mut Bench, address: SocketAddr, options: PortOptions) -> LaneId {
    bench.add_with(options.line.baud, |setup| {
        setup.port = rfc2217(address);
        setup.port_options = options;
    })
}

struct Simulated {
    machine: Machine,
    address: SocketAddr,
    server: Option<DeviceServer<Machine>>,
}

impl killed::Server for Simulated {
    fn kill(&mut self) {
        self.server.take().unwrap().kill().unwrap();
    }

    fn restart(&mut self) {
        self.server = Some(DeviceServer::start(self.address, self.machine.clone()).unwrap());
    }

    fn wait_received(&self, count: usize) -> Vec<u8> {
        self.machine.wait_until(|state| state.received.len() >= count);
        self.received()
    }

    fn received(&self) -> Vec<u8> {
        self.machine.state().received.clone()
    }
}

#[test]
fn a_server_that_is_killed_in_mid_job_is_taken_up_again() {
    let machine = Machine::default();
    let server = start(&machine);
    let mut simulated = Simulated { machine, address: server.address(), server: Some(server) };
    let mut bench = Bench::start();
    let lane = add(&mut bench, simulated.address, device_options("115200"));
    killed::kill_in_mid_job(&mut bench, lane, &mut simulated);
}

#[test]
fn a_server_whose_machine_holds_holds_the_job() {
    let machine = Machine::holding_after(300);
    let server = start(&machine);
    let mut bench = Bench::start();
    let lane = add(&mut bench, server.address(), device_options("921600"));
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    let program = program(150_000);
    bench.send(lane, JobId(1), &program);
    machine.wait_until(|state| state.received.len() >= 300);
    // One is in the shift register.
    let (mut taken, mut same) = (0, 0);
    while same < 50 {
        thread::sleep(Duration::from_millis(20));
        let now = bench.figures(lane).bytes_out;
        same = if now == taken { same + 1 } else { 0 };
        taken = now;
    }
    assert!(taken < 150_000, "the server took it all");
    assert!(machine.state().received.len() <= 301);
    server.inject(Signal::Character(0x11));
    machine.wait_until(|state| state.received.len() >= program.len());
    assert!(machine.state().received == program);
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
}

#[test]
fn a_server_that_wants_a_pause_pauses_the_job() {
    let machine = Machine::default();
    let server = start(&machine);
    let mut bench = Bench::start();
    let lane = add(&mut bench, server.address(), device_options("115200"));
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    let program = program(30_000);
    bench.send(lane, JobId(1), &program);
    machine.wait_until(|state| state.received.len() >= 300);
    server.suspend(true);
    let (mut taken, mut same) = (0, 0);
    while same < 25 {
        thread::sleep(Duration::from_millis(20));
        let now = machine.state().received.len();
        same = if now == taken { same + 1 } else { 0 };
        taken = now;
    }
    assert!(taken < program.len());
    server.suspend(false);
    machine.wait_until(|state| state.received.len() >= program.len());
    assert!(machine.state().received == program);
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
}

#[test]
fn line_errors_at_the_server_are_the_links() {
    let server = start(&Machine::default());
    let mut bench = Bench::start();
    let lane = add(&mut bench, server.address(), device_options("9600 7E1"));
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    for byte in *b"N10 X1" {
        server.inject(Signal::Character(byte));
    }
    server.inject(Signal::LineError { kind: LineErrorKind::Parity, byte: Some(b'?') });
    // The plug-in fails what was received with a damaged character in it.
    let ended = bench.wait_for(lane, |report| matches!(report, Report::DeliveryEnded { .. }));
    assert!(matches!(ended, Report::DeliveryEnded { failure: Some(_), .. }), "{ended:?}");
    let errors = bench.figures(lane).line_errors;
    assert_eq!(errors, [1, 0, 0, 0, 0]);
}

#[test]
fn modem_lines_of_the_server_do_not_lose_the_link() {
    let server = start(&Machine::default());
    let mut bench = Bench::start();
    let lane = add(&mut bench, server.address(), device_options("9600"));
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    for on in [ModemLines::CTS, ModemLines::DSR, ModemLines::default()] {
        server.inject(Signal::ModemLines { lines: ModemLines(0x0F), on });
    }
    bench.send(lane, JobId(1), b"M30");
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
    assert!(server.wait_until(PATIENCE, |seen| seen.contains(&Seen::Connected)));
    assert_eq!(bench.figures(lane).opened, 1);
}
