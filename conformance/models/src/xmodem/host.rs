//! What the host asks for.

use super::send::{Job, Stage};
use super::{State, Xmodem};
use crate::model::{Effect, HostRequest};
use softplug_abi::Failure;

impl Xmodem {
    pub(super) fn asked_by_host(&mut self, request: &HostRequest) {
        match request {
            HostRequest::Open => self.opens(),
            HostRequest::Close => self.closes(),
            HostRequest::Job { id, data, .. } => self.begins(*id, data),
            HostRequest::Pause(id) => self.pauses(*id, true),
            HostRequest::Resume(id) => {
                self.pauses(*id, false);
                let is_paused = matches!(&self.state, State::Sending(sending) if sending.stage == Stage::Paused);
                if is_paused && self.job.as_ref().is_some_and(|job| !job.is_paused) {
                    self.goes("xmodem.tx.pause");
                }
            }
            HostRequest::Abort(0) => self.aborts_file(),
            HostRequest::Abort(id) if self.job.as_ref().is_some_and(|job| job.id == *id) => {
                self.aborts_job();
            }
            HostRequest::Abort(_) | HostRequest::ForceResume | HostRequest::Answer(..) => {}
            HostRequest::Keep => self.room.keep(),
            HostRequest::PutAway(bytes) => {
                // When the plug-in is told of its first room is the host's matter.
                self.is_blind |= !self.has_place;
                self.room.put_away(*bytes);
            }
            HostRequest::PutAllAway => {
                self.is_blind |= !self.has_place;
                self.room.put_all_away();
            }
        }
    }

    fn opens(&mut self) {
        self.is_open = true;
        self.is_down = false;
        self.out.set_gone(false);
        // How full the room is is known only roughly.
        self.is_blind |= self.room.free() == 0;
        self.has_place = true;
        self.deliveries = 0;
        self.begins_calling();
    }

    /// What is under way is interrupted; nothing of it has an effect any more.
    fn closes(&mut self) {
        const CLAUSE: &str = "xmodem.line.close";
        if matches!(self.state, State::Sending(_)) {
            self.fails(Failure::Interrupted, CLAUSE);
        }
        self.drops_job(Failure::Interrupted, CLAUSE);
        self.ends_file(Some(Failure::Interrupted), CLAUSE);
        self.state = State::Idle { until: None, lingers: false };
        self.out.discard();
        self.is_open = false;
    }

    fn begins(&mut self, id: u32, data: &[u8]) {
        self.jobs = id;
        let refused = |failure| Effect::Failed { job: id, failure, status: 0, sent: 0 };
        if self.job.is_some() {
            return self.expected.expect("xmodem.tx.one-job", refused(Failure::Busy));
        }
        if !self.rules.is_wide() {
            return self.expected.expect("xmodem.line.eight-bits", refused(Failure::NotSupported));
        }
        let until = self.rules.request_time.map(|time| self.now + time);
        self.job = Some(Job { id, data: data.to_vec(), is_paused: false, until });
        if matches!(self.state, State::Calling { .. }) {
            self.state = State::Idle { until: None, lingers: false };
        }
    }

    fn pauses(&mut self, id: u32, is_paused: bool) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = is_paused;
        }
    }
}
