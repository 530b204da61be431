//! TLS between gateway and unit: a job through it, and who is turned away.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;

use softplug_live::reactor::JobOutcome;
use softplug_live::units::{TlsKeys, TlsPrivateKey, TlsPublicKey};
use tempfile::TempDir;

use crate::machine::Machine;
use crate::shop::{PATIENCE, Shop, down, ended, program};

/// Keys of both, and of somebody else.
struct Keys {
    folder: TempDir,
    unit: TlsPrivateKey,
    gateway: TlsPrivateKey,
    other: TlsPrivateKey,
}

impl Keys {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str| TlsPrivateKey::make(&folder.path().join(name)).unwrap();
        let (unit, gateway, other) = (make("unit.key"), make("gateway.key"), make("other.key"));
        Self { folder, unit, gateway, other }
    }

    /// The table of `unit.toml`.
    fn of_unit(&self) -> String {
        table(&self.folder.path().join("unit.key"), self.gateway.public())
    }

    fn of_gateway(&self) -> TlsKeys {
        TlsKeys::of_gateway(&self.gateway, &[self.unit.public()])
    }

    /// Each has the other's.
    fn shop(&self, machine: Machine) -> Shop {
        Shop::with_tls(machine, &self.of_unit(), Some(self.of_gateway()))
    }
}

fn table(key: &Path, gateway: TlsPublicKey) -> String {
    format!("[tls]\nkey = \"{}\"\ngateways = [\"{gateway}\"]", key.display())
}

/// A connection to a unit, on which this was said.
fn caller(unit: SocketAddr, says: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(unit).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.write_all(says).unwrap();
    stream
}

/// What it hears until the unit has closed it.
fn heard(mut stream: TcpStream) -> Vec<u8> {
    let mut heard = Vec::new();
    match stream.read_to_end(&mut heard) {
        Err(error) if error.kind() != std::io::ErrorKind::ConnectionReset => panic!("{error}"),
        _ => heard,
    }
}

#[test]
fn a_job_through_tls_arrives_and_nothing_of_it_can_be_read_on_the_way() {
    let mut shop = Keys::new().shop(Machine::fast());
    shop.until_up();
    let program = program(60_000);
    let end = shop.send(1, &program);
    assert_eq!((end.outcome, end.taken), (JobOutcome::Done, 60_000));
    shop.until_received(&program);
    let wire = shop.cable.wire();
    assert!(wire.len() > 60_000);
    let line = b"N1000 G1 X1000";
    assert!(program.windows(line.len()).any(|part| part == line));
    assert!(!wire.windows(4).any(|part| part == b" G1 "));
}

#[test]
fn the_cable_is_out_five_times_in_mid_job_and_nothing_is_lost_or_doubled() {
    let mut shop = Keys::new().shop(Machine::at(115_200));
    shop.until_up();
    let program = program(60_000);
    shop.begin(1, &program);
    for cut in 1..=5_usize {
        shop.until(|shop| shop.received().len() >= cut * 10_000);
        shop.cable.cut();
    }
    assert_eq!(shop.until_report(ended).outcome, JobOutcome::Done);
    shop.until_received(&program);
}

#[test]
fn bytes_that_were_altered_on_the_way_end_the_connection_and_reach_nobody() {
    let mut shop = Keys::new().shop(Machine::at(115_200));
    shop.until_up();
    let program = program(40_000);
    shop.begin(1, &program);
    for altered in 1..=3_usize {
        shop.until(|shop| shop.received().len() >= altered * 10_000);
        shop.cable.alter(true);
        shop.until(|shop| !shop.cable.alter(false));
    }
    assert_eq!(shop.until_report(ended).outcome, JobOutcome::Done);
    shop.until_received(&program);
}

#[test]
fn what_the_machine_sends_arrives_through_tls() {
    let mut shop = Keys::new().shop(Machine::fast());
    shop.until_up();
    let program = program(40_000);
    let punched = program.clone();
    shop.machine.tell(move |now, control| control.punch(now, punched));
    shop.until(|shop| shop.arrived().len() >= 40_000);
    shop.until_report(crate::shop::delivered);
    assert_eq!(shop.arrived(), program);
}

#[test]
fn a_unit_with_another_key_is_told_with_both_and_gets_nothing() {
    let keys = Keys::new();
    let gateway = TlsKeys::of_gateway(&keys.gateway, &[keys.other.public()]);
    let mut shop = Shop::with_tls(Machine::fast(), &keys.of_unit(), Some(gateway));
    let why = shop.until_report(down);
    let (got, expected) = (keys.unit.public(), keys.other.public());
    assert!(why.contains(&format!("has the key {got}, and not {expected}")), "{why}");
    assert_eq!(shop.erases(), [0, 0]);
}

#[test]
fn a_gateway_with_another_key_is_told_so_and_is_not_heard() {
    let keys = Keys::new();
    let gateway = TlsKeys::of_gateway(&keys.other, &[keys.unit.public()]);
    let mut shop = Shop::with_tls(Machine::fast(), &keys.of_unit(), Some(gateway));
    let own = keys.other.public();
    let says = format!("does not know this side's key {own}");
    shop.until_report(|report| down(report).filter(|why| why.contains(&says)));
    assert_eq!(shop.erases(), [0, 0]);
}

#[test]
fn a_gateway_without_tls_is_told_that_the_unit_wants_it() {
    let keys = Keys::new();
    let mut shop = Shop::with_tls(Machine::fast(), &keys.of_unit(), None);
    let says = "speaks TLS, and no key is configured for it here";
    shop.until_report(|report| down(report).filter(|why| why.contains(says)));
    assert_eq!(shop.erases(), [0, 0]);
}

#[test]
fn a_unit_without_tls_is_not_spoken_to_in_the_clear() {
    let keys = Keys::new();
    let mut shop = Shop::with_tls(Machine::fast(), "", Some(keys.of_gateway()));
    let why = shop.until_report(down);
    assert!(
        why.contains("in the handshake of TLS: it may know no TLS; another gateway may drive it"),
        "{why}"
    );
    assert_eq!(shop.erases(), [0, 0]);
}

#[test]
fn garbage_ends_a_connection_and_silence_keeps_nobody_out() {
    let keys = Keys::new();
    let mut shop = keys.shop(Machine::fast());
    shop.until_up();
    shop.stop_gateway();
    let unit = shop.cable.address();
    // An alert at most, and then the end.
    for garbage in [&b"GET / HTTP/1.1\r\n\r\n"[..], &[0xFF; 5_000], &[1, 1, 34, 0, 0, 0, 0, 0]] {
        assert!(heard(caller(unit, garbage)).len() < 100);
    }
    // The beginning of a handshake, and no more of it; nothing at all.
    let silent: Vec<_> = (0..20).map(|_| caller(unit, b"\x16\x03\x01\x01\x00\x01")).collect();
    let mute: Vec<_> = (0..20).map(|_| caller(unit, b"")).collect();
    shop.restart_gateway();
    shop.until_up();
    assert_eq!(shop.send(1, b"G1 X1\n").outcome, JobOutcome::Done);
    shop.until_received(b"G1 X1\n");
    silent.into_iter().chain(mute).for_each(|stream| assert!(heard(stream).len() < 100));
}

#[test]
fn who_stalls_in_the_handshake_is_sent_away() {
    let keys = Keys::new();
    let mut shop = keys.shop(Machine::fast());
    shop.until_up();
    shop.stop_gateway();
    // No gateway comes in whose session would send it away.
    assert!(heard(caller(shop.cable.address(), b"\x16\x03\x01\x01\x00\x01")).len() < 100);
}

/// TLS shows who is there, and not that what it says is the unit protocol.
#[test]
fn a_gateway_that_is_known_and_goes_leaves_the_unit_free() {
    let keys = Keys::new();
    let mut shop = keys.shop(Machine::fast());
    for _ in 0..3 {
        shop.until_up();
        shop.restart_gateway();
    }
    shop.until_up();
    assert_eq!(shop.send(1, b"G1 X1\n").outcome, JobOutcome::Done);
}
