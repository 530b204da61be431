//! Lines of 9,600 baud, filled both ways; each byte is looked at.

use std::io::{Read, Write};
use std::os::fd::{AsFd, AsRawFd};
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use mio::unix::SourceFd;
use mio::{Events, Interest, Poll, Token};
use softplug_gateway::ReadOutcome;
use softplug_gateway::pty::PtyPair;

use super::Outcome;
use super::subject::{Subject, connect};
use super::used::{Used, resident};

pub const BAUD: u32 = 9_600;
/// Until all buffers are as full as they get.
const WARM: Duration = Duration::from_secs(5);

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
    wrong: u64,
    buffer: Box<[u8]>,
}

pub fn run(subject: &Subject, machines: &[PtyPair], span: Duration) -> Outcome<serde_json::Value> {
    let mut poll = Poll::new()?;
    let mut lines = Lines::new(&poll, subject, machines)?;
    let mut events = Events::with_capacity(1_024);
    let (begin, mut turn, mut start) = (Instant::now(), 0, None);
    while begin.elapsed() < WARM + span {
        if start.is_none() && begin.elapsed() >= WARM {
            start = Some((Used::now(subject.pid())?, lines.received(), Instant::now()));
        }
        // Each machine sends what its line can carry, a hundredth of them at a time.
        while begin.elapsed() >= Duration::from_millis(turn) {
            lines.machines_send(turn)?;
            turn += 1;
        }
        poll.poll(&mut events, Some(Duration::from_millis(1)))?;
        for event in &events {
            let at = event.token().0 / 2;
            if event.token().0 % 2 == 1 {
                lines.machine_reads(at)?;
            } else {
                lines.client_reads_and_writes(at);
            }
        }
    }
    let (used, before, since) = start.ok_or("too short")?;
    let span = since.elapsed();
    let used = Used::now(subject.pid())?.since(&used, span);
    let after = lines.received();
    let rate = |bytes: u64| bytes as f64 / span.as_secs_f64() / machines.len() as f64;
    let grown = resident(subject.pid())?.saturating_sub(subject.before);
    Ok(serde_json::json!({
        "links": machines.len(),
        "wrong_bytes": lines.wrong,
        "to_machine_bytes": after.0,
        "to_client_bytes": after.1,
        "to_machine_bytes_per_second": rate(after.0 - before.0),
        "to_client_bytes_per_second": rate(after.1 - before.1),
        "cpu_percent": used.subject,
        "kernel_cpu_percent": used.kernel,
        "resident_grown_kib": grown / 1_024,
    }))
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
        Ok(Self { links, machines, wrong: 0, buffer: vec![0; 4_096].into() })
    }

    /// Bytes that have come to the machines and to the clients.
    fn received(&self) -> (u64, u64) {
        let sum = |of: fn(&Filled) -> u64| self.links.iter().map(of).sum();
        (sum(|link| link.to_machine.1), sum(|link| link.to_client.1))
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
