//! What the host asks for.

use super::send::{Job, Sending, Stage};
use super::{Kermit, State};
use crate::model::{Effect, HostRequest};
use softplug_abi::Failure;

impl Kermit {
    pub(super) fn asked_by_host(&mut self, request: &HostRequest) {
        match request {
            HostRequest::Open => {
                self.is_open = true;
                self.is_down = false;
                self.out.set_gone(false);
                // How full the room is is known only roughly.
                self.is_blind |= self.room.free() == 0;
                (self.deliveries, self.requests) = (0, 0);
            }
            HostRequest::Close => self.closes(),
            HostRequest::Job { id, fields, data, .. } => self.begins(*id, fields, data),
            HostRequest::Pause(id) => self.pauses(*id, true),
            HostRequest::Resume(id) => {
                self.pauses(*id, false);
                let is_paused = matches!(&self.state, State::Sending(sending) if sending.stage == Stage::Paused);
                if is_paused && self.job.as_ref().is_some_and(|job| !job.is_paused) {
                    self.goes("kermit.tx.pause");
                }
            }
            HostRequest::Abort(0) => self.aborts_file(),
            HostRequest::Abort(id) if self.job.as_ref().is_some_and(|job| job.id == *id) => {
                self.aborts_job();
            }
            HostRequest::Abort(_) | HostRequest::ForceResume => {}
            HostRequest::Answer(id, answer) => {
                self.is_answered_by_host(*id, answer.as_ref().err().copied());
            }
            HostRequest::Keep => self.room.keep(),
            HostRequest::PutAway(bytes) => {
                self.room.put_away(*bytes);
            }
            HostRequest::PutAllAway => self.room.put_all_away(),
        }
    }

    /// What is under way is interrupted; nothing of it has an effect any more.
    fn closes(&mut self) {
        const CLAUSE: &str = "kermit.line.close";
        if matches!(self.state, State::Sending(_)) {
            self.fails(Failure::Interrupted, CLAUSE);
        }
        self.drops_job(Failure::Interrupted, CLAUSE);
        self.ends_transfer(Some(Failure::Interrupted), CLAUSE);
        self.hearing = None;
        self.request = None;
        self.granted = None;
        self.out.discard();
        self.is_open = false;
    }

    fn begins(&mut self, id: u32, fields: &[(String, String)], data: &[u8]) {
        self.jobs = id;
        let refused = |failure| Effect::Failed { job: id, failure, status: 0, sent: 0 };
        if self.job.is_some() {
            return self.expected.expect("kermit.tx.one-job", refused(Failure::Busy));
        }
        let name = fields.iter().find(|(field, _)| field == "name");
        let name = name.map_or("PROGRAM", |(_, name)| name.as_str());
        let is_printable = name.bytes().all(|byte| (32..127).contains(&byte));
        if !is_printable || name.is_empty() || name.len() > 64 {
            return self.expected.expect("kermit.tx.name", refused(Failure::BadJob));
        }
        let mut sent = Vec::new();
        for (place, byte) in data.iter().enumerate() {
            let is_after_cr = place > 0 && data[place - 1] == b'\r';
            if self.rules.is_text && *byte == b'\n' && !is_after_cr {
                sent.push(b'\r');
            }
            sent.push(*byte);
        }
        let name = name.to_owned();
        self.job = Some(Job { id, name, data: sent, is_paused: false, until: None, queued: 0 });
        self.begins_job_that_waits();
    }

    fn pauses(&mut self, id: u32, is_paused: bool) {
        // Whether a packet behind others has begun is a matter of room.
        if let State::Sending(Sending { stage: Stage::Leaving(_), packet, .. }) = &self.state {
            self.is_blind |= is_paused && self.out.waiting() > packet.len() + 1;
        }
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = is_paused;
        }
    }
}
