//! A job on the line.

use super::Lathe;
use super::program::Item;
use crate::model::Effect;
use softplug_abi::{Failure, Micros};
use std::collections::VecDeque;

/// Pulses of a thread that may wait in the queue.
const THREAD_WAITS: i64 = 32;
const PERIOD: i64 = 250;

/// What a job waits for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Stage {
    Sending,
    /// The echo of a command; how long from when it has left.
    Echo {
        code: u8,
        until: Option<Micros>,
    },
    Single,
    Index {
        sign: i64,
        pulses: u64,
        pitch: u64,
    },
    Thread {
        sign: i64,
        left: u64,
        pitch: u64,
        turned: u64,
        done: u64,
        until: Micros,
    },
    Ending,
}

#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    pub(super) stage: Stage,
    items: VecDeque<Item>,
    /// All that was queued, with the clause of each.
    pub(super) sent: Vec<(u8, &'static str)>,
    /// Of these, those whose first bit and whose last bit has left.
    pub(super) begun: usize,
    left: usize,
    /// Characters that are none of the job's and stand before the end of a block.
    pub(super) foreign: usize,
    /// The block has ended among characters that are being heard.
    pub(super) is_news: bool,
    is_paused: bool,
    is_held: bool,
    pub(super) is_holding: bool,
}

impl Job {
    pub(super) fn new(id: u32, items: Vec<Item>) -> Self {
        Self {
            id,
            stage: Stage::Sending,
            items: items.into(),
            sent: Vec::new(),
            begun: 0,
            left: 0,
            foreign: 0,
            is_news: false,
            is_paused: false,
            is_held: false,
            is_holding: false,
        }
    }

    pub(super) fn deadline(&self) -> Option<Micros> {
        match self.stage {
            Stage::Echo { until, .. } => until,
            _ => None,
        }
    }

    pub(super) fn all_left(&self) -> bool {
        self.left == self.sent.len()
    }

    /// Whether a block and all before it has left.
    fn is_over(&self) -> bool {
        self.all_left() && self.foreign == 0 && !self.is_news
    }
}

/// Pulses of x and z of a byte.
fn pulses((byte, _): &(u8, &'static str)) -> (i64, i64) {
    let one = |there, minus| match (byte & there != 0, byte & minus != 0) {
        (true, true) => -1,
        (true, false) => 1,
        _ => 0,
    };
    if *byte >= 0x80 { (0, 0) } else { (one(1, 2), one(4, 8)) }
}

impl Lathe {
    fn send(&mut self, bytes: &[(u8, &'static str)]) {
        let Some(job) = &mut self.job else { return };
        job.sent.extend(bytes);
        let bytes: Vec<u8> = bytes.iter().map(|(byte, _)| *byte).collect();
        self.port.send(&bytes);
    }

    /// Queues all up to the next thing that has to be waited for.
    pub(super) fn goes_on(&mut self) {
        // What is urgent and not in the port yet leaves before the block's own, or behind its end.
        let foreign = self.port.inside_of(&[0xE0, 0xE1]) + self.stale;
        while let Some(job) = &mut self.job {
            if job.stage != Stage::Sending {
                return;
            }
            job.foreign = foreign;
            job.is_news = self.is_hearing;
            match job.items.pop_front() {
                Some(Item::Bytes(bytes)) => self.send(&bytes),
                Some(Item::Command(code)) => {
                    job.stage = Stage::Echo { code, until: None };
                    self.send(&[(code, "pulse-lathe.line.command")]);
                }
                Some(Item::Thread { sign, pulses, pitch }) => {
                    job.stage = Stage::Index { sign, pulses, pitch };
                }
                Some(Item::BlockEnd) if self.rules.is_single => job.stage = Stage::Single,
                Some(Item::BlockEnd | Item::Unknown) => {}
                None => {
                    job.stage = Stage::Ending;
                    self.send(&[(0xE2, "pulse-lathe.line.end")]);
                }
            }
        }
    }

    /// One of the job's bytes has left.
    pub(super) fn has_left(&mut self) {
        let Some(job) = &mut self.job else { return };
        job.left += 1;
        if !job.all_left() {
            return;
        }
        match &mut job.stage {
            Stage::Echo { until, .. } => *until = Some(self.now + self.rules.echo_time),
            Stage::Ending => {
                let done = Effect::Done { job: job.id, sent: job.sent.len() as u64 };
                self.demands.add(done, "pulse-lathe.line.end");
                self.ends();
            }
            _ => {}
        }
    }

    /// The job is over. Where the axes stand is where its bytes have brought them.
    fn ends(&mut self) {
        if let Some(job) = self.job.take() {
            let given = job.sent.len().saturating_sub(self.port.waiting());
            for byte in &job.sent[..given] {
                let (x, z) = pulses(byte);
                self.place = (self.place.0 + x, self.place.1 + z);
            }
        }
        self.port.hold(false);
    }

    pub(super) fn stops(&mut self, failure: Failure, status: u16, clause: &'static str) {
        let Some(job) = &self.job else { return };
        let sent = job.sent.len().saturating_sub(self.port.waiting()) as u64;
        let failed = Effect::Failed { job: job.id, failure, status, sent };
        self.demands.add(failed, clause);
        self.ends();
        self.port.discard();
        self.stale = self.port.inside() - self.port.inside_of(&[0xE0, 0xE1]);
        if failure != Failure::LinkDown {
            self.says(0xE1);
        }
    }

    pub(super) fn hears(&mut self, byte: u8) {
        let Some(job) = &mut self.job else { return };
        match byte {
            0x00..=0x7F => self.turns(byte),
            0x80..=0xDF => {
                if let Stage::Echo { code, .. } = job.stage
                    && code == byte
                    && job.all_left()
                {
                    job.stage = Stage::Sending;
                    self.goes_on();
                }
            }
            0xF0 => {
                job.is_held = true;
                self.holds();
            }
            0xF1 => self.starts_again(),
            0xF2 => self.stops(Failure::Refused, 21, "pulse-lathe.run.stop"),
            0xF5..=0xF7 => self.stops(Failure::PartnerAlarm, 22, "pulse-lathe.run.limit"),
            _ => {}
        }
    }

    fn turns(&mut self, byte: u8) {
        let Some(job) = &mut self.job else { return };
        let increments = u64::from(byte % 64);
        match job.stage {
            Stage::Index { sign, pulses, pitch }
                if byte >= 0x40 && job.is_over() && !job.is_holding =>
            {
                job.stage = Stage::Thread {
                    sign,
                    left: pulses,
                    pitch,
                    turned: 0,
                    done: 0,
                    until: Micros::ZERO,
                };
            }
            Stage::Thread { sign, left, pitch, turned, done, until } => {
                let turned = turned + increments;
                let all = turned * pitch / (self.rules.increments * 100);
                let now = (all - done).min(left);
                let begin = until.max(self.now);
                let waits = ((begin - self.now).0 + PERIOD - 1) / PERIOD;
                if now as i64 > THREAD_WAITS - waits {
                    return self.stops(Failure::Overrun, 20, "pulse-lathe.cut.thread-fast");
                }
                let left = left - now;
                let until = begin + Micros(PERIOD * now as i64);
                job.stage = if left == 0 {
                    Stage::Sending
                } else {
                    Stage::Thread { sign, left, pitch, turned, done: all, until }
                };
                let pulse = if sign < 0 { 0x0C } else { 0x04 };
                self.send(&vec![(pulse, "pulse-lathe.cut.thread"); now as usize]);
                self.holds();
                self.goes_on();
            }
            _ => {}
        }
    }

    /// Whether the queue is held follows from who holds it.
    fn holds(&mut self) {
        let Some(job) = &mut self.job else { return };
        let may_hold = match job.stage {
            Stage::Thread { .. } => false,
            // Behind E2 nothing is left to hold.
            Stage::Ending => self.port.waiting() > 0,
            _ => true,
        };
        let is_holding = (job.is_paused || job.is_held) && may_hold;
        if is_holding == job.is_holding {
            return;
        }
        job.is_holding = is_holding;
        self.port.hold(is_holding);
        if is_holding {
            self.says(0xE0);
        }
    }

    /// No more than eight of each wait; which of them the port has sent it does not tell.
    fn says(&mut self, code: u8) {
        self.is_blind |= self.port.urgent() + self.port.inside_of(&[0xE0, 0xE1]) >= 8;
        self.port.send_urgently(&[code]);
    }

    pub(super) fn pauses(&mut self, id: u32, is_paused: bool) {
        let Some(job) = self.job.as_mut().filter(|job| job.id == id) else { return };
        job.is_paused = is_paused;
        if is_paused { self.holds() } else { self.goes() }
    }

    /// The operator's start, or the host's word against the operator's hold.
    pub(super) fn starts_again(&mut self) {
        if let Some(job) = &mut self.job {
            job.is_held = false;
            self.goes();
        }
    }

    fn goes(&mut self) {
        let Some(job) = &mut self.job else { return };
        if job.stage == Stage::Single && job.is_over() {
            job.stage = Stage::Sending;
        }
        self.holds();
        self.goes_on();
    }
}
