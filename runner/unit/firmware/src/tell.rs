//! What the server is told of the link as a whole.

use crate::board::Board;
use crate::host::short;
use crate::memory::Download;
use crate::unit::Unit;
use alloc::string::ToString;
use softplug_unit_protocol::ToServer;
use softplug_unit_slots::{Device, Error};

impl<B: Board> Unit<B> {
    pub(crate) fn tell_download(
        &mut self,
        download: Result<Download, Error<<B::Flash as Device>::Error>>,
    ) {
        let (link, outbox) = (0, &mut self.host.outbox);
        match download {
            Ok(Download::Until(until)) => outbox.say(&ToServer::Downloaded { link, until }),
            Ok(Download::Whole(slot)) => outbox.say(&ToServer::Installed { link, slot }),
            Err(error) => {
                let why = error.to_string();
                outbox.say(&ToServer::NotInstalled { link, why: short(&why) });
            }
        }
    }

    /// What a new server has to know.
    pub(crate) fn tell_all(&mut self) {
        let (links, serial, name) = (1, self.options.serial, self.options.name);
        self.host.outbox.say(&ToServer::Unit { links, serial, name });
        self.tell_slots();
        self.tell_link();
        let (link, host) = (0, &mut self.host);
        if self.lane.is_some() {
            host.outbox.say(&ToServer::Up { link });
        }
        if !host.state.is_empty() {
            host.outbox.say(&ToServer::State { link, name: short(&host.state) });
        }
        if let Some(fault) = &self.fault {
            host.outbox.say(&ToServer::Fault { link, what: short(fault) });
        }
        self.answer = None;
        host.feed.tell_all(&mut host.outbox);
        host.deliveries.begin_anew();
        for asked in &host.requests {
            host.outbox.say(&asked.message());
        }
        host.outbox.say(&ToServer::Told { link });
        self.counted = None;
    }

    /// Also when what is on trial has proved itself, or has not.
    pub(crate) fn tell_slots(&mut self) {
        for slot in self.memory.tell() {
            self.host.outbox.say(&slot);
        }
    }

    pub(crate) fn tell_link(&mut self) {
        let (job, pass, received, is_whole) = self.host.feed.received();
        self.host.outbox.say(&ToServer::Link {
            link: 0,
            is_up: self.lane.is_some(),
            digest: self.running.unwrap_or_default(),
            job,
            pass,
            received,
            is_whole,
            name: self.options.link,
        });
    }

    pub(crate) fn refuse(&mut self, message: u8, job: u64, why: &str) {
        let why = short(why);
        self.host.outbox.say(&ToServer::Refused { message, link: 0, job, why });
    }

    /// Not while a job is under way: its progress says more.
    pub(crate) fn count(&mut self) {
        let is_quiet = self.host.feed.is_under_way() || self.counted == Some(self.counters);
        if !is_quiet && self.host.outbox.is_up && !self.host.outbox.is_busy() {
            self.host.outbox.say(&self.counters.message(0));
            self.counted = Some(self.counters);
        }
    }
}
