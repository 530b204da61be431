//! A line between the command and a foreign program: a pty for the command, pipes for the
//! program, and a relay between them, which can flip, drop and double what passes.
//!
//! The program has no pty: it would flush its last answer when it ends, before a relay that has
//! to wait for its turn has read it. One that works with a port alone has a pty too ([`Line::ports`]).

use std::io::{Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;

/// How often something happens to a byte on its way: once in so many, by chance; 0 is never.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Faults {
    pub(crate) seed: u64,
    pub(crate) flips: u64,
    pub(crate) drops: u64,
    pub(crate) doubles: u64,
}

/// The line, while it is there.
pub(crate) struct Line {
    pty: Arc<PtyPair>,
    to_us: Faults,
    to_them: Faults,
}

/// The relay of a line, running.
pub(crate) struct Relay {
    ends: Arc<AtomicBool>,
    to_us: JoinHandle<u64>,
    to_them: JoinHandle<u64>,
}

impl Line {
    pub(crate) fn new(to_us: Faults, to_them: Faults) -> Self {
        Self { pty: Arc::new(PtyPair::open().unwrap()), to_us, to_them }
    }

    /// The port for the command.
    pub(crate) fn port(&self) -> String {
        self.pty.slave_path().display().to_string()
    }

    /// Starts a foreign program at the other end.
    pub(crate) fn start(self, command: &mut Command) -> (Child, Relay) {
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = child.spawn().unwrap_or_else(|error| panic!("{command:?}: {error}"));
        let (stdin, stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let ends = Arc::new(AtomicBool::new(false));
        let (pty, is_over) = (Arc::clone(&self.pty), Arc::clone(&ends));
        let to_them =
            std::thread::spawn(move || to_them(&pty, stdin, Chance::new(self.to_them), &is_over));
        let to_us = std::thread::spawn(move || to_us(&self.pty, stdout, Chance::new(self.to_us)));
        (child, Relay { ends, to_us, to_them })
    }
}

/// A line with a pty at each end, and its relay.
pub(crate) struct Ports {
    pub(crate) ours: String,
    pub(crate) theirs: String,
    ends: Arc<AtomicBool>,
    relays: [JoinHandle<u64>; 2],
}

impl Line {
    /// The line for a program that wants a port.
    pub(crate) fn ports(self) -> Ports {
        let theirs = Arc::new(PtyPair::open().unwrap());
        let ends = Arc::new(AtomicBool::new(false));
        let relay = |from: &Arc<PtyPair>, to: &Arc<PtyPair>, faults| {
            let (from, to, is_over) = (Arc::clone(from), Arc::clone(to), Arc::clone(&ends));
            std::thread::spawn(move || between(&from, &to, Chance::new(faults), &is_over))
        };
        let relays =
            [relay(&theirs, &self.pty, self.to_us), relay(&self.pty, &theirs, self.to_them)];
        let path = |pty: &PtyPair| pty.slave_path().display().to_string();
        Ports { ours: path(&self.pty), theirs: path(&theirs), ends, relays }
    }
}

impl Ports {
    /// Ends the relay, when both ends are done; returns the number of faults.
    pub(crate) fn end(self) -> u64 {
        self.ends.store(true, Ordering::Relaxed);
        self.relays.into_iter().map(|relay| relay.join().unwrap()).sum()
    }
}

impl Relay {
    /// Ends it, when the program has ended and all of it has been passed on; returns the number
    /// of faults.
    pub(crate) fn end(self) -> u64 {
        let to_us = self.to_us.join().unwrap();
        self.ends.store(true, Ordering::Relaxed);
        to_us + self.to_them.join().unwrap()
    }
}

/// From the program to the command, until the program has ended.
fn to_us(pty: &PtyPair, mut program: ChildStdout, mut chance: Chance) -> u64 {
    let mut buffer = [0; 2_048];
    loop {
        let count = program.read(&mut buffer).unwrap();
        if count == 0 {
            return chance.faults;
        }
        write(pty, &chance.spoil(&buffer[..count]));
    }
}

/// From the command to the program.
fn to_them(
    pty: &PtyPair,
    mut program: ChildStdin,
    mut chance: Chance,
    is_over: &AtomicBool,
) -> u64 {
    while !is_over.load(Ordering::Relaxed) {
        let bytes = read(pty);
        if bytes.is_empty() {
            sleep(Duration::from_micros(100));
            continue;
        }
        // The program forgets its input behind each answer: on a wire nothing is as fast.
        sleep(Duration::from_millis(1));
        // One that has ended hears nothing any more.
        let _ = program.write_all(&chance.spoil(&bytes));
    }
    chance.faults
}

/// From one pty to the other.
fn between(from: &PtyPair, to: &PtyPair, mut chance: Chance, is_over: &AtomicBool) -> u64 {
    while !is_over.load(Ordering::Relaxed) {
        let bytes = read(from);
        if bytes.is_empty() {
            sleep(Duration::from_micros(100));
        } else {
            write(to, &chance.spoil(&bytes));
        }
    }
    chance.faults
}

fn read(pty: &PtyPair) -> Vec<u8> {
    let mut buffer = [0; 2_048];
    match pty.read(&mut buffer).unwrap() {
        ReadOutcome::Read(count) => buffer[..count].to_vec(),
        _ => Vec::new(),
    }
}

fn write(pty: &PtyPair, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        let count = pty.write(bytes).unwrap();
        bytes = &bytes[count..];
        if count == 0 {
            sleep(Duration::from_micros(200));
        }
    }
}

/// What happens next to the bytes of one direction.
struct Chance {
    faults_to_make: Faults,
    state: u64,
    faults: u64,
}

impl Chance {
    fn new(faults_to_make: Faults) -> Self {
        Self { faults_to_make, state: faults_to_make.seed, faults: 0 }
    }

    /// `SplitMix64`.
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.state;
        mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    fn is_time(&mut self, once_in: u64) -> bool {
        let is_time = once_in > 0 && self.next().is_multiple_of(once_in);
        self.faults += u64::from(is_time);
        is_time
    }

    fn spoil(&mut self, bytes: &[u8]) -> Vec<u8> {
        let Faults { flips, drops, doubles, .. } = self.faults_to_make;
        let mut spoilt = Vec::with_capacity(bytes.len() + 4);
        for byte in bytes {
            if self.is_time(drops) {
                continue;
            }
            let bit = if self.is_time(flips) { 1 << (self.next() % 8) } else { 0 };
            spoilt.push(byte ^ bit);
            if self.is_time(doubles) {
                spoilt.push(byte ^ bit);
            }
        }
        spoilt
    }
}

/// A file that no padding ends.
pub(crate) fn file(length: usize) -> Vec<u8> {
    let mut chance = Chance::new(Faults { seed: 1, ..Faults::default() });
    let mut file: Vec<u8> = (0..length).map(|_| chance.next() as u8).collect();
    file.extend(b"\n%\n");
    file
}
