//! Lines of 9,600 baud, filled both ways; each byte is looked at. Before that, [`run`] has only
//! the machines send: what all else computes then is for the harness's own bytes.

use std::io::{Read, Write};
use std::os::fd::{AsFd, AsRawFd};
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use mio::unix::SourceFd;
use mio::{Events, Interest, Poll, Token};
use serde_json::{Value, json};
use softplug_live::ReadOutcome;
use softplug_live::pty::PtyPair;

use super::Outcome;
use super::subject::{Subject, connect};
use super::used::{Used, resident};

pub const BAUD: u32 = 9_600;
/// Only the machines send, to settle and then to be measured.
const SETTLE: Duration = Duration::from_secs(1);
const MACHINES_ALONE: Duration = Duration::from_secs(5);
/// Until all buffers are as full as they get.
const WARM: Duration = Duration::from_secs(5);

/// How often the harness looks what has come.
const LOOK: Duration = Duration::from_millis(2);

/// How far a line's two streams are, sent and received at each end.
struct Filled {
    client: TcpStream,
    to_machine: (u64, u64),
    to_client: (u64, u64),
}

/// All lines, and how many bytes were not what they should have been.
struct Lines<'a> {
    links: Vec<Filled>,
    machines: &'a [PtyPair],
    clients_send: bool,
    wrong: u64,
    buffer: Box<[u8]>,
}

pub fn run(subject: &Subject, machines: &[PtyPair], span: Duration) -> Outcome<Value> {
    let mut harness = Harness::new(subject, machines)?;
    let others = harness.machines_alone()?;
    let mut result = harness.both_ways(span)?;
    result["other_cpu_percent_for_machines"] = others.into();
    Ok(result)
}

/// Fills the lines both ways from the beginning.
pub fn both_ways(subject: &Subject, machines: &[PtyPair], span: Duration) -> Outcome<Value> {
    Harness::new(subject, machines)?.both_ways(span)
}

/// Plays the machines and the clients.
struct Harness<'a> {
    subject: &'a Subject,
    lines: Lines<'a>,
    poll: Poll,
    events: Events,
    begin: Instant,
    /// Milliseconds of which the machines have sent their part.
    turn: u64,
}

impl<'a> Harness<'a> {
    fn new(subject: &'a Subject, machines: &'a [PtyPair]) -> Outcome<Self> {
        let poll = Poll::new()?;
        let lines = Lines::new(&poll, subject, machines)?;
        let events = Events::with_capacity(1_024);
        Ok(Self { subject, lines, poll, events, begin: Instant::now(), turn: 0 })
    }

    /// What all else than the subject and the harness computes while only the machines send.
    fn machines_alone(&mut self) -> Outcome<f64> {
        self.run(SETTLE)?;
        let before = Used::now(self.subject.pid())?;
        self.run(MACHINES_ALONE)?;
        Ok(Used::now(self.subject.pid())?.since(&before, MACHINES_ALONE).others)
    }

    fn both_ways(&mut self, span: Duration) -> Outcome<Value> {
        self.lines.clients_begin();
        self.run(WARM)?;
        let pid = self.subject.pid();
        let (used, before, since) = (Used::now(pid)?, self.lines.received(), Instant::now());
        self.run(span)?;
        let span = since.elapsed();
        let used = Used::now(pid)?.since(&used, span);
        let after = self.lines.received();
        let count = self.lines.links.len();
        let rate = |bytes: u64| bytes as f64 / span.as_secs_f64() / count as f64;
        let grown = resident(pid)?.saturating_sub(self.subject.before);
        Ok(json!({
            "links": count,
            "wrong_bytes": self.lines.wrong,
            "to_machine_bytes": after.0,
            "to_client_bytes": after.1,
            "to_machine_bytes_per_second": rate(after.0 - before.0),
            "to_client_bytes_per_second": rate(after.1 - before.1),
            "cpu_percent": used.subject,
            "other_cpu_percent": used.others,
            "resident_grown_kib": grown / 1_024,
        }))
    }

    fn run(&mut self, span: Duration) -> Outcome {
        let end = Instant::now() + span;
        while Instant::now() < end {
            // Each machine sends what its line can carry, a hundredth of them at a time.
            while self.begin.elapsed() >= Duration::from_millis(self.turn) {
                self.lines.machines_send(self.turn)?;
                self.turn += 1;
            }
            // Nobody waits for events: to wake the harness for each would be the kernel's work.
            std::thread::sleep(LOOK);
            self.poll.poll(&mut self.events, Some(Duration::ZERO))?;
            for event in &self.events {
                let at = event.token().0 / 2;
                if event.token().0 % 2 == 1 {
                    self.lines.machine_reads(at)?;
                } else {
                    self.lines.client_reads_and_writes(at);
                }
            }
        }
        Ok(())
    }
}

impl<'a> Lines<'a> {
    fn new(poll: &Poll, subject: &Subject, machines: &'a [PtyPair]) -> Outcome<Self> {
        let mut links = Vec::new();
        for (at, (machine, address)) in machines.iter().zip(&subject.addresses).enumerate() {
            let mut client = connect(*address)?;
            let both = Interest::READABLE | Interest::WRITABLE;
            poll.registry().register(&mut client, Token(2 * at), both)?;
            let fd = machine.master().as_fd().as_raw_fd();
            let machine = Token(2 * at + 1);
            poll.registry().register(&mut SourceFd(&fd), machine, Interest::READABLE)?;
            links.push(Filled { client, to_machine: (0, 0), to_client: (0, 0) });
        }
        Ok(Self { links, machines, clients_send: false, wrong: 0, buffer: vec![0; 4_096].into() })
    }

    /// Bytes that have come to the machines and to the clients.
    fn received(&self) -> (u64, u64) {
        let sum = |of: fn(&Filled) -> u64| self.links.iter().map(of).sum();
        (sum(|link| link.to_machine.1), sum(|link| link.to_client.1))
    }

    fn clients_begin(&mut self) {
        self.clients_send = true;
        (0..self.links.len()).for_each(|at| self.client_reads_and_writes(at));
    }

    fn machines_send(&mut self, turn: u64) -> Outcome {
        for at in (0..self.links.len()).filter(|at| *at as u64 % 100 == turn % 100) {
            let sent = &mut self.links[at].to_client.0;
            let bytes = stream(*sent, BAUD as usize / 100);
            *sent += self.machines[at].write(&bytes)? as u64;
        }
        Ok(())
    }

    fn machine_reads(&mut self, at: usize) -> Outcome {
        let received = &mut self.links[at].to_machine.1;
        while let ReadOutcome::Read(count) = self.machines[at].read(&mut self.buffer)? {
            // Control codes are the gateway's own.
            for heard in self.buffer[..count].iter().filter(|heard| **heard >= b' ') {
                self.wrong += u64::from(*heard != byte(*received));
                *received += 1;
            }
        }
        Ok(())
    }

    fn client_reads_and_writes(&mut self, at: usize) {
        let link = &mut self.links[at];
        while let Ok(count @ 1..) = link.client.read(&mut self.buffer) {
            for heard in &self.buffer[..count] {
                self.wrong += u64::from(*heard != byte(link.to_client.1));
                link.to_client.1 += 1;
            }
        }
        if !self.clients_send {
            return;
        }
        while let Ok(count) = link.client.write(&stream(link.to_machine.0, 4_096)) {
            link.to_machine.0 += count as u64;
        }
    }
}

/// A stream whose every byte is known; none is a control code.
fn byte(at: u64) -> u8 {
    b' ' + (at % 95) as u8
}

fn stream(from: u64, bytes: usize) -> Vec<u8> {
    (from..).map(byte).take(bytes).collect()
}
