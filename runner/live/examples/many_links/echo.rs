//! 16 bytes over each link every 100 ms, sent back by the machine.

use std::io::{ErrorKind, Read, Write};
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

pub const BAUD: u32 = 921_600;
/// The gateway's own at this rate.
pub const DEPTH: u32 = 32;
const EVERY: Duration = Duration::from_millis(100);
const MESSAGE: &[u8; 16] = b"0123456789ABCDE\n";

/// One link's client.
struct Link {
    client: TcpStream,
    sent_at: Option<Instant>,
    back: usize,
}

/// What has been measured.
#[derive(Default)]
struct Trips {
    spans: Vec<Duration>,
    /// The next message was due and the last one not back.
    unanswered: u64,
    /// Reads that brought what was out for longer.
    late: u64,
}

pub fn measure(subject: &Subject, machines: &[PtyPair], span: Duration) -> Outcome<Value> {
    let mut poll = Poll::new()?;
    let mut links = Vec::new();
    for (at, (machine, address)) in machines.iter().zip(&subject.addresses).enumerate() {
        let mut client = connect(*address)?;
        poll.registry().register(&mut client, Token(2 * at), Interest::READABLE)?;
        let fd = machine.master().as_fd().as_raw_fd();
        poll.registry().register(&mut SourceFd(&fd), Token(2 * at + 1), Interest::READABLE)?;
        links.push(Link { client, sent_at: None, back: 0 });
    }
    let begin = Instant::now() + Duration::from_secs(1);
    let (warm, end) = (begin + Duration::from_secs(1), begin + Duration::from_secs(1) + span);
    let mut events = Events::with_capacity(1_024);
    let mut trips = Trips::default();
    let mut used = None;
    let mut turn = 0;
    let mut buffer = [0; 4_096];
    loop {
        let now = Instant::now();
        if now >= end {
            break;
        }
        if now >= warm && used.is_none() {
            used = Some(Used::now(subject.pid())?);
        }
        // Each in its turn, evenly over the time.
        let count = links.len() as u32;
        let due = |turn: u32| begin + EVERY * (turn / count) + EVERY * (turn % count) / count;
        while due(turn) <= now {
            let link = &mut links[(turn % count) as usize];
            turn += 1;
            trips.unanswered += u64::from(link.sent_at.is_some() && now >= warm);
            link.sent_at = Some(Instant::now());
            link.back = 0;
            link.client.write_all(MESSAGE)?;
        }
        let wake = due(turn).min(end);
        let patience = wake.saturating_duration_since(Instant::now());
        // Rounded up to a millisecond by the poll, which only makes messages late.
        poll.poll(&mut events, Some(patience))?;
        for event in &events {
            let at = event.token().0 / 2;
            if event.token().0 % 2 == 1 {
                // The machine sends back what it gets.
                while let ReadOutcome::Read(count) = machines[at].read(&mut buffer)? {
                    let _ = machines[at].write(&buffer[..count])?;
                }
            } else {
                trips.read(&mut links[at], &mut buffer, warm)?;
            }
        }
    }
    let used = Used::now(subject.pid())?.since(&used.ok_or("too short")?, span);
    let grown = resident(subject.pid())?.saturating_sub(subject.before);
    trips.spans.sort();
    Ok(json!({
        "subject": subject.name,
        "links": machines.len(),
        "echoes": trips.spans.len(),
        "unanswered": trips.unanswered,
        "late": trips.late,
        "p50_micros": trips.at(0.5),
        "p99_micros": trips.at(0.99),
        "max_micros": trips.at(1.0),
        "cpu_percent": used.subject,
        "other_cpu_percent": used.others,
        "resident_grown_kib": grown / 1_024,
    }))
}

impl Trips {
    fn read(&mut self, link: &mut Link, buffer: &mut [u8], warm: Instant) -> Outcome {
        loop {
            match link.client.read(buffer) {
                Ok(0) => return Err("a client was sent away".into()),
                Ok(count) => {
                    link.back += count;
                    self.late += u64::from(link.back > MESSAGE.len() && Instant::now() >= warm);
                    if link.back == MESSAGE.len()
                        && let Some(sent_at) = link.sent_at.take()
                        && sent_at >= warm
                    {
                        self.spans.push(sent_at.elapsed());
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Of the sorted trips.
    fn at(&self, part: f64) -> Option<u128> {
        let at = (self.spans.len() as f64 * part) as usize;
        Some(self.spans.get(at.min(self.spans.len().checked_sub(1)?))?.as_micros())
    }
}
