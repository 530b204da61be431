//! The control asks: headers of mode E, jobs, grants, and what is sent.

use super::frame::{ACK, EOT, ETX, STX, framed};
use super::{Fe, State};
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// A program for the control.
#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    pub(super) name: Option<Vec<u8>>,
    pub(super) lines: Vec<Vec<u8>>,
    pub(super) is_paused: bool,
    /// Nobody has asked for it by then; `None`: somebody has, or it waits for ever.
    pub(super) until: Option<Micros>,
}

/// How far a job is.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    pub(super) stage: Stage,
    /// Lines that were acknowledged.
    pub(super) line: usize,
    /// How often this line was sent again.
    pub(super) repeats: u32,
    /// When the control asked for it.
    pub(super) since: Micros,
    /// Characters that were queued for the job.
    queued: u64,
}

#[derive(Clone, Debug)]
pub(super) enum Stage {
    /// A block is leaving: up to this place.
    Leaving(u64),
    /// It has left, its answer is awaited.
    Answer { until: Micros },
    /// Between two blocks, while the job is paused.
    Paused,
    /// ETX EOT is leaving: up to this place.
    Ending(u64),
}

impl Sending {
    pub(super) fn is_ending(&self) -> bool {
        matches!(self.stage, Stage::Ending(_))
    }

    pub(super) fn answer_until(&self) -> Option<Micros> {
        match self.stage {
            Stage::Answer { until } => Some(until),
            Stage::Leaving(_) | Stage::Paused | Stage::Ending(_) => None,
        }
    }
}

impl Job {
    /// A job without a name goes wherever something is asked for.
    fn is_for(&self, name: &[u8]) -> bool {
        self.name.as_deref().is_none_or(|own| own == name)
    }
}

impl Fe {
    /// A header of mode E; nothing is under way.
    pub(super) fn header_e(&mut self, kind: u8, name: &[u8]) {
        if self.job.is_some() {
            return self.sends_to(name);
        }
        self.requests += 1;
        self.state = State::Asking { request: self.requests, name: name.to_vec() };
        let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
        let field = |name: &str, value| (name.to_owned(), text(value));
        let requested = Effect::Requested {
            id: self.requests,
            kind: "program".to_owned(),
            fields: vec![field("name", name), field("kind", &[kind])],
        };
        self.expected.expect("heidenhain-fe.tx.ask-host", requested);
    }

    /// The job that waits goes to who asked for this name, or EOT does.
    pub(super) fn sends_to(&mut self, name: &[u8]) {
        let Some(job) = &mut self.job else { return };
        if !job.is_for(name) {
            return self.end_all("heidenhain-fe.tx.name");
        }
        job.until = None;
        self.out.send(&[ACK], "heidenhain-fe.tx.on-request");
        self.state = State::Sending(Sending {
            stage: Stage::Paused,
            line: 0,
            repeats: 0,
            since: self.now,
            queued: 0,
        });
        self.goes_on("heidenhain-fe.tx.on-request");
    }

    /// The next block, or the same one again, unless the job is paused.
    pub(super) fn goes_on(&mut self, clause: &'static str) {
        let (Some(job), State::Sending(sending)) = (&self.job, &mut self.state) else { return };
        if job.is_paused {
            sending.stage = Stage::Paused;
            return;
        }
        let Some(line) = job.lines.get(sending.line) else {
            sending.stage = Stage::Ending(self.out.send(&[ETX, EOT], "heidenhain-fe.tx.end"));
            sending.queued += 2;
            return;
        };
        let block = framed(STX, line, self.rules.dc1, self.rules.bcc_space);
        sending.queued += block.len() as u64;
        sending.stage = Stage::Leaving(self.out.send(&block, clause));
    }

    /// ACK or NAK. It is none where no answer is awaited (tx.too-early, line.noise).
    pub(super) fn answered(&mut self, is_good: bool) {
        const CLAUSE: &str = "heidenhain-fe.tx.repeat";
        let State::Sending(sending) = &mut self.state else { return };
        if sending.answer_until().is_none() {
            return;
        }
        if is_good {
            sending.line += 1;
            sending.repeats = 0;
            return self.goes_on("heidenhain-fe.tx.next");
        }
        sending.repeats += 1;
        if sending.repeats > self.rules.repeats {
            self.fail_job(Failure::AttemptsUsedUp, CLAUSE);
            self.end_all(CLAUSE);
        } else {
            self.goes_on(CLAUSE);
        }
    }

    /// A character of ours has left.
    pub(super) fn progress(&mut self) {
        let State::Sending(sending) = &mut self.state else { return };
        match sending.stage {
            Stage::Leaving(place) if self.out.has_left(place) => {
                sending.stage = Stage::Answer { until: self.now + self.rules.answer_time };
            }
            Stage::Ending(place) if self.out.has_left(place) => {
                let sent = sending.queued;
                self.state = State::Idle;
                if let Some(job) = self.job.take() {
                    self.expected
                        .expect("heidenhain-fe.tx.end", Effect::Done { job: job.id, sent });
                }
            }
            _ => {}
        }
    }

    /// The job fails, wherever it is. What waits to be sent is dropped if the
    /// control had asked.
    pub(super) fn fail_job(&mut self, failure: Failure, clause: &'static str) {
        let Some(job) = self.job.take() else { return };
        let mut sent = 0;
        if let State::Sending(sending) = &self.state {
            // All that waits behind our ACK is the job's.
            sent = sending.queued.saturating_sub(self.out.discard());
            self.state = State::Idle;
        }
        self.expected.expect(clause, Effect::Failed { job: job.id, failure, status: 0, sent });
    }

    /// The control no longer wants what it has asked for.
    pub(super) fn take_back(&mut self, clause: &'static str) {
        if let State::Asking { request, .. } = self.state {
            self.expected.expect(clause, Effect::Withdrawn(request));
        }
        self.state = State::Idle;
    }
}
