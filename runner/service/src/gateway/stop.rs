//! An orderly end: jobs are finished or parked, ports closed, all of it written
//! down.

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
    /// Begins to stop; said again, it no longer waits for jobs.
    pub(super) fn stop(&mut self, how: StopHow) {
        let is_first = self.stopping.is_none();
        let until = match how {
            StopHow::Park => Some(Instant::now() + self.config.gateway.stop_patience),
            StopHow::Finish => None,
        };
        let stopping =
            self.stopping.get_or_insert(Stopping { how, until, closing: None, hands_over: false });
        if !is_first && stopping.how == StopHow::Finish && how == StopHow::Park {
            (stopping.how, stopping.until) = (how, until);
        }
        if is_first {
            self.begin_stop(match how {
                StopHow::Park => "the gateway stops; jobs are parked",
                StopHow::Finish => "the gateway stops when the jobs that run have ended",
            });
        }
        if how == StopHow::Park {
            self.park();
        }
        self.tend_stop();
    }

    /// Stops for a new gateway, unless that would break something off.
    pub(super) fn make_way(&mut self) -> Result<(), Refusal> {
        let links =
            self.links.iter().filter(|(_, link)| link.is_busy() || link.port.client.is_some());
        let busy: Vec<&str> = links.map(|(name, _)| name.as_str()).collect();
        if !busy.is_empty() {
            return Err(Refusal::Conflict(format!(
                "the gateway cannot be replaced now: {} {} busy; try again when that has ended",
                busy.join(", "),
                if busy.len() == 1 { "is" } else { "are" }
            )));
        }
        self.stopping = Some(Stopping {
            how: StopHow::Park,
            until: Some(Instant::now()),
            closing: None,
            hands_over: true,
        });
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

    /// Whether all lanes are closed, or no longer waited for.
    pub(super) fn has_stopped(&self) -> bool {
        let closing = self.stopping.as_ref().and_then(|stopping| stopping.closing);
        closing.is_some_and(|until| self.links.is_empty() || Instant::now() >= until)
    }

    /// What is left over at the end is written down.
    pub(super) fn end(mut self) {
        let left: Vec<String> = self.links.keys().cloned().collect();
        for name in left {
            self.break_off(&name, PARKED);
        }
        self.drops.end();
        self.shared.parts.loader.stop();
        self.shared
            .parts
            .journal_writer
            .note(Note::new(Subject::Gateway, "the gateway has stopped"));
    }
}
