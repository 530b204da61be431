//! Our own commands: SEND and FETCH as jobs.

use super::awaited::Due;
use super::fields::command;
use super::job::{Fault, Job, Stage};
use super::layer::{Layer, Sender};
use super::reactions::{GOOD, UNKNOWN, failure};
use super::telegram::{FOLLOW_UP, Kind, MOST, SHORT};
use softplug_abi::{Failure, Micros};
use std::sync::Arc;

impl Layer {
    pub(super) fn take_job(
        &mut self,
        id: u32,
        kind: &str,
        fields: &[(String, String)],
        data: &[u8],
    ) {
        self.jobs = self.jobs.max(id);
        if self.job.is_some() {
            // The link itself has one job at a time.
            let due = Due::Failed { job: id, failure: Failure::Busy, status: 0, sent: 0 };
            return self.awaited.push("rk512.send.command", due);
        }
        match command(kind, fields, data, &mut self.ways) {
            Ok(command) => {
                let job = Job {
                    id,
                    command,
                    rest: Arc::new(data.to_vec()),
                    fetched: Arc::default(),
                    telegrams: 0,
                    stage: Stage::Ready,
                    has_begun: false,
                    is_paused: false,
                    sent: 0,
                };
                self.job = Some(job);
                self.refuse_unfit();
                self.feed(true);
            }
            Err((failure, status, clause)) => {
                self.awaited.push(clause, Due::Failed { job: id, failure, status, sent: 0 });
            }
        }
    }

    /// Without doubling a telegram that holds DLE ETX cannot be sent, and on a line of 7 data
    /// bits none that holds a byte of 8, nor one that others follow.
    fn refuse_unfit(&mut self) {
        let Some(job) = &self.job else { return };
        let telegram = job.telegram();
        let is_one = job.command.bytes() <= MOST;
        let is_wide = self.station.holds_wider(&telegram)
            || !is_one && self.station.holds_wider(&[FOLLOW_UP]);
        let clause = match (self.station.holds_end(&telegram), is_wide) {
            (true, _) => "rk512.line.no-doubling",
            (false, true) => "rk512.line.seven-bits",
            (false, false) => return,
        };
        self.fail_job((Failure::UnsupportedCharacter, 0, clause));
    }

    /// Whether the job has a telegram that may go now.
    pub(super) fn has_telegram(&mut self, are_data_there: bool) -> bool {
        let Some(job) = self.job.as_ref().filter(|job| job.stage == Stage::Ready) else {
            return false;
        };
        // The data of a follow-up may come behind what came from the line.
        let is_behind = job.command.kind == Kind::Send && job.telegrams > 0 && !job.has_begun;
        // Whether a pause holds one that had begun, and gave way, is left open.
        (!job.is_paused || job.has_begun && self.ways.is_other())
            && (are_data_there || !is_behind || self.ways.is_other())
    }

    pub(super) fn send_telegram(&mut self) {
        let Some(job) = &mut self.job else { return };
        job.stage = Stage::OnLine;
        job.has_begun = false;
        let telegram = job.telegram();
        self.sender = Sender::Job;
        self.station.send(&telegram);
    }

    /// The telegram that gave way goes after the reaction.
    pub(super) fn put_telegram_back(&mut self) {
        let Some(job) = &mut self.job else { return };
        job.sent += self.station.forget_block();
        job.stage = Stage::Ready;
        job.has_begun = true;
        self.sender = Sender::Nobody;
    }

    /// Our telegram is acknowledged.
    pub(super) fn telegram_sent(&mut self, at: Micros, sent: u64) {
        let Some(job) = &mut self.job else { return };
        job.sent += sent;
        job.stage = Stage::Awaiting(at + self.reaction_time);
    }

    /// The reaction that our job awaits: whether there is one.
    pub(super) fn awaits_reaction(&self) -> bool {
        matches!(self.job, Some(Job { stage: Stage::Awaiting(_), .. }))
    }

    /// What came instead of, or as, our reaction.
    pub(super) fn take_reaction(&mut self, telegram: &[u8]) {
        let Some(job) = &mut self.job else { return };
        let fits = telegram.len() >= SHORT
            && telegram[0] == job.front()
            && telegram[1] == 0
            && telegram[2] == 0;
        let number = telegram.get(3).copied().unwrap_or(GOOD);
        // Which one is told where there are both is left open.
        if !fits && (number == GOOD || !self.ways.is_other()) {
            return self.fail_job((Failure::Protocol, 0, "rk512.react.malformed"));
        }
        if number != GOOD {
            let failure = failure(number).unwrap_or_else(|| self.ways.one_of(UNKNOWN));
            return self.fail_job((failure, u16::from(number), "rk512.react.error"));
        }
        let data = &telegram[SHORT..];
        let part = job.part();
        let expected = if job.command.kind == Kind::Fetch { part } else { 0 };
        if data.len() != expected {
            return self.fail_job((Failure::Protocol, 0, "rk512.react.malformed"));
        }
        // They are the host's at once.
        self.room.deliver(data.len());
        Arc::make_mut(&mut job.fetched).extend(data);
        if job.command.kind == Kind::Send {
            Arc::make_mut(&mut job.rest).drain(..part);
        }
        job.telegrams += 1;
        job.stage = Stage::Ready;
        let is_whole = match job.command.kind {
            Kind::Send => job.rest.is_empty(),
            Kind::Fetch => job.fetched.len() == job.command.bytes(),
        };
        if is_whole {
            self.end_job();
        } else {
            self.refuse_unfit();
        }
    }

    fn end_job(&mut self) {
        let Some(job) = self.job.take() else { return };
        if job.command.kind == Kind::Fetch {
            self.deliver(job.fetched.to_vec(), None, 0, "rk512.fetch.command");
        }
        self.awaited.push("rk512.react.good", Due::Done { job: job.id, sent: job.sent });
    }

    pub(super) fn fail_job(&mut self, (failure, status, clause): Fault) {
        let Some(job) = self.job.take() else { return };
        if !job.fetched.is_empty() {
            self.deliver(job.fetched.to_vec(), Some(failure), status, "rk512.job.abort");
        }
        self.awaited.push(clause, Due::Failed { job: job.id, failure, status, sent: job.sent });
    }

    pub(super) fn pause(&mut self, id: u32, is_paused: bool) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = is_paused;
            self.feed(true);
        }
    }

    /// What a FETCH has brought is a delivery under way. Its end is the job's.
    pub(super) fn abort_delivery(&mut self, at: Micros) {
        let job = self.job.as_ref().filter(|job| !job.fetched.is_empty());
        let Some(id) = job.map(|job| job.id) else { return };
        self.abort(at, id);
    }

    pub(super) fn abort(&mut self, at: Micros, id: u32) {
        let Some(job) = self.job.as_ref().filter(|job| job.id == id) else { return };
        if job.stage == Stage::OnLine {
            self.station.abort_sending(job.sent > 0);
            return self.hear(at);
        }
        if job.sent > 0 && self.station.is_idle() {
            self.station.say_nak();
        }
        self.fail_job((Failure::Aborted, 0, "rk512.job.abort"));
        self.feed(true);
    }
}
