//! Lanes: made for links, closed, made anew.

use std::sync::Arc;
use std::time::Instant;

use softplug_abi::Micros;
use softplug_host::Session;
use softplug_live::PortOptions;
use softplug_live::channel::StationOptions;
use softplug_live::endpoint::ServerEndpoint;
use softplug_live::reactor::{
    Backoff, Command, LaneEndpoint, LaneId, LaneSetup, LaneStatus, Watchdogs,
};
use softplug_live::units::{UnitAddress, UnitSetup};
use thiserror::Error;

use super::Control;
use super::history::History;
use super::link::{After, Before, EndsAs, Lane, Link, PortFacts};
use super::loading::{Prepared, Unloadable};
use super::simulated::{NoMachine, Simulated};
use crate::config::{LinkConfig, PortConfig, micros};
use crate::jobs::{Subject, Weight};
use crate::library::Use;
use crate::supervise::{Follow, Limits, Supervisor};

/// How long a closing lane may take to send what its port was given.
const CLOSING: Micros = Micros::from_millis(1_000);

impl Control {
    /// A new link.
    pub(super) fn add(&mut self, config: LinkConfig, plugin: Prepared) {
        let name = config.name.clone();
        let limits = limits(&self.config.supervision);
        let digest = plugin.digest();
        self.note_use(&name, &plugin, None);
        let link = Link {
            next: None,
            unapplied: None,
            lane: Lane::Open(LaneId(0)),
            status: Arc::new(LaneStatus::default()),
            supervisor: Supervisor::new(limits),
            follow: Follow::new(digest),
            port: PortFacts::default(),
            condition: None,
            condition_since: Instant::now(),
            alarms: Vec::new(),
            job: None,
            deliveries: std::collections::BTreeMap::new(),
            requests: std::collections::HashMap::new(),
            swap: None,
            faults: std::collections::VecDeque::new(),
            gauge: None,
            before: Before::default(),
            history: History::default(),
            ran_well: None,
            machine: None,
            config,
            plugin,
        };
        self.links.insert(name.clone(), link);
        self.open_lane(&name);
    }

    /// Makes the lane of a link.
    fn open_lane(&mut self, name: &str) {
        let id = LaneId(self.next_lane);
        self.next_lane += 1;
        let Some(link) = self.links.get_mut(name) else { return };
        link.lane = Lane::Open(id);
        link.status = Arc::new(LaneStatus::default());
        link.machine = None;
        link.port = PortFacts::default();
        link.condition = None;
        link.alarms.clear();
        self.lanes.insert(id, name.to_owned());
        if let Some(remark) = link.config.line_remark(link.plugin.line()) {
            let journal_writer = &self.shared.parts.journal_writer;
            journal_writer.link(Subject::Port, Weight::Warning, name, remark.message);
        }
        if let PortConfig::Unit(address) = &link.config.port {
            let stored = self.shared.parts.jobs.reader().stored_delivery(&address.to_string());
            let setup = UnitSetup {
                address: address.clone(),
                tls: link.config.tls.clone(),
                plugin: link.plugin.for_unit(),
                delivery_room: link.config.delivery_room,
                stored: stored.unwrap_or_else(|error| {
                    tracing::error!(%error, link = name, "what its unit says again may be kept twice");
                    None
                }),
                reopen: backoff(&link.config),
                bus: link.config.bus.clone(),
            };
            self.drivers.add_unit(id, setup);
        } else {
            match setup(link) {
                Ok(setup) => self.drivers.add(id, setup),
                Err(error) => {
                    self.cannot_open(name, &error.to_string());
                    return;
                }
            }
        }
        if let Some(status) = self.drivers.status(id)
            && let Some(link) = self.links.get_mut(name)
        {
            link.status = status;
        }
    }

    fn cannot_open(&mut self, name: &str, text: &str) {
        let Some(link) = self.links.get_mut(name) else { return };
        link.port.down = Some(crate::view::DownView {
            reason: text.to_owned(),
            since_ms: crate::view::now_ms(),
            retry_at_ms: None,
        });
        let text = format!("the link cannot be opened: {text}");
        self.shared.parts.journal_writer.link(Subject::Port, Weight::Alarm, name, text);
    }

    /// Closes a link's lane.
    pub(super) fn close(&mut self, name: &str, after: After) {
        let Some(link) = self.links.get_mut(name) else { return };
        let id = link.lane_id();
        if let Some(running) = link.job.as_mut().filter(|running| running.ends_as == EndsAs::ItIs) {
            // In the way that the protocol has for it, as far as there is time.
            running.ends_as = EndsAs::Interrupted("the link was closed in the middle of it");
            self.drivers.tell(id, Command::Abort(running.job.id));
        }
        let has_lane = self.drivers.status(id).is_some();
        link.lane = Lane::Closing(id, after);
        if has_lane {
            let hand_over = self.stopping.as_ref().is_some_and(|stopping| stopping.hands_over);
            self.drivers.tell(id, Command::Close { patience: CLOSING, hand_over });
        } else {
            self.shared.tell(move |control| {
                control.hear(id, softplug_live::reactor::Report::Removed);
            });
        }
    }

    /// The lane of a link was closed: opens it as the configuration says now.
    pub(super) fn remake(&mut self, name: &str) {
        let Some(link) = self.links.get_mut(name) else { return };
        link.before.add(&link.status.read());
        link.give_up_swap("the link was made anew before it was idle");
        if let Some(next) = link.next.take() {
            let (config, plugin) = *next;
            link.config = config;
            link.plugin = plugin;
            link.unapplied = None;
            link.follow.runs(link.plugin.digest());
            link.supervisor.begin_anew();
            let plugin = link.plugin.clone();
            self.note_use(name, &plugin, None);
        }
        self.open_lane(name);
    }

    /// Closes a port and opens it again.
    pub(super) fn reopen(&mut self, name: &str) -> Result<(), crate::Refusal> {
        let link = self.link(name)?;
        let (lane, id) = (link.lane, link.lane_id());
        match lane {
            Lane::Open(_) if self.drivers.status(id).is_some() => {
                self.drivers.tell(id, Command::Reopen);
                Ok(())
            }
            Lane::Open(_) => {
                self.lanes.remove(&id);
                self.open_lane(name);
                Ok(())
            }
            Lane::Closing(..) => {
                Err(crate::Refusal::Conflict(format!("the link \"{name}\" is being closed")))
            }
        }
    }

    /// The library keeps what links run, and what they would go back to.
    pub(super) fn note_use(&self, name: &str, running: &Prepared, former: Option<&Prepared>) {
        let used = Use {
            running: Some(running.digest()),
            last_good: Some(former.unwrap_or(running).digest()),
        };
        let (shared, name) = (Arc::clone(&self.shared), name.to_owned());
        self.shared.parts.worker.give(move || {
            if let Err(error) = shared.parts.loader.library().note_use(&name, used) {
                tracing::warn!(%error, "the library does not know what a link uses");
            }
        });
    }
}

/// Why a lane cannot be made.
#[derive(Debug, Error)]
enum NoLane {
    #[error(transparent)]
    Machine(#[from] NoMachine),
    #[error("{0} is no port of this computer")]
    Elsewhere(UnitAddress),
    #[error(transparent)]
    Plugin(#[from] Unloadable),
    #[error("the plug-in {0} cannot have an endpoint: it has no job \"send\"")]
    NoSend(String),
}

fn setup(link: &mut Link) -> Result<LaneSetup<Session>, NoLane> {
    let config = &link.config;
    let port = match &config.port {
        PortConfig::Port(spec) => spec.clone(),
        PortConfig::Simulated(machine) => {
            let simulated = Simulated::start(machine, config.line)?;
            let port = simulated.port().clone();
            link.machine = Some(simulated);
            port
        }
        PortConfig::Unit(address) => return Err(NoLane::Elsewhere(address.clone())),
    };
    let instance = link.plugin.instance()?;
    let mut port_options = PortOptions::new(config.line);
    port_options.flow = config.flow;
    port_options.exclusive = config.exclusive;
    port_options.connect_timeout = config.connect;
    if matches!(config.port, PortConfig::Simulated(_)) && port_options.line.baud == 0 {
        port_options.line.baud = 9_600;
    }
    let watchdogs = config.watchdogs;
    Ok(LaneSetup {
        port,
        port_options,
        station: StationOptions {
            settings: link.plugin.values.clone(),
            depth: config.depth,
            transmit_room: config.transmit_room,
            delivery_room: config.delivery_room,
        },
        instance,
        endpoint: endpoint(link)?,
        watchdogs: Watchdogs {
            no_bytes: watchdogs.no_bytes.map(micros),
            no_progress: watchdogs.no_progress.map(micros),
            stuck_held: watchdogs.stuck_held.map(micros),
        },
        reopen: backoff(config),
        recorder_bytes: config.recorder as usize,
    })
}

fn backoff(config: &LinkConfig) -> Backoff {
    Backoff { first: micros(config.reopen.first), longest: micros(config.reopen.longest) }
}

/// What its client sends becomes a job that sends.
fn endpoint(link: &Link) -> Result<Option<LaneEndpoint>, NoLane> {
    let Some(setup) = link.config.endpoint else { return Ok(None) };
    let manifest = link.plugin.plugin.manifest();
    let job_kind = manifest.job_kind("send");
    let job_kind = job_kind.ok_or_else(|| NoLane::NoSend(manifest.name.clone()))?;
    let endpoint = Box::new(ServerEndpoint::new(setup));
    Ok(Some(LaneEndpoint { endpoint, job_kind, fields: Vec::new(), check: false }))
}

pub(super) fn limits(config: &crate::config::Supervision) -> Limits {
    Limits {
        first_delay: config.first_delay,
        longest_delay: config.longest_delay,
        faults: config.faults,
        within: config.within,
    }
}
