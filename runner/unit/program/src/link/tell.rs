//! What a server is told of a link as a whole.

use softplug_abi::NoteLevel;
use softplug_live::reactor::LaneFigures;
use softplug_unit_protocol::ToServer;

use super::{Asked, Link, Surroundings, short};
use crate::memory::{Download, MemoryError};

impl Link {
    pub(super) fn tell_download(
        &mut self,
        download: Result<Download, MemoryError>,
        around: &mut Surroundings<'_>,
    ) {
        let link = self.number;
        match download {
            Ok(Download::Until(until)) => around.say(&ToServer::Downloaded { link, until }),
            Ok(Download::Whole(slot)) => around.say(&ToServer::Installed { link, slot }),
            Err(error) => {
                let why = error.to_string();
                around.say(&ToServer::NotInstalled { link, why: short(&why) });
            }
        }
    }

    /// What a new server has to know.
    pub(super) fn tell_all(&mut self, around: &mut Surroundings<'_>) {
        self.tell_slots(around);
        self.tell_link(around);
        self.tell_port(around);
        let link = self.number;
        if !self.state.is_empty() {
            around.say(&ToServer::State { link, name: short(&self.state) });
        }
        if let Some(fault) = &self.fault {
            around.say(&ToServer::Fault { link, what: short(fault) });
        }
        if let Some(trouble) = self.trouble.as_ref().filter(|_| self.running.is_none()) {
            let (level, code) = (NoteLevel::Error, 0);
            around.say(&ToServer::Note { link, level, code, text: short(trouble) });
        }
        self.answer = (0, Vec::new());
        self.jobs.tell_all(around);
        self.deliveries.begin_anew();
        for (&request, Asked { kind, fields, .. }) in &self.requests {
            around.say(&ToServer::Request { link, request, kind: *kind, fields });
        }
        around.say(&ToServer::Told { link });
        self.counted = None;
    }

    /// Also when what is on trial has proved itself, or has not.
    pub(super) fn tell_slots(&mut self, around: &mut Surroundings<'_>) {
        for slot in self.memory.tell(self.number) {
            around.say(&slot);
        }
    }

    pub(super) fn tell_link(&mut self, around: &mut Surroundings<'_>) {
        let (job, pass, received, is_whole) = self.jobs.received();
        around.say(&ToServer::Link {
            link: self.number,
            is_up: self.is_port_open,
            digest: self.running.as_ref().map_or([0; 32], |running| running.digest),
            job,
            pass,
            received,
            is_whole,
            name: &self.config.name,
        });
    }

    pub(super) fn tell_port(&mut self, around: &mut Surroundings<'_>) {
        let link = self.number;
        match &self.down {
            _ if self.is_port_open => around.say(&ToServer::Up { link }),
            Some((reason, retry_in, detail)) => {
                let retry_in = retry_in.0.max(0) as u64;
                around.say(&ToServer::Down {
                    link,
                    reason: *reason,
                    retry_in,
                    detail: short(detail),
                });
            }
            None => {}
        }
    }

    pub(super) fn count(&mut self, figures: LaneFigures, around: &mut Surroundings<'_>) {
        let is_quiet = figures.job != 0 || self.counted.as_ref() == Some(&figures);
        if is_quiet || !around.is_up {
            return;
        }
        around.remark(&ToServer::Counters {
            link: self.number,
            bytes_in: figures.bytes_in,
            bytes_out: figures.bytes_out,
            holds: figures.holds,
            held: figures.held_micros,
            starved: figures.starvations,
            starved_for: figures.starved_micros,
            line_errors: figures.line_errors.iter().sum(),
        });
        self.counted = Some(figures);
    }
}
