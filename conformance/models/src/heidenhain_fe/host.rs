//! What the host asks for.

use super::send::{Job, Stage};
use super::{Fe, State};
use crate::model::{Effect, HostRequest};
use softplug_abi::Failure;

impl Fe {
    pub(super) fn asked_by_host(&mut self, request: &HostRequest) {
        match request {
            HostRequest::Open => self.opens(),
            HostRequest::Close => self.closes(),
            HostRequest::Job { id, fields, data, .. } => self.begins(*id, fields, data),
            HostRequest::Pause(id) => {
                // Whether a block found room before it is open.
                let is_sending = matches!(self.state, State::Sending(_));
                self.is_blind |= is_sending && self.rules.has_small_queue;
                self.pauses(*id, true);
            }
            HostRequest::Resume(id) => {
                self.pauses(*id, false);
                self.resumes();
            }
            HostRequest::Abort(id) => self.aborts(*id),
            HostRequest::ForceResume => self.hold(false),
            HostRequest::Keep => self.room.keep(),
            HostRequest::PutAway(bytes) => {
                self.room.put_away(*bytes as usize);
                self.puts_away();
            }
            HostRequest::PutAllAway => {
                self.room.put_all_away();
                self.puts_away();
            }
            HostRequest::Answer(id, answer) => self.is_answered(*id, answer.is_ok()),
        }
    }

    fn opens(&mut self) {
        self.is_open = true;
        self.is_down = false;
        self.out.set_gone(false);
        self.room.tell();
        self.has_no_place = self.room.free() == 0;
        (self.deliveries, self.requests) = (0, 0);
    }

    /// What is under way is interrupted; nothing of it has an effect any more.
    fn closes(&mut self) {
        const CLAUSE: &str = "heidenhain-fe.line.close";
        self.end_delivery(Some(Failure::Interrupted), CLAUSE);
        self.fail_job(Failure::Interrupted, CLAUSE);
        self.state = State::Idle;
        self.frame = None;
        self.out.discard();
        self.hold(false);
        self.is_open = false;
    }

    fn begins(&mut self, id: u32, fields: &[(String, String)], data: &[u8]) {
        self.jobs = id;
        if self.job.is_some() {
            let busy = Effect::Failed { job: id, failure: Failure::Busy, status: 0, sent: 0 };
            return self.expected.expect("heidenhain-fe.tx.one-job", busy);
        }
        let checked =
            |failure, line, column| Effect::Checked { job: id, failure, status: 0, line, column };
        let lines = match self.rules.lines(data) {
            Ok(lines) => lines,
            Err(fault) => {
                let bad = checked(Some(fault.failure), fault.line, fault.column);
                return self.expected.expect("heidenhain-fe.tx.check", bad);
            }
        };
        self.expected.expect("heidenhain-fe.tx.check", checked(None, 0, 0));
        let named = fields.iter().find(|(name, _)| name == "name");
        let name = named.map(|(_, value)| value.as_bytes().to_vec());
        let until = self.rules.request_time.map(|time| self.now + time);
        self.job = Some(Job { id, name, lines, is_paused: false, until });
        if let State::Granted { name, .. } = &self.state {
            let name = name.clone();
            self.sends_to(&name);
        }
    }

    fn pauses(&mut self, id: u32, is_paused: bool) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = is_paused;
        }
    }

    fn resumes(&mut self) {
        if let State::Sending(sending) = &self.state
            && let Stage::Paused = sending.stage
        {
            self.goes_on("heidenhain-fe.tx.pause");
        }
    }

    fn aborts(&mut self, id: u32) {
        let is_own = self.job.as_ref().is_some_and(|job| job.id == id);
        if id == 0 {
            self.aborts_delivery("heidenhain-fe.rx.abort");
        } else if is_own {
            self.aborts_job("heidenhain-fe.tx.abort");
        }
    }

    fn aborts_delivery(&mut self, clause: &'static str) {
        if let State::Receiving(_) = self.state {
            self.end_delivery(Some(Failure::Aborted), clause);
            self.end_all(clause);
        }
    }

    fn aborts_job(&mut self, clause: &'static str) {
        let has_asked = matches!(self.state, State::Sending(_));
        self.fail_job(Failure::Aborted, clause);
        if has_asked {
            self.end_all(clause);
        }
    }

    fn puts_away(&mut self) {
        self.has_no_place &= !self.room.must_take(1);
        self.has_more_room();
    }

    fn is_answered(&mut self, id: u32, is_granted: bool) {
        let State::Asking { request, name } = &self.state else { return };
        if *request != id {
            return;
        }
        let name = name.clone();
        if !is_granted {
            self.end_all("heidenhain-fe.tx.refused");
        } else if self.job.is_some() {
            self.sends_to(&name);
        } else {
            self.state = State::Granted { name, until: self.now + self.rules.job_time };
        }
    }
}
