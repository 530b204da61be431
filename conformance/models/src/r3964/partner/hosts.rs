//! What a host does.

use super::{LONGEST, Next, data, host, length, line, line_break, soon};
use crate::model::{HostRequest, LineInput};
use softplug_abi::LinkDownReason;

impl Next<'_> {
    pub(super) fn job(&mut self, wait: i64) {
        let parameters = &self.station.parameters;
        let longest = match self.dice.below(200) {
            0 => LONGEST,
            1..=10 => 5_000,
            _ => parameters.block_size * if parameters.split { 4 } else { 1 },
        };
        let length =
            length(parameters.block_size, longest.min(60 * parameters.block_size), self.dice);
        let data = data(length, self.dice);
        let id = self.station.jobs + 1;
        let job = HostRequest::Job { id, kind: "send".into(), fields: Vec::new(), data };
        self.push(host(wait, job));
    }

    pub(super) fn host_drains(&mut self, wait: i64) {
        let room = &self.station.room;
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
        let id = self.station.jobs.max(1);
        match self.dice.below(14) {
            0..=2 => self.push(host(wait, HostRequest::Pause(id))),
            3 | 4 => self.push(host(wait, HostRequest::Resume(id))),
            5 => self.push(host(wait, HostRequest::Abort(id))),
            6 => self.push(host(wait, HostRequest::Abort(0))),
            7 => self.push(host(wait, HostRequest::ForceResume)),
            8 | 9 => self.job(wait),
            10 => self.host_drains(wait),
            11 => self.push(line_break(wait)),
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
