//! The plug-in that runs: how it begins, is changed, proves itself, gives way and ends.

use crate::board::Board;
use crate::feed::Ending;
use crate::lane::{Lane, NotRun, Setup};
use crate::memory::Bootable;
use crate::settings::pairs;
use crate::unit::Unit;
use alloc::borrow::ToOwned;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, LineParameters, MANIFEST_SECTION};
use softplug_unit_protocol::{Digest, KEPT_SETTINGS, Outcome, SwapOutcome, ToServer, ToUnit};

impl<B: Board> Unit<B> {
    /// The plug-in has ended by a fault: whatever ran before it on trial takes its place.
    pub(crate) fn fail(&mut self, what: String) {
        self.end_lane(what);
        self.give_way();
    }

    /// The plug-in ends, and what it had under way with it.
    pub(crate) fn end_lane(&mut self, what: String) {
        self.break_off();
        self.lane = None;
        self.host.outbox.say(&ToServer::Fault { link: 0, what: crate::host::short(&what) });
        self.fault = Some(what);
    }

    fn break_off(&mut self) {
        self.conclude();
        if self.host.feed.is_under_way() {
            let position = self.position();
            let interrupted = Ending::of(Outcome::Failed, Some(Failure::Interrupted), 0);
            self.host.feed.conclude(interrupted, position);
        }
        self.host.feed.tell_end(&mut self.host.outbox);
        self.host.break_off();
    }

    pub(crate) fn close(&mut self) {
        self.ask(|lane, now, host| lane.link.close(now, host));
        self.break_off();
        self.lane = None;
        self.running = None;
        self.tell_link();
    }

    pub(crate) fn open(&mut self, digest: Digest, settings: &[u8]) {
        let settings = self.settings_of(settings);
        let is_there = self.running == Some(digest) && self.settings == settings;
        if is_there && self.lane.is_some() {
            self.tell_link();
        } else if self.host.feed.is_under_way() {
            self.refuse(ToUnit::OPEN, 0, "a job is under way");
        } else {
            match self.memory.change_to(digest) {
                Ok(bootable) => self.run(bootable, settings),
                Err(error) => self.refuse(ToUnit::OPEN, 0, &error.to_string()),
            }
        }
    }

    /// There is no room for two plug-ins: the state of the old one is not taken over.
    pub(crate) fn swap(&mut self, digest: Digest, settings: &[u8]) {
        let begin = self.board.now();
        let (outcome, why) = if self.host.feed.is_under_way() {
            let why = "this unit changes its plug-in between jobs only";
            (SwapOutcome::Refused, why.to_owned())
        } else {
            match self.memory.change_to(digest) {
                Ok(bootable) => {
                    self.run(bootable, self.settings_of(settings));
                    let runs = self.running == Some(digest) && self.lane.is_some();
                    (if runs { SwapOutcome::Done } else { SwapOutcome::Reverted }, String::new())
                }
                Err(error) => (SwapOutcome::Refused, error.to_string()),
            }
        };
        let pause = (self.board.now() - begin).0.max(0) as u64;
        let why = crate::host::short(&why);
        self.host.outbox.say(&ToServer::Swapped { link: 0, outcome, pause, why });
    }

    /// Those that a message has.
    fn settings_of(&self, settings: &[u8]) -> Vec<u8> {
        if settings == KEPT_SETTINGS { self.settings.clone() } else { settings.to_vec() }
    }

    /// Runs a plug-in in the place of the one that runs. First that one goes: there is room for one only.
    pub(crate) fn run(&mut self, bootable: Bootable, settings: Vec<u8>) {
        if self.lane.is_some() {
            self.ask(|lane, now, host| lane.link.close(now, host));
            self.break_off();
            self.lane = None;
        }
        self.host.state.clear();
        let mut bootable = Some((bootable, settings));
        while let Some((Bootable { module, is_on_trial }, settings)) = bootable.take() {
            self.is_on_trial = is_on_trial;
            match self.begin_lane(module.at, module.length, &settings) {
                Ok(lane) => {
                    self.lane = Some(lane);
                    (self.running, self.settings) = (Some(module.digest), settings);
                    self.fault = None;
                    if core::mem::take(&mut self.is_on_trial) {
                        self.memory.confirm();
                        self.tell_slots();
                    }
                    self.tell_link();
                    self.host.outbox.say(&ToServer::Up { link: 0 });
                }
                Err(error) => {
                    let why = error.to_string();
                    self.refuse(ToUnit::OPEN, 0, &why);
                    self.host.break_off();
                    (self.running, self.fault) = (None, Some(why));
                    bootable = self.give_up_trial().map(|before| (before, Vec::new()));
                }
            }
        }
    }

    fn begin_lane(
        &mut self,
        at: u32,
        length: u32,
        settings: &[u8],
    ) -> Result<Lane<B::Code>, NotRun> {
        let code = self.board.code(at, length);
        let setup = self.setup(code.as_ref(), settings)?;
        self.board.set_line(&setup.line);
        let now = self.board.now();
        Lane::open(code, setup, now, &mut self.host)
    }

    /// What the manifest has to say; it is not kept.
    fn setup(&self, module: &[u8], settings: &[u8]) -> Result<Setup, NotRun> {
        let settings = pairs(settings).ok_or(NotRun::NoPairs)?;
        let json = softplug_interpreter::custom_section(module, MANIFEST_SECTION);
        let manifest = Manifest::parse(json.ok_or(NotRun::NoManifest)?)?;
        let given = || settings.iter().copied();
        let values = manifest.resolve_settings(given())?;
        let named = manifest.line_for(given(), &values).map(|named| named.parameters);
        let baud = self.options.baud;
        let line = LineParameters { baud, ..named.unwrap_or(LineParameters::new(baud)) };
        let mut room = self.options.room;
        if let Some(bytes) = manifest.memory_bytes {
            if bytes > room.memory_bytes {
                let most = room.memory_bytes;
                return Err(NotRun::Memory { bytes, most });
            }
            room.memory_bytes = bytes;
        }
        Ok(Setup { line, values, job_kinds: manifest.jobs.len(), room })
    }

    /// What is on trial does not do: the memory goes back to the plug-in before it, if there is one.
    fn give_up_trial(&mut self) -> Option<Bootable> {
        if !core::mem::take(&mut self.is_on_trial) {
            return None;
        }
        self.memory.fail();
        self.tell_slots();
        self.memory.boot()
    }

    fn give_way(&mut self) {
        if let Some(bootable) = self.give_up_trial() {
            self.run(bootable, Vec::new());
        }
    }
}
