//! Transfers over a pty, with the far end played by the test.

#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::{self, Cursor, Read, Write};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, LineParameters};
use softplug_live::pty::PtyPair;
use softplug_live::station::{Station, StationOptions};
use softplug_live::store::{Inbox, Mark};
use softplug_live::transfer::{
    Delivered, News, ReceiveOutcome, Reply, Request, SendOptions, SendOutcome, ServeEnd,
    ServeHandler, ServeOptions, receive, send, serve,
};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_native::{NativeInstance, NativePlugin};

/// A station on the slave of a pty, and the master.
fn pair(baud: u32, asked: &[(&str, &str)]) -> (Station<NativeInstance>, PtyPair) {
    pair_with(NativePlugin::XonXoff, baud, asked)
}

fn pair_with(
    plugin: NativePlugin,
    baud: u32,
    asked: &[(&str, &str)],
) -> (Station<NativeInstance>, PtyPair) {
    let mut pair = PtyPair::open().unwrap();
    let spec = PortSpec::Device(pair.slave_path().to_owned());
    let port = Port::open(&spec, &PortOptions::new(LineParameters::new(baud))).unwrap();
    // From now on only the port holds the slave.
    pair.release_slave();
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
    let settings = manifest.resolve_settings(asked.iter().copied()).unwrap();
    let options = StationOptions { settings, ..StationOptions::default() };
    (Station::new(port, plugin.instantiate(), options).unwrap(), pair)
}

/// Stops a transfer that hangs, so that the test fails instead.
fn watchdog() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let watched = Arc::clone(&stop);
    thread::spawn(move || {
        thread::park_timeout(Duration::from_mins(1));
        watched.store(true, Ordering::Relaxed);
    });
    stop
}

fn pause(millis: i64) {
    let span = Timespec { tv_sec: 0, tv_nsec: millis * 1_000_000 };
    let _ = poll(&mut [], Some(&span));
}

/// Reads from the master until `count` bytes have come.
fn read_from(pair: &PtyPair, count: usize) -> Vec<u8> {
    let mut master = File::from(pair.master().as_fd().try_clone_to_owned().unwrap());
    let mut received = vec![0; count];
    let mut at = 0;
    while at < count {
        let _ = poll(&mut [PollFd::new(&master, PollFlags::IN)], None);
        match master.read(&mut received[at..]) {
            Ok(read) => at += read,
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(error) => panic!("{error}"),
        }
    }
    received
}

#[test]
fn what_has_begun_may_take_longer_than_the_wait_for_it() {
    let end = [("quiet_time", "20000"), ("end_mark", "25"), ("end_quiet", "200")];
    let (mut station, pair) = pair(115_200, &end);
    let mut master = File::from(pair.master().as_fd().try_clone_to_owned().unwrap());
    master.write_all(b"N10 G1 X1\n").unwrap();
    let far = thread::spawn(move || {
        for _ in 0..20 {
            pause(20);
            master.write_all(b"N10 G1 X1\n").unwrap();
        }
        master.write_all(b"%").unwrap();
        pair
    });
    let mut out = Vec::new();
    let give_up = Some(Duration::from_millis(100));
    let report = receive(&mut station, &mut out, None, give_up, &watchdog(), &mut |_| {}).unwrap();
    assert_eq!(report.outcome, ReceiveOutcome::Complete);
    assert_eq!(out, [&b"N10 G1 X1\n".repeat(21)[..], b"%"].concat());
    drop(far.join().unwrap());
}

#[test]
fn a_wait_for_nothing_ends() {
    let (mut station, _pair) = pair(115_200, &[]);
    let give_up = Some(Duration::from_millis(50));
    let report =
        receive(&mut station, &mut Vec::new(), None, give_up, &watchdog(), &mut |_| {}).unwrap();
    assert_eq!(report.outcome, ReceiveOutcome::NothingCame);
    assert_eq!(report.bytes, 0);
}

/// A machine that sends what begins no program for longer than the wait, and then one.
fn late_program(pair: PtyPair) -> thread::JoinHandle<PtyPair> {
    let mut master = File::from(pair.master().as_fd().try_clone_to_owned().unwrap());
    thread::spawn(move || {
        for _ in 0..60 {
            master.write_all(b"\0").unwrap();
            pause(50);
        }
        master.write_all(b"\x12%\nO1\n%\n\x14").unwrap();
        pair
    })
}

#[test]
fn the_wait_begins_anew_with_each_character() {
    let give_up = Some(Duration::from_secs(2));
    let (mut station, pair) = pair_with(NativePlugin::FanucRs232, 115_200, &[]);
    let far = late_program(pair);
    let mut out = Vec::new();
    let report = receive(&mut station, &mut out, None, give_up, &watchdog(), &mut |_| {}).unwrap();
    assert_eq!((report.outcome, &out[..]), (ReceiveOutcome::Complete, &b"%\nO1\n%\n"[..]));
    drop(far.join().unwrap());

    let folder = tempfile::tempdir().unwrap();
    let (mut station, pair) = pair_with(NativePlugin::FanucRs232, 115_200, &[]);
    let far = late_program(pair);
    let mut served = Folder(Inbox::new(folder.path()).unwrap());
    let options = ServeOptions { give_up_after: give_up, deliveries: Some(1) };
    let report = serve(&mut station, &mut served, &options, &watchdog(), &mut |_| {}).unwrap();
    assert_eq!((report.end, report.complete), (ServeEnd::Enough, 1));
    drop(far.join().unwrap());
}

/// All that comes goes into a folder.
struct Folder(Inbox);

impl ServeHandler for Folder {
    fn begin(&mut self) -> io::Result<()> {
        self.0.begin()
    }

    fn deliver(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn end(&mut self, _: &Delivered) -> io::Result<()> {
        self.0.end(None, Mark::Complete).map(drop)
    }

    fn asked(&mut self, _: &Request) -> Reply {
        Reply::Refused(Failure::NotFound)
    }

    fn tell(&mut self, _: &News<'_>) {}
}

#[test]
fn an_unplugged_port_fails_the_job_and_says_how_far_it_came() {
    let (mut station, pair) = pair(9_600, &[]);
    let program = b"N10 G1 X1\n".repeat(1_000);
    let far = thread::spawn(move || {
        let first = read_from(&pair, 100);
        drop(pair);
        first
    });
    let options = SendOptions { check: true, ..SendOptions::default() };
    let mut source = Cursor::new(&program);
    let report = send(&mut station, &mut source, &options, &watchdog(), &mut |_| {}).unwrap();
    let failure = Failure::LinkDown;
    assert_eq!(report.outcome, SendOutcome::Failed { failure, status: 0 });
    // The other end has 100, and of the last of them the line's rate is not sure yet.
    assert!(report.left.maybe >= 100 && report.sent <= report.left.surely, "{:?}", report.left);
    assert!((84..program.len() as u64).contains(&report.sent), "{} sent", report.sent);
    assert!(far.join().unwrap() == program[..100]);
}

#[test]
fn an_abort_sends_the_last_words_and_nothing_else() {
    let (mut station, pair) = pair(9_600, &[("abort_send", "18 25")]);
    let program = b"N10 G1 X1\n".repeat(1_000);
    let stop = Arc::new(AtomicBool::new(false));
    let stopper = Arc::clone(&stop);
    let far = thread::spawn(move || {
        let first = read_from(&pair, 50);
        stopper.store(true, Ordering::Relaxed);
        (first, pair, Instant::now())
    });
    let options = SendOptions { check: true, ..SendOptions::default() };
    let mut source = Cursor::new(&program);
    let report = send(&mut station, &mut source, &options, &stop, &mut |_| {}).unwrap();
    assert_eq!(report.outcome, SendOutcome::Aborted);
    let (mut received, pair, stopped) = far.join().unwrap();
    // It waits for its last words to leave, a few ms, and not for as long as they may take: 2 s.
    assert!(stopped.elapsed() < Duration::from_millis(1_900), "it took {:?}", stopped.elapsed());
    let rest = usize::try_from(report.sent).unwrap() + 2 - received.len();
    received.extend(read_from(&pair, rest));
    let (sent, last_words) = received.split_at(received.len() - 2);
    assert!(sent == &program[..sent.len()], "what was sent is not the program's beginning");
    assert_eq!(last_words, [0x18, 0x25]);
}
