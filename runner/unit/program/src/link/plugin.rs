//! The plug-in of a link: compiled, run, swapped, on trial.

use std::thread;

use softplug_abi::manifest::{SettingError, SettingValues};
use softplug_abi::{LineParameters, Micros, NoteLevel};
use softplug_host::{LoadError, Plugin, SessionFault};
use softplug_link::{Spare, Successor};
use softplug_live::PortOptions;
use softplug_live::channel::StationOptions;
use softplug_live::port::parse_line;
use softplug_live::reactor::{
    Backoff, Command, LaneId, LaneSetup, Probation, Swap, SwapReport, Watchdogs, When,
};
use softplug_unit_protocol::{Digest, SwapOutcome, ToServer, ToUnit};
use thiserror::Error;

use super::settings::{Given, NotKept};
use super::{Link, Surroundings, short};
use crate::memory::Bootable;

/// How long a lane that closes may take to let leave what its port has.
const CLOSING: Micros = Micros::from_millis(1_000);
/// Bytes of the flight recorder of a lane.
const RECORDER: usize = 64 << 10;
/// Bytes of what comes from the machine that wait for the uplink, beside those under way.
const DELIVERY_ROOM: u32 = 16 << 10;

/// A plug-in that was compiled for a link, and what for.
pub(crate) struct Compiled {
    pub(crate) link: u8,
    plugin: Result<Plugin, LoadError>,
    digest: Digest,
    given: Given,
    purpose: Purpose,
}

/// Why a plug-in is not taken.
#[derive(Debug, Error)]
enum NotTaken {
    #[error(transparent)]
    Load(LoadError),
    #[error("it does not take its settings: {0}")]
    Settings(SettingError),
    #[error("it does not take its settings: {0}")]
    Refused(SessionFault),
    #[error("it has ended by a fault: {0}")]
    Ended(SessionFault),
    #[error(transparent)]
    NotKept(#[from] NotKept),
}

#[derive(Clone, Debug)]
pub(super) enum Purpose {
    /// It is the link's plug-in from now on.
    Run,
    /// It takes the place of the running one.
    Swap { when: When, probation: Probation },
}

/// A plug-in on a lane.
#[derive(Clone)]
pub(super) struct Running {
    pub(super) digest: Digest,
    pub(super) plugin: Plugin,
    pub(super) given: Given,
    pub(super) values: SettingValues,
}

impl Link {
    /// Compiling takes long where there is little to compute with: not on this thread.
    pub(super) fn compile(
        &mut self,
        bootable: Bootable,
        given: Given,
        purpose: Purpose,
        around: &mut Surroundings<'_>,
    ) {
        let Bootable { digest, bytes, is_on_trial } = bootable;
        self.awaited = Some(digest);
        self.is_on_trial = is_on_trial;
        let (host, compiled, waker) =
            (around.host.clone(), around.compiled.clone(), around.waker.clone());
        let link = self.number;
        let load = move || {
            let plugin = host.load_bytes(&bytes);
            if compiled.send(Compiled { link, plugin, digest, given, purpose }).is_ok() {
                waker.wake();
            }
        };
        let spawned = thread::Builder::new().name("softplug-load".to_owned()).spawn(load);
        if let Err(error) = spawned {
            self.awaited = None;
            let why = format!("no thread to compile it: {error}");
            self.refuse(ToUnit::OPEN, 0, &why, around);
        }
    }

    /// A plug-in was compiled.
    pub(crate) fn compiled(&mut self, compiled: Compiled, around: &mut Surroundings<'_>) {
        if self.awaited != Some(compiled.digest) {
            return;
        }
        self.awaited = None;
        let Compiled { plugin, digest, given, purpose, .. } = compiled;
        let given = self.wanted.take().unwrap_or(given);
        let running = plugin.map_err(NotTaken::Load).and_then(|plugin| {
            let named = given.settings.iter().map(|(name, value)| (name.as_str(), value.as_str()));
            let values = plugin.manifest().resolve_settings(named).map_err(NotTaken::Settings)?;
            // Before anything is changed: neither what it refuses nor what cannot be kept runs.
            let mut tried = plugin.instantiate().map_err(NotTaken::Load)?;
            tried.configure(&values, Micros::ZERO).map_err(|fault| match fault.refusal() {
                Some(_) => NotTaken::Refused(fault),
                None => NotTaken::Ended(fault),
            })?;
            let is_swap = matches!(purpose, Purpose::Swap { .. }) && self.lane.is_some();
            self.before = Some(self.settings());
            if !is_swap {
                self.keep_settings(&given)?;
            }
            Ok(Running { digest, plugin, given, values })
        });
        match (running, purpose) {
            (Ok(running), Purpose::Swap { when, probation }) if self.lane.is_some() => {
                self.swap(running, when, probation, around);
            }
            (Ok(running), _) => self.run(running, around),
            (Err(error), purpose) => {
                let why = error.to_string();
                tracing::error!(link = self.config.name, why, "a plug-in is not taken");
                self.trouble = Some(why.clone());
                match purpose {
                    Purpose::Run => self.refuse(ToUnit::OPEN, 0, &why, around),
                    Purpose::Swap { .. } => self.tell_swap(SwapOutcome::Refused, 0, &why, around),
                }
                self.not_run(around);
            }
        }
    }

    /// A plug-in cannot be run. Where another one runs it goes on.
    fn not_run(&mut self, around: &mut Surroundings<'_>) {
        if self.lane.is_some() {
            self.give_up_trial();
        } else {
            self.give_way(around);
        }
    }

    /// The lane of this plug-in; behind the end of the lane that there is.
    pub(super) fn run(&mut self, running: Running, around: &mut Surroundings<'_>) {
        if let Some(lane) = self.lane {
            self.next = Some(Box::new(running));
            let command = Command::Close { patience: CLOSING, hand_over: false };
            around.reactor.tell(lane, command);
            return;
        }
        let instance = match running.plugin.instantiate() {
            Ok(instance) => instance,
            Err(error) => {
                self.refuse(ToUnit::OPEN, 0, &error.to_string(), around);
                self.trouble = Some(error.to_string());
                self.not_run(around);
                return;
            }
        };
        let given = running.given.settings.iter();
        let given = given.map(|(name, value)| (name.as_str(), value.as_str()));
        let named = running.plugin.manifest().line_for(given, &running.values);
        let base = named.map_or(LineParameters::new(0), |named| named.parameters);
        let text = self.config.line.as_deref().unwrap_or_default();
        let line = parse_line(text, base).unwrap_or(base);
        let lane = LaneId(*around.next_lane);
        *around.next_lane += 1;
        around.reactor.add(
            lane,
            LaneSetup {
                port: self.config.port.clone(),
                port_options: PortOptions::new(line),
                station: StationOptions {
                    settings: running.values.clone(),
                    depth: self.config.depth,
                    delivery_room: DELIVERY_ROOM,
                    ..StationOptions::default()
                },
                instance,
                endpoint: None,
                watchdogs: Watchdogs::default(),
                reopen: Backoff::default(),
                recorder_bytes: RECORDER,
            },
        );
        self.lane = Some(lane);
        self.running = Some(running);
        (self.fault, self.trouble) = (None, None);
        self.tell_link(around);
    }

    pub(super) fn swap(
        &mut self,
        successor: Running,
        when: When,
        probation: Probation,
        around: &mut Surroundings<'_>,
    ) {
        let (Some(lane), Some(running)) = (self.lane, &self.running) else { return };
        let (new, old) = (successor.plugin.manifest(), running.plugin.manifest());
        let accepts_back = old.accepts_of(new);
        let goes_back = new.state.saves.is_some_and(|format| accepts_back.contains(&format));
        let instances = successor.plugin.instantiate().and_then(|instance| {
            let has_spare = goes_back && probation != Probation::default();
            let spare = has_spare.then(|| running.plugin.instantiate()).transpose()?;
            Ok((instance, spare))
        });
        let (instance, spare) = match instances {
            Ok(instances) => instances,
            Err(error) => {
                let why = error.to_string();
                self.swapped(SwapReport::Refused { sentence: why }, around);
                return;
            }
        };
        let spare = spare.map(|instance| Spare { instance, accepts: accepts_back.to_vec() });
        let successor_of_lane = Successor {
            instance,
            settings: successor.values.clone(),
            accepts: new.accepts_of(old).to_vec(),
            spare,
        };
        self.successor = Some(successor);
        let swap = Swap { successor: successor_of_lane, when, probation };
        around.reactor.tell(lane, Command::Swap(swap));
    }

    pub(super) fn swapped(&mut self, report: SwapReport, around: &mut Surroundings<'_>) {
        let (outcome, pause, why) = match report {
            SwapReport::Waiting => (SwapOutcome::Waiting, 0, String::new()),
            SwapReport::Done { pause, with_state, on_probation } => {
                if let Some(successor) = self.successor.take() {
                    self.keep_or_tell(&successor.given, around);
                    let former = self.running.replace(successor);
                    self.former = former.filter(|_| on_probation);
                }
                if !on_probation {
                    self.is_on_trial = false;
                    self.memory.confirm();
                }
                let outcome =
                    if with_state { SwapOutcome::DoneWithState } else { SwapOutcome::Done };
                (outcome, pause.0.max(0) as u64, String::new())
            }
            SwapReport::Kept => {
                self.former = None;
                self.is_on_trial = false;
                self.memory.confirm();
                (SwapOutcome::Kept, 0, String::new())
            }
            SwapReport::Refused { sentence } => {
                self.successor = None;
                // The memory alone goes back: on the lane it never was.
                self.give_up_trial();
                (SwapOutcome::Refused, 0, sentence)
            }
            SwapReport::Reverted(fault) => {
                self.running = self.former.take();
                if let Some(given) = self.running.as_ref().map(|running| running.given.clone()) {
                    self.keep_or_tell(&given, around);
                }
                self.give_up_trial();
                (SwapOutcome::Reverted, 0, fault.sentence)
            }
        };
        self.tell_swap(outcome, pause, &why, around);
    }

    /// What is on trial does not do: the memory goes back to the plug-in before it, if there is one.
    fn give_up_trial(&mut self) -> Option<Bootable> {
        if !std::mem::take(&mut self.is_on_trial) {
            return None;
        }
        self.memory.fail();
        self.memory.boot().unwrap_or_else(|error| {
            let error = error.to_string();
            tracing::error!(link = self.config.name, error, "the one before cannot run");
            None
        })
    }

    /// What is on trial does not do, and nothing else runs: the plug-in before it takes its place.
    pub(super) fn give_way(&mut self, around: &mut Surroundings<'_>) {
        if let Some(bootable) = self.give_up_trial() {
            let before = self.before.take().unwrap_or_else(|| self.settings());
            self.compile(bootable, before, Purpose::Run, around);
        }
    }

    /// What runs already goes on, also where its settings cannot be kept.
    fn keep_or_tell(&self, given: &Given, around: &mut Surroundings<'_>) {
        if let Err(error) = self.keep_settings(given) {
            let text = format!("{error}: after a start the settings are old");
            tracing::error!(link = self.config.name, "{text}");
            let (link, level) = (self.number, NoteLevel::Error);
            around.say(&ToServer::Note { link, level, code: 0, text: short(&text) });
        }
    }

    pub(super) fn tell_swap(
        &mut self,
        outcome: SwapOutcome,
        pause: u64,
        why: &str,
        around: &mut Surroundings<'_>,
    ) {
        let why = short(why);
        self.tell_slots(around);
        around.say(&ToServer::Swapped { link: self.number, outcome, pause, why });
    }

    pub(super) fn open(&mut self, digest: Digest, settings: &[u8], around: &mut Surroundings<'_>) {
        let given = self.settings_of(settings);
        let is_there = self.running.as_ref().is_some_and(|running| {
            let given = given.as_ref().map(|given| &given.settings);
            running.digest == digest && Some(&running.given.settings) == given
        });
        if is_there && self.lane.is_some() && self.fault.is_none() {
            self.tell_link(around);
        } else if self.awaited == Some(digest) && given.is_some() {
            // It is on its way, after a start for instance.
            self.wanted = given;
        } else if self.jobs.is_under_way() {
            self.refuse(ToUnit::OPEN, 0, "a job is under way", around);
        } else {
            self.change(digest, settings, Purpose::Run, ToUnit::OPEN, around);
        }
    }

    /// Whether a swap to this plug-in with these settings waits already.
    pub(super) fn is_on_its_way(&self, digest: Digest, settings: &[u8]) -> bool {
        let given = self.settings_of(settings);
        self.successor.as_ref().is_some_and(|successor| {
            let given = given.as_ref().map(|given| &given.settings);
            successor.digest == digest && Some(&successor.given.settings) == given
        })
    }

    /// Another plug-in, or other settings.
    pub(super) fn change(
        &mut self,
        digest: Digest,
        settings: &[u8],
        purpose: Purpose,
        message: u8,
        around: &mut Surroundings<'_>,
    ) {
        let Some(given) = self.settings_of(settings) else {
            self.refuse(message, 0, "the settings are not pairs of texts", around);
            return;
        };
        if self.awaited.is_some() || self.successor.is_some() || self.next.is_some() {
            self.refuse(message, 0, "another plug-in is just being taken", around);
            return;
        }
        match self.memory.change_to(digest) {
            Ok(bootable) => self.compile(bootable, given, purpose, around),
            Err(error) => self.refuse(message, 0, &error.to_string(), around),
        }
    }

    pub(super) fn close(&mut self, around: &mut Surroundings<'_>) {
        self.next = None;
        if self.lane.is_none() {
            self.tell_link(around);
        }
        self.command(Command::Close { patience: CLOSING, hand_over: false }, around);
    }
}
