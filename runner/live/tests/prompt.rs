//! A partner of 3964R that answers at once, and a thread of ours that is late at every turn: no
//! block that was right is refused, no set-up attempt is spent. `SOFTPLUG_PROMPT_BLOCKS=N` takes
//! N blocks each way on each kind of port; without it there are some hundred.
#![cfg(target_os = "linux")]

mod late;
mod partner;

use std::fs::File;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

use late::{Late, Link};
use partner::{Prompt, block};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use softplug_abi::{LineParameters, Micros};
use softplug_live::device_server::DeviceServer;
use softplug_live::pty::PtyPair;
use softplug_live::{Port, PortOptions, PortSpec};

/// Blocks each way, if nothing else is asked for.
const BLOCKS: u64 = 120;

fn blocks() -> u64 {
    std::env::var("SOFTPLUG_PROMPT_BLOCKS").map_or(BLOCKS, |blocks| blocks.parse().unwrap())
}

fn open(spec: &PortSpec) -> Port {
    Port::open(spec, &PortOptions::new(LineParameters::new(921_600))).unwrap()
}

/// Answers on a stream, byte by byte, until it ends.
fn answer(prompt: &Prompt, mut from: impl Read, mut to: impl Write) {
    let mut buffer = [0; 512];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        for byte in &buffer[..count] {
            let answer = prompt.take(*byte);
            if to.write_all(&answer).is_err() {
                return;
            }
            if !answer.is_empty() {
                prompt.has_answered();
            }
        }
    }
}

/// The slave of a pty for us, its master for the partner.
fn on_a_pty(prompt: &Prompt) -> (Port, File) {
    let mut pair = PtyPair::open().unwrap();
    let master = File::from(pair.master().try_clone().unwrap());
    let flags = fcntl_getfl(&master).unwrap();
    fcntl_setfl(&master, flags & !OFlags::NONBLOCK).unwrap();
    let port = open(&PortSpec::Device(pair.slave_path().to_owned()));
    pair.release_slave();
    let (prompt, far) = (prompt.clone(), master.try_clone().unwrap());
    thread::spawn(move || answer(&prompt, &far, &far));
    (port, master)
}

fn over_tcp(prompt: &Prompt) -> Port {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let port = open(&PortSpec::Tcp { host: "127.0.0.1".into(), port: address.port() });
    let stream: TcpStream = listener.accept().unwrap().0;
    stream.set_nodelay(true).unwrap();
    let prompt = prompt.clone();
    thread::spawn(move || answer(&prompt, &stream, &stream));
    port
}

/// Each block is answered, and the partner's own begins with the byte behind the answer.
fn exchange(port: Port, prompt: &Prompt, blocks: u64) {
    let mut late = Late::new(50_000, prompt);
    let mut link = Link::open(port, &mut late, &[]);
    let mut slowest = Duration::ZERO;
    for n in 0..blocks {
        prompt.expect(block(n, true), block(n, false));
        link.begin(&mut late, &block(n, true));
        let is_delivered = |late: &Late| late.ended.is_some() && late.deliveries == n + 1;
        link.until(&mut late, |late| is_delivered(late) && prompt.is_over());
        late.check(n, &block(n, false));
        prompt.check(n);
        slowest = slowest.max(prompt.slowest());
    }
    println!("{blocks} blocks each way; an answer took {slowest:?} at most");
    link.close(&mut late);
}

#[test]
fn nothing_is_refused_on_a_pty() {
    let prompt = Prompt::default();
    let (port, _master) = on_a_pty(&prompt);
    exchange(port, &prompt, blocks());
}

#[test]
fn nothing_is_refused_over_tcp() {
    let prompt = Prompt::default();
    exchange(over_tcp(&prompt), &prompt, blocks());
}

#[test]
fn nothing_is_refused_behind_a_device_server() {
    let prompt = Prompt::default();
    let server = DeviceServer::start("127.0.0.1:0".parse().unwrap(), prompt.clone()).unwrap();
    let port = server.address().port();
    exchange(open(&PortSpec::Rfc2217 { host: "127.0.0.1".into(), port }), &prompt, blocks());
}

/// The answer comes in time, and the thread only when the time for it is over.
#[test]
fn an_answer_that_waits_to_be_read_is_in_time() {
    for asks_first in [false, true] {
        let prompt = Prompt::default();
        let (port, mut master) = on_a_pty(&prompt);
        let mut late = Late::new(0, &prompt);
        let mut link = Link::open(port, &mut late, &[("qvz", "500")]);
        prompt.expect(block(7, true), Vec::new());
        prompt.hold(true);
        link.begin(&mut late, &block(7, true));
        let deadline = link.until_waiting(&mut late);
        let held = prompt.held();
        assert_eq!(held, [0x10], "the partner has not heard STX");
        master.write_all(&held).unwrap();
        assert!(link.clock.now() < deadline, "the test itself was too late");
        prompt.hold(false);
        while link.clock.now() < deadline + Micros::from_millis(20) {
            thread::sleep(Duration::from_millis(5));
        }
        if asks_first {
            // A request of the host lets the time run out no more than anything else.
            link.resume(&mut late);
        }
        link.until(&mut late, |late| late.ended.is_some() && prompt.is_over());
        late.check(0, &[]);
        prompt.check(7);
        link.close(&mut late);
    }
}
