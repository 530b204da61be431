//! An orderly end: jobs are finished or parked, ports closed, what came put away, all of it
//! written down.

use std::collections::BTreeSet;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use softplug_live::reactor::Command;

use super::link::{After, EndsAs, Lane};
use super::{Control, Stopping};
use crate::Refusal;
use crate::jobs::{Note, Subject};
use crate::view::{Change, StopHow};

/// How long closing lanes may take after their jobs have ended.
const CLOSING: Duration = Duration::from_secs(3);
const PARKED: &str = "the gateway was stopped; it can be restarted at a block";

impl Control {
    /// Begins to stop; said again, it waits neither for jobs nor for room for what was received.
    pub(super) fn stop(&mut self, how: StopHow) {
        let now = Instant::now();
        let until = match how {
            StopHow::Park => Some(now + self.config.gateway.stop_patience),
            StopHow::Finish => None,
        };
        match &mut self.stopping {
            None => {
                self.stopping = Some(Stopping::new(how, until));
                self.begin_stop(match how {
                    StopHow::Park => "the gateway stops; jobs are parked",
                    StopHow::Finish => "the gateway stops when the jobs that run have ended",
                });
            }
            // It was no stop until now, and what it waits for is said anew.
            Some(stopping) if stopping.hands_over => {
                stopping.hands_over = false;
                stopping.told.clear();
                if stopping.is_clearing {
                    self.reception_writer.finish();
                }
            }
            Some(stopping)
                if stopping.is_clearing
                    || (stopping.how, how) == (StopHow::Park, StopHow::Park) =>
            {
                (stopping.gives_up, stopping.until) = (true, Some(now));
                if stopping.is_clearing {
                    self.reception_writer.give_up();
                }
            }
            Some(stopping) if how == StopHow::Park => {
                (stopping.how, stopping.until) = (how, until);
            }
            Some(_) => {}
        }
        if how == StopHow::Park {
            self.park();
        }
        self.tend_stop();
    }

    /// Stops for a new gateway, unless that would break something off or lose what came.
    pub(super) fn make_way(&mut self) -> Result<(), Refusal> {
        let links =
            self.links.iter().filter(|(_, link)| link.is_busy() || link.port.client.is_some());
        let busy: Vec<&str> = links.map(|(name, _)| name.as_str()).collect();
        let waits = self.to_put_away.keys().map(String::as_str);
        let waits: Vec<&str> = waits.filter(|name| !busy.contains(name)).collect();
        let mut why = Vec::new();
        if !busy.is_empty() {
            let are = if busy.len() == 1 { "is" } else { "are" };
            why.push(format!("{} {are} busy; try again when that has ended", busy.join(", ")));
        }
        if !waits.is_empty() {
            let links = waits.join(", ");
            why.push(format!(
                "what {links} received is not put away yet; make room, and try again"
            ));
        }
        if !why.is_empty() {
            let why = why.join("; ");
            return Err(Refusal::Conflict(format!("the gateway cannot be replaced now: {why}")));
        }
        let stopping = Stopping::new(StopHow::Park, Some(Instant::now()));
        self.stopping = Some(Stopping { hands_over: true, ..stopping });
        self.begin_stop("the gateway makes way for another");
        self.tend_stop();
        Ok(())
    }

    /// Says that it stops; nothing new is taken from now on.
    fn begin_stop(&self, text: &str) {
        self.shared.is_stopping.store(true, Ordering::Relaxed);
        self.shared.changed(Change::Stopping);
        self.shared.parts.journal_writer.note(Note::new(Subject::Gateway, text));
    }

    /// Ends the jobs that run, in the way that the protocol has for that.
    fn park(&mut self) {
        for link in self.links.values_mut() {
            let Some(running) = &mut link.job else { continue };
            if running.ends_as == EndsAs::ItIs {
                running.ends_as = EndsAs::Interrupted(PARKED);
                let (lane, job) = (link.lane.id(), running.job.id);
                self.drivers.tell(lane, Command::Abort(job));
            }
        }
    }

    pub(super) fn tend_stop(&mut self) {
        let Some(stopping) = &self.stopping else { return };
        if stopping.closing.is_some() {
            return;
        }
        let now = Instant::now();
        let is_over = stopping.until.is_some_and(|until| now >= until);
        let is_busy = self.links.values().any(|link| link.job.is_some());
        if is_busy && !is_over {
            return;
        }
        if let Some(stopping) = &mut self.stopping {
            stopping.closing = Some(now + CLOSING);
        }
        let names: Vec<String> = self.links.keys().cloned().collect();
        for name in names {
            if self.links.get(&name).is_some_and(|link| matches!(link.lane, Lane::Open(_))) {
                self.close(&name, After::Remove);
            }
        }
    }

    /// Whether all lanes are closed, or no longer waited for, and what came on them is put away.
    pub(super) fn has_stopped(&mut self) -> bool {
        let Some(stopping) = &self.stopping else { return false };
        let Some(until) = stopping.closing else { return false };
        if !stopping.is_clearing {
            if !self.links.is_empty() && Instant::now() < until {
                return false;
            }
            self.clear_links();
        }
        // Who has ended puts nothing away any more.
        self.to_put_away.is_empty() || self.reception_writer.has_ended()
    }

    /// Nothing more comes: what is left over is broken off, and what came is put away.
    fn clear_links(&mut self) {
        let left: Vec<String> = self.links.keys().cloned().collect();
        for name in left {
            self.break_off(&name, PARKED);
        }
        self.lanes.clear();
        self.reception_writer.finish();
        if let Some(stopping) = &mut self.stopping {
            stopping.is_clearing = true;
            if stopping.gives_up {
                self.reception_writer.give_up();
            }
        }
    }

    /// What is said of a link whose receptions cannot be put away; a stop says it once.
    pub(super) fn stuck_note(&mut self, link: &str, text: &str) -> Option<String> {
        match &mut self.stopping {
            Some(stopping) if stopping.is_clearing => {
                stopping.told.insert(link.to_owned()).then(|| {
                    format!(
                        "{text}; the gateway ends when it is: make room, or stop the gateway once \
                         more to give it up"
                    )
                })
            }
            _ => Some(format!("{text}; the machine is held")),
        }
    }

    /// What has ended is written down.
    pub(super) fn end(mut self) {
        if self.stopping.as_ref().is_none_or(|stopping| !stopping.is_clearing) {
            self.clear_links();
        }
        self.drops.end();
        self.shared.parts.loader.stop();
        self.shared
            .parts
            .journal_writer
            .note(Note::new(Subject::Gateway, "the gateway has stopped"));
    }
}

impl Stopping {
    fn new(how: StopHow, until: Option<Instant>) -> Self {
        Self {
            how,
            until,
            closing: None,
            is_clearing: false,
            gives_up: false,
            told: BTreeSet::new(),
            hands_over: false,
        }
    }
}
