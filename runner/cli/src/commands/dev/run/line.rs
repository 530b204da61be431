//! A link on a port in this process, whose plug-in is swapped.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;

use softplug_abi::{Action, JobId, Micros};
use softplug_link::{Job, LinkHost, Successor, Supply, SwapError};
use softplug_live::station::{Brake, Station, StationError, StationOptions, Turn};
use softplug_live::store::{Inbox, Mark};
use softplug_live::{PortOptions, PortSpec};
use softplug_trial::reason;

use super::{Ready, next};
use crate::commands::dev::Arguments;
use crate::failure::Failure;
use crate::line::ChosenLine;
use crate::live::open;
use crate::numbers;
use crate::plugin::{AnyFault, AnyInstance, Chosen};
use crate::screen::{GOOD, Screen};

const TURN: Micros = Micros::from_millis(50);
/// What has been given to the port may leave for so long at the end.
const PATIENCE: Micros = Micros::from_millis(500);
/// Bytes of a delivery that are shown.
const SHOWN: usize = 60;

/// The link, between two plug-ins or with one.
pub(super) struct Line<'a> {
    port: &'a PortSpec,
    arguments: &'a Arguments,
    screen: &'a Screen,
    host: DevHost<'a>,
    station: Option<Station<AnyInstance>>,
    next_job: JobId,
}

impl<'a> Line<'a> {
    pub(super) fn new(
        port: &'a PortSpec,
        arguments: &'a Arguments,
        data: Option<Vec<u8>>,
        inbox: Option<Inbox>,
        screen: &'a Screen,
    ) -> Self {
        let host = DevHost {
            screen,
            plugin: None,
            data: data.unwrap_or_default(),
            given: 0,
            shown: Vec::new(),
            inbox,
            name: None,
            bytes: 0,
            drained: 0,
            brake: None,
        };
        Self { port, arguments, screen, host, station: None, next_job: JobId(1) }
    }

    /// Runs the latest plug-in until `stop`.
    pub(super) fn run(&mut self, ready: &Receiver<Ready>, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let came = match &self.station {
                Some(_) => ready.try_recv().ok(),
                None => next(ready, stop),
            };
            if let Some(ready) = came {
                self.take(ready);
            }
            self.turn();
        }
        if let Some(station) = &mut self.station {
            let closed = station.close(PATIENCE, &mut self.host);
            if let Err(error) = closed {
                tracing::debug!(%error, "not closed in order");
            }
        }
    }

    /// Puts the plug-in on the line and tells it.
    fn take(&mut self, Ready { plugin, mut round, since }: Ready) {
        match self.swap(&plugin) {
            Ok(how) => {
                let took = numbers::span(since.elapsed());
                self.screen.say(format_args!("{GOOD}swapped{GOOD:#} {how}, {took} after the save"));
                round.result = "swapped";
                self.begin_job(&plugin);
            }
            Err(failure) => {
                self.screen.report_failure(&failure);
                round.result = "not-swapped";
                round.message = Some(failure.message);
            }
        }
        round.seconds = since.elapsed().as_secs_f64();
        self.screen.json_line(&round);
    }

    fn swap(&mut self, plugin: &Chosen) -> Result<&'static str, Failure> {
        let settings = plugin.settings(&self.arguments.settings)?;
        if let Some(station) = &mut self.station {
            let running = self.host.plugin.as_ref().unwrap_or(plugin);
            let successor = Successor {
                instance: plugin.instantiate()?,
                settings: settings.clone(),
                accepts: plugin.manifest().accepts_of(running.manifest()).to_vec(),
                spare: None,
            };
            let swapped =
                station.ask(&mut self.host, |link, now, host| link.swap_to(now, successor, host));
            match swapped? {
                Ok(_) => {
                    self.host.plugin = Some(plugin.clone());
                    return Ok("with its state");
                }
                Err(SwapError::Failed(fault)) => {
                    self.station = None;
                    return Err(Failure::plug_in(format_args!("the plug-in failed: {fault}")));
                }
                Err(error) => self.screen.note(format_args!("as new: {error}")),
            }
        }
        // The old one lets go of the port first.
        if let Some(mut station) = self.station.take() {
            station.close(PATIENCE, &mut self.host).map_err(failure)?;
        }
        let asked = self.arguments.line.as_ref();
        let line = ChosenLine::of(asked, plugin.manifest(), &self.arguments.settings, &settings);
        let port = open(self.port, &PortOptions::new(line.line), &line, self.screen)?;
        let options = StationOptions { settings, ..StationOptions::default() };
        let mut station = Station::new(port, plugin.instantiate()?, options)?;
        self.host.plugin = Some(plugin.clone());
        self.host.brake = Some(station.brake());
        station.open(&mut self.host).map_err(failure)?;
        self.station = Some(station);
        Ok("as new")
    }

    /// Sends the file, if there is one and none is under way.
    fn begin_job(&mut self, plugin: &Chosen) {
        let Some(station) = &mut self.station else { return };
        let manifest = plugin.manifest();
        let kind = manifest.job_kind("send").filter(|_| self.arguments.send.is_some());
        let Some(kind) = kind.filter(|_| station.link().job().is_none()) else { return };
        self.host.given = 0;
        let job = Job {
            id: self.next_job,
            kind,
            size: Some(self.host.data.len() as u64),
            fields: Vec::new(),
            check: manifest.needs.check_pass,
        };
        self.next_job = self.next_job.next();
        let begun = station.begin_job(job, &mut self.host);
        self.look_at(begun.map(|()| Turn::Live));
    }

    fn turn(&mut self) {
        if let Some(station) = &mut self.station {
            let until = station.now() + TURN;
            let mut turned = station.turn(until, &mut self.host);
            if turned.is_ok() && station.brake().is_pulled() {
                // What was said behind what is not kept does not leave. A job has lost some of its
                // bytes with that, and is aborted as a delivery is.
                station.drop_unsent();
                let job = station.link().job().unwrap_or(JobId::NONE);
                turned = station
                    .abort(job, &mut self.host)
                    .and_then(|()| station.abort(JobId::NONE, &mut self.host))
                    .map(|()| Turn::Live);
            }
            self.look_at(turned);
        }
    }

    /// A link that is over waits for the next plug-in.
    fn look_at(&mut self, turned: Result<Turn, StationError<AnyFault>>) {
        let why = match turned {
            Ok(Turn::Live) => return,
            Ok(Turn::Gone(reason)) => {
                Failure::new(crate::exit::Exit::Port, format_args!("the port is gone: {reason}"))
            }
            Err(error) => failure(error),
        };
        self.station = None;
        self.screen.report_failure(&why.hint("the next save opens the port again"));
    }
}

fn failure(error: StationError<AnyFault>) -> Failure {
    match error {
        StationError::Port(error) => error.into(),
        StationError::Plugin(fault) => {
            Failure::plug_in(format_args!("the plug-in failed: {fault}"))
        }
    }
}

/// What the plug-in does is shown, what it sends comes from memory.
struct DevHost<'a> {
    screen: &'a Screen,
    plugin: Option<Chosen>,
    data: Vec<u8>,
    /// Bytes of the data that were supplied.
    given: usize,
    /// The delivery under way: its first bytes, and how many there are.
    shown: Vec<u8>,
    /// Where deliveries are kept, if they are.
    inbox: Option<Inbox>,
    name: Option<String>,
    bytes: u64,
    drained: u32,
    /// Pulled where something is not kept: it is not acknowledged either.
    brake: Option<Brake>,
}

impl DevHost<'_> {
    /// Does something with the folder that keeps deliveries, if there is one.
    fn keep<T>(&mut self, act: impl FnOnce(&mut Inbox) -> std::io::Result<T>) -> Option<T> {
        match act(self.inbox.as_mut()?) {
            Ok(done) => Some(done),
            Err(error) => {
                // With --json, too: no document tells it.
                self.screen.note(format_args!("error: what comes is not kept: {error}"));
                if let Some(brake) = &self.brake {
                    brake.pull();
                }
                None
            }
        }
    }

    fn reason(&self, why: softplug_abi::Failure, status: u16) -> String {
        match &self.plugin {
            Some(plugin) => reason(plugin.manifest(), why, status),
            None => why.text().to_owned(),
        }
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for DevHost<'_> {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        let screen = self.screen;
        let say = |text: &dyn std::fmt::Display| screen.say(text);
        match action {
            Action::DeliveryBegin { .. } => {
                self.shown.clear();
                self.bytes = 0;
                self.name = None;
                self.keep(Inbox::begin);
            }
            Action::Deliver { bytes, .. } => {
                let left = SHOWN.saturating_sub(self.shown.len()).min(bytes.len());
                self.shown.extend(&bytes[..left]);
                self.bytes += bytes.len() as u64;
                self.drained += bytes.len() as u32;
                self.keep(|inbox| inbox.write(bytes));
            }
            Action::DeliveryName { name, .. } => self.name = Some((*name).to_owned()),
            Action::DeliveryEnd { failure, status, .. } => {
                let dots = if self.bytes > self.shown.len() as u64 { "…" } else { "" };
                let mark = if failure.is_none() { Mark::Complete } else { Mark::Failed };
                let name = self.name.take();
                let kept = self.keep(|inbox| inbox.end(name.as_deref(), mark));
                let kept = kept.and_then(|kept| kept.path);
                let place = kept.map(|path| format!(" into {}", path.display()));
                let end = failure.map(|why| format!(", failed: {}", self.reason(why, *status)));
                say(&format_args!(
                    "received {} \"{}\"{dots}{}{}",
                    numbers::bytes(self.bytes),
                    self.shown.escape_ascii(),
                    place.unwrap_or_default(),
                    end.unwrap_or_default()
                ));
            }
            Action::JobDone { sent, .. } => say(&format_args!("sent {}", numbers::bytes(*sent))),
            Action::JobFailed { failure, status, sent, .. } => say(&format_args!(
                "the job failed after {}: {}",
                numbers::bytes(*sent),
                self.reason(*failure, *status)
            )),
            Action::CheckResult { failure: Some(why), status, line, column, .. } => {
                say(&format_args!(
                    "the check found, in line {line}, column {column}: {}",
                    self.reason(*why, *status)
                ));
            }
            Action::Note { level, text, .. } => {
                say(&format_args!("{level}: {}", text.escape_debug()));
            }
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Hold
            | Action::Release
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::CheckResult { .. }
            | Action::Request { .. }
            | Action::Withdraw { .. }
            | Action::State { .. }
            | Action::Saved { .. } => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let rest = self.data.get(self.given..).unwrap_or_default();
        let count = rest.len().min(buffer.len());
        if count == 0 {
            return Supply::End;
        }
        buffer[..count].copy_from_slice(&rest[..count]);
        self.given += count;
        Supply::Bytes(count)
    }

    fn rewind(&mut self, _job: JobId) {
        self.given = 0;
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}
