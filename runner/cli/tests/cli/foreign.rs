//! A line between the command and a foreign program: two ptys and a relay, which can flip,
//! drop and double what passes.

use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use softplug_gateway::port::ReadOutcome;
use softplug_gateway::pty::PtyPair;

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
    ours: PtyPair,
    theirs: PtyPair,
    to_us: Faults,
    to_them: Faults,
}

/// The relay of a line, running.
pub(crate) struct Relay {
    ends: Arc<AtomicBool>,
    thread: JoinHandle<u64>,
}

impl Line {
    pub(crate) fn new(to_us: Faults, to_them: Faults) -> Self {
        let pair = || PtyPair::open().unwrap();
        Self { ours: pair(), theirs: pair(), to_us, to_them }
    }

    /// The port for the command.
    pub(crate) fn port(&self) -> String {
        self.ours.slave_path().display().to_string()
    }

    /// Starts a foreign program with the line as its standard input and output.
    pub(crate) fn start(&self, command: &mut Command) -> Child {
        let open = || {
            let mut options = std::fs::OpenOptions::new();
            OwnedFd::from(options.read(true).write(true).open(self.theirs.slave_path()).unwrap())
        };
        let child = command.stdin(open()).stdout(open()).stderr(Stdio::piped()).spawn();
        child.unwrap_or_else(|error| panic!("{command:?}: {error}"))
    }

    pub(crate) fn relay(self) -> Relay {
        let ends = Arc::new(AtomicBool::new(false));
        let is_over = Arc::clone(&ends);
        let thread = std::thread::spawn(move || self.pass_on(&is_over));
        Relay { ends, thread }
    }

    /// Passes on until it is told to end; returns the number of faults.
    fn pass_on(self, is_over: &AtomicBool) -> u64 {
        let mut chances = [self.to_us, self.to_them].map(Chance::new);
        let [to_us, to_them] = &mut chances;
        let mut is_last = false;
        loop {
            let has_passed = pass(&self.theirs, &self.ours, to_us);
            let to_pass = read(&self.ours);
            if !to_pass.is_empty() {
                // The program empties its input behind each answer: on a wire nothing is as fast.
                sleep(Duration::from_millis(1));
                write(&self.theirs, &to_them.spoil(&to_pass));
            }
            if has_passed || !to_pass.is_empty() {
                continue;
            }
            if is_last {
                return chances.iter().map(|chance| chance.faults).sum();
            }
            is_last = is_over.load(Ordering::Relaxed);
            sleep(Duration::from_micros(100));
        }
    }
}

impl Relay {
    /// Ends it, when all has been passed on; returns the number of faults.
    pub(crate) fn end(self) -> u64 {
        self.ends.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

fn pass(from: &PtyPair, to: &PtyPair, chance: &mut Chance) -> bool {
    let bytes = read(from);
    write(to, &chance.spoil(&bytes));
    !bytes.is_empty()
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
