//! What a host does.

use super::{Next, host, line, line_break, soon};
use crate::model::{HostRequest, LineInput};
use softplug_abi::LinkDownReason;

impl Next<'_> {
    pub(super) fn job(&mut self, wait: i64) {
        let job = self.upper.job(self.station, self.dice);
        self.push(host(wait, job));
    }

    pub(super) fn host_drains(&mut self, wait: i64) {
        let room = self.upper.room(self.station);
        let (waiting, least) = (room.waiting(), room.told_from());
        let request = match self.dice.below(4) {
            0 => HostRequest::Keep,
            1 => HostRequest::PutAllAway,
            // Less than what is told at once is told when a plug-in is swapped, too,
            // which no model sees.
            _ if waiting <= least => HostRequest::PutAway(u32::MAX),
            _ => {
                let more = self.dice.below((waiting - least) as u64) as usize;
                HostRequest::PutAway((least + more) as u32)
            }
        };
        self.push(host(wait, request));
    }

    pub(super) fn host_meddles(&mut self) {
        let wait = soon(self.dice);
        let id = self.upper.last_job(self.station).max(1);
        match self.dice.below(14) {
            0..=2 => self.push(host(wait, HostRequest::Pause(id))),
            3 | 4 => self.push(host(wait, HostRequest::Resume(id))),
            5 => self.push(host(wait, HostRequest::Abort(id))),
            6 => self.push(host(wait, HostRequest::Abort(0))),
            7 => self.push(host(wait, HostRequest::ForceResume)),
            8 | 9 => self.job(wait),
            10 => self.host_drains(wait),
            11 => {
                let proposal = line_break(wait, self.dice);
                self.push(proposal);
            }
            12 => {
                self.push(line(wait, LineInput::Down(LinkDownReason::Unplugged)));
                let later = self.dice.between(1, 3_000_000);
                self.push(line(later, LineInput::Up));
            }
            _ => {
                self.push(host(wait, HostRequest::Close));
                let later = self.dice.between(1, 3_000_000);
                self.push(host(later, HostRequest::Open));
            }
        }
    }
}
