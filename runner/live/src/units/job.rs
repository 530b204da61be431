//! A job that a unit carries out: its data by credit, kept until the unit has it.

use std::collections::VecDeque;
use std::task::Waker;

use softplug_abi::{Failure, Micros};
use softplug_link::Job;
use softplug_unit_bus::Unit;
use softplug_unit_protocol::{CREDIT_PARTS, CreditError, Feeding, ToUnit};

use super::{PIECE, piece};
use crate::reactor::{Feed, JobEnd, JobOutcome};
use crate::reservoir::{Drawn, ReservoirReader};
use softplug_unit_uplink::Outbox;

pub(super) struct UnitJob {
    /// Its number in the unit protocol.
    pub(super) number: u64,
    pub(super) job: Job,
    source: Option<ReservoirReader>,
    pass: u8,
    feeding: Feeding,
    /// The most that was missing in the unit's buffer: all of it, when the job began.
    capacity: u64,
    credited_at: Micros,
    /// Data that the unit has not confirmed: from [`Feeding::confirmed`] on.
    unconfirmed: VecDeque<u8>,
    /// The unit was told of the job, in this session or an earlier one.
    pub(super) is_begun: bool,
    is_end_told: bool,
    pub(super) is_paused: bool,
    pub(super) is_aborted: bool,
    /// What the unit told last of how far it is.
    pub(super) left: JobEnd,
}

impl UnitJob {
    pub(super) fn new(number: u64, feed: Feed) -> Self {
        let Feed { job, source } = feed;
        let left = JobEnd::unbegun(job.id, JobOutcome::Done, 0);
        Self {
            number,
            job,
            source: Some(source),
            pass: 0,
            feeding: Feeding::default(),
            capacity: 0,
            credited_at: Micros::ZERO,
            unconfirmed: VecDeque::new(),
            is_begun: false,
            is_end_told: false,
            is_paused: false,
            is_aborted: false,
            left,
        }
    }

    pub(super) fn begin(&mut self, link: u8, outbox: &mut Outbox) {
        self.is_begun = true;
        outbox.push(
            &ToUnit::Begin {
                link,
                job: self.number,
                kind: self.job.kind,
                size: self.job.size.unwrap_or(u64::MAX),
                check: self.job.check,
                fields: &self.job.fields,
            },
            false,
        );
        self.say_again(link, outbox);
    }

    /// The unit does not know it, and has none of its data: it is begun again.
    pub(super) fn never_came(&mut self) {
        (self.is_begun, self.is_end_told) = (false, false);
    }

    /// What the unit may not have heard: harmless if it has.
    fn say_again(&self, link: u8, outbox: &mut Outbox) {
        let job = self.number;
        if self.is_paused {
            outbox.push(&ToUnit::Pause { link, job }, false);
        }
        if self.is_aborted {
            outbox.push(&ToUnit::Abort { link, job }, false);
        }
    }

    /// A new session, in which the unit says what it has of this job.
    pub(super) fn resume(
        &mut self,
        link: u8,
        received: u64,
        is_whole: bool,
        outbox: &mut Outbox,
    ) -> Result<(), CreditError> {
        self.feeding.resume(received)?;
        self.forget_confirmed();
        self.is_end_told = is_whole;
        self.say_again(link, outbox);
        Ok(())
    }

    pub(super) fn pass(&self) -> u8 {
        self.pass
    }

    /// The check was good: what comes next is the data once more.
    pub(super) fn rewound(&mut self) {
        self.pass = 1;
        self.feeding = Feeding::default();
        self.unconfirmed.clear();
        self.source = None;
        self.is_end_told = false;
    }

    pub(super) fn refill(&mut self, source: ReservoirReader) {
        self.source = Some(source);
    }

    pub(super) fn credit(
        &mut self,
        pass: u8,
        received: u64,
        until: u64,
        now: Micros,
    ) -> Result<(), CreditError> {
        if pass != self.pass {
            return Ok(());
        }
        self.feeding.credit(received, until)?;
        self.capacity = self.capacity.max(until.saturating_sub(received));
        self.credited_at = now;
        self.forget_confirmed();
        Ok(())
    }

    /// Bytes of the unit's buffer, as far as its credit has shown.
    pub(super) fn capacity(&self) -> u64 {
        self.capacity
    }

    /// What a bus is told of it: room is what there is credit for. `drain`: bits that leave the unit in
    /// a second.
    pub(super) fn demand(&self, drain: f64, now: Micros, waker: &Waker) -> Unit {
        let is_again = self.furthest_kept() > self.feeding.next();
        let has_source = self.source.as_ref().is_some_and(|source| {
            if source.level() == 0 && !source.is_ready() {
                source.wake_with(waker.clone());
            }
            source.level() > 0
        });
        let room = self.feeding.sendable().min(self.capacity);
        // While a program is only looked at, or paused, its machine stands.
        let stands = self.is_paused || self.job.check && self.pass == 0;
        let drain = if stands { 0.0 } else { drain };
        let capacity = 8.0 * self.capacity as f64;
        let untold = drain * (now - self.credited_at).as_secs_f64();
        Unit {
            level: 8.0 * (self.capacity - room) as f64,
            gone: untold.min(capacity / CREDIT_PARTS as f64),
            capacity,
            drain,
            has_begun: self.feeding.furthest() > 0,
            has_data: room > 0 && !self.is_end_told && (is_again || has_source),
        }
    }

    fn forget_confirmed(&mut self) {
        let front = self.furthest_kept() - self.unconfirmed.len() as u64;
        let count = self.feeding.confirmed().saturating_sub(front) as usize;
        self.unconfirmed.drain(..count.min(self.unconfirmed.len()));
    }

    /// The position behind the last byte that was drawn from the source.
    fn furthest_kept(&self) -> u64 {
        self.feeding.furthest()
    }

    /// Data up to the credit and to what may leave, of which it takes its part, while few messages
    /// wait.
    pub(super) fn pump(&mut self, link: u8, most: usize, allowed: &mut u64, outbox: &mut Outbox) {
        let (job, pass) = (self.number, self.pass);
        while outbox.len() < most && !self.is_end_told {
            let at = self.feeding.next();
            let room = self.feeding.sendable().min(piece(outbox) as u64).min(*allowed) as usize;
            let behind = (self.furthest_kept() - at) as usize;
            if behind > 0 {
                // It was sent in another session, and never came.
                if room == 0 {
                    return;
                }
                let begin = self.unconfirmed.len() - behind;
                let bytes: Vec<u8> =
                    self.unconfirmed.iter().skip(begin).take(room).copied().collect();
                outbox.push(&ToUnit::Data { link, job, pass, at, bytes: &bytes }, false);
                self.feeding.sent(bytes.len() as u64);
                *allowed -= bytes.len() as u64;
                continue;
            }
            let Some(source) = &mut self.source else { return };
            let mut bytes = [0; PIECE];
            // The end needs no credit.
            let drawn = if room > 0 {
                source.read(&mut bytes[..room])
            } else if source.level() == 0 && source.is_ready() {
                source.read(&mut bytes[..1])
            } else {
                return;
            };
            match drawn {
                Drawn::Bytes(count) => {
                    let bytes = &bytes[..count];
                    outbox.push(&ToUnit::Data { link, job, pass, at, bytes }, false);
                    self.unconfirmed.extend(bytes);
                    self.feeding.sent(count as u64);
                    *allowed -= count as u64;
                }
                Drawn::Later => return,
                Drawn::End => {
                    outbox.push(&ToUnit::End { link, job, pass, size: at }, false);
                    self.is_end_told = true;
                }
                Drawn::Failed => {
                    let why = source.failure().unwrap_or("its source failed");
                    let why = &why[..why.floor_char_boundary(600.min(piece(outbox)))];
                    outbox.push(&ToUnit::Fail { link, job, why }, false);
                    self.is_end_told = true;
                }
            }
        }
    }

    /// How it has ended, as the unit says, as far as that can be: no more of its data can have been
    /// taken than was sent. A plug-in may end a job before all of it was.
    pub(super) fn ended(&self, said: JobEnd) -> JobEnd {
        let sent = self.feeding.furthest();
        let outcome = if said.taken > sent {
            tracing::error!(
                job = self.job.id.0,
                "a unit says that more was taken than was sent to it"
            );
            JobOutcome::Failed { failure: Failure::Internal, status: 0 }
        } else {
            said.outcome
        };
        JobEnd {
            outcome,
            taken: said.taken.min(sent),
            bytes_maybe_left: said.bytes_maybe_left.min(sent),
            bytes_surely_left: said.bytes_surely_left.min(sent),
            ..said
        }
    }

    /// The unit knows nothing of it any more, or will not be asked again: how it has ended then.
    pub(super) fn interrupted(&self) -> JobEnd {
        let failure = if self.is_begun { Failure::Interrupted } else { Failure::Aborted };
        let sent = self.feeding.furthest();
        JobEnd {
            outcome: JobOutcome::Failed { failure, status: 0 },
            // All that was given to the unit may have left.
            maybe_left: self.left.maybe_left.max(sent),
            bytes_maybe_left: if self.pass > 0 || !self.job.check { sent } else { 0 },
            sent: self.left.bytes_surely_left,
            ..self.left.clone()
        }
    }

    /// Whether its data is to be sent, as far as there is any.
    pub(super) fn may_send(&self) -> bool {
        self.is_begun && !self.is_aborted && self.source.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reservoir::reservoir;
    use softplug_abi::JobId;
    use softplug_unit_protocol::{Identity, Messages, Role, Session};

    /// What an outbox has, by its types.
    fn said(outbox: &mut Outbox) -> Vec<u8> {
        let now = softplug_abi::Micros::ZERO;
        let (mut near, mut far) = (
            Session::<16, 1024>::new(Role::Server, Identity(1)),
            Session::<16, 1024>::new(Role::Unit, Identity(2)),
        );
        let mut wire = [0; softplug_unit_protocol::LONGEST];
        near.call(now);
        let length = near.poll_transmit(now, &mut wire).unwrap();
        far.receive(now, &wire[..length]).unwrap();
        let length = far.poll_transmit(now, &mut wire).unwrap();
        near.receive(now, &wire[..length]).unwrap();
        outbox.pump(&mut near);
        let mut kinds = Vec::new();
        while let Some(length) = near.poll_transmit(now, &mut wire) {
            if let Some(payload) = far.receive(now, &wire[..length]).unwrap() {
                kinds.extend(Messages::<ToUnit<'_>>::new(payload).map(|one| one.unwrap().kind()));
            }
        }
        kinds
    }

    #[test]
    fn a_job_that_never_came_is_given_again_from_its_beginning_to_its_end() {
        let (mut writer, source) = reservoir(16, 0, 16);
        writer.finish();
        let job = Job { id: JobId(1), kind: 0, size: Some(0), fields: Vec::new(), check: false };
        let mut job = UnitJob::new(1, Feed { job, source });
        let end = ToUnit::End { link: 0, job: 1, pass: 0, size: 0 }.kind();
        for _ in 0..2 {
            let mut outbox = Outbox::default();
            job.begin(0, &mut outbox);
            job.pump(0, 8, &mut u64::MAX.clone(), &mut outbox);
            assert_eq!(said(&mut outbox), [ToUnit::BEGIN, end]);
            job.never_came();
        }
    }
}
