//! The machines at the far ends, all on one thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_live::ReadOutcome;
use softplug_live::pty::PtyPair;

pub(crate) const XON: u8 = 0x11;
pub(crate) const XOFF: u8 = 0x13;
/// A machine holds for so long, so often.
const HOLD: Duration = Duration::from_millis(15);
const HOLD_EVERY: Duration = Duration::from_millis(400);
/// What a machine sends at once.
const PORTION: usize = 16;

/// One machine: takes a program, sends another one, holds now and then.
pub(crate) struct Machine {
    pty: PtyPair,
    /// What it is to send, and how much it has.
    data: Vec<u8>,
    sent: usize,
    /// So much may go a millisecond.
    rate: f64,
    began: Option<Instant>,
    /// The gateway has stopped it.
    is_stopped: bool,
    holds_until: Option<Instant>,
    /// `None`: it never holds.
    next_hold: Option<Instant>,
    /// All that came but the control characters.
    pub(crate) received: Vec<u8>,
}

/// Letters and digits of which no two stretches of 600 are alike.
pub(crate) fn pattern(seed: u32, bytes: usize) -> Vec<u8> {
    (0..).flat_map(|n: u32| format!("{seed:03}N{n:05}X").into_bytes()).take(bytes).collect()
}

impl Machine {
    /// Sends `data` at so many characters a second.
    pub(crate) fn new(pty: PtyPair, data: Vec<u8>, characters: u32) -> Self {
        Self {
            pty,
            data,
            sent: 0,
            rate: f64::from(characters) / 1_000.0,
            began: None,
            is_stopped: false,
            holds_until: None,
            next_hold: Some(Instant::now() + HOLD_EVERY),
            received: Vec::new(),
        }
    }

    /// A machine that knows no flow control.
    pub(crate) fn without_holds(self) -> Self {
        Self { next_hold: None, ..self }
    }

    /// Runs all of them until `stop`, and then until nothing more comes; gives them
    /// back.
    pub(crate) fn run_all(mut machines: Vec<Self>, stop: Arc<AtomicBool>) -> JoinHandle<Vec<Self>> {
        thread::spawn(move || {
            loop {
                let is_last = stop.load(Ordering::Relaxed);
                let mut was_busy = false;
                for machine in &mut machines {
                    was_busy |= machine.turn();
                }
                if !was_busy && is_last {
                    return machines;
                }
                if !was_busy {
                    thread::sleep(Duration::from_millis(1));
                }
            }
        })
    }

    fn turn(&mut self) -> bool {
        let has_read = self.read();
        let now = Instant::now();
        if self.holds_until.is_some_and(|until| until <= now) && self.write(&[XON]) == 1 {
            self.holds_until = None;
            self.next_hold = Some(now + HOLD_EVERY);
        }
        let is_due = self.holds_until.is_none() && self.next_hold.is_some_and(|at| at <= now);
        if is_due && self.write(&[XOFF]) == 1 {
            self.holds_until = Some(now + HOLD);
        }
        self.send(now) || has_read
    }

    fn read(&mut self) -> bool {
        let mut buffer = [0; 2_048];
        let Ok(ReadOutcome::Read(count)) = self.pty.read(&mut buffer) else { return false };
        for byte in &buffer[..count] {
            match *byte {
                XON => self.is_stopped = false,
                XOFF => self.is_stopped = true,
                byte => self.received.push(byte),
            }
        }
        true
    }

    fn send(&mut self, now: Instant) -> bool {
        if self.is_stopped || self.sent == self.data.len() {
            return false;
        }
        let began = *self.began.get_or_insert(now);
        let due = ((now - began).as_secs_f64() * 1_000.0 * self.rate) as usize;
        let end = due.min(self.data.len()).min(self.sent + PORTION);
        if end <= self.sent {
            return false;
        }
        let portion = self.data[self.sent..end].to_vec();
        let written = self.write(&portion);
        self.sent += written;
        written > 0
    }

    fn write(&self, bytes: &[u8]) -> usize {
        self.pty.write(bytes).unwrap_or(0)
    }
}
