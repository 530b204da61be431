//! Plug-ins that fail: started again after a while, then left alone.

use softplug_live::reactor::Command;

use super::Control;
use super::loading::Prepared;
use crate::Refusal;
use crate::jobs::{Subject, Weight};
use crate::supervise::{Failed, State, Verdict};
use crate::view::{SwapState, now_ms};
use std::time::{Duration, Instant};

impl Control {
    /// The plug-in of a link has failed, or could not be started.
    pub(super) fn supervise_fault(&mut self, name: &str, what: Failed) {
        let now = self.time();
        let Some(link) = self.links.get_mut(name) else { return };
        if matches!(link.supervisor.state(), State::Quarantined { .. }) {
            // Somebody stopped it, which was said.
            return;
        }
        match link.supervisor.failed(now, what) {
            Verdict::RestartAt(_) => {}
            Verdict::RestartFormer => {
                let former = link.swap.as_mut().and_then(|swap| {
                    swap.view.state = SwapState::Reverted;
                    swap.view.at_ms = now_ms();
                    swap.former.take()
                });
                if let Some(former) = former {
                    let failed = link.plugin.digest();
                    link.follow.rejected(failed, former.digest());
                    link.plugin = former;
                }
                self.start_plugin(name);
            }
            Verdict::Quarantine => {
                let text = "the plug-in has failed too often; the link is in quarantine until somebody \
                            releases it";
                self.shared.parts.journal_writer.link(Subject::Fault, Weight::Alarm, name, text);
            }
        }
    }

    /// When the next plug-in is to be started again.
    pub(super) fn next_start(&self) -> Option<Instant> {
        let next = self.links.values().filter_map(|link| link.supervisor.next()).min()?;
        Some(self.began + next)
    }

    /// Starts the plug-ins whose time has come.
    pub(super) fn start_again(&mut self) {
        let now = self.time();
        let is_due = |next: Option<Duration>| next.is_some_and(|at| at <= now);
        let due: Vec<String> = self
            .links
            .iter()
            .filter(|(_, link)| is_due(link.supervisor.next()))
            .map(|(name, _)| name.clone())
            .collect();
        for name in due {
            if self.links.get_mut(&name).is_some_and(|link| link.supervisor.takes_start(now)) {
                self.start_plugin(&name);
            }
        }
    }

    /// Gives a link a new instance of its plug-in.
    pub(super) fn start_plugin(&mut self, name: &str) {
        let Some(link) = self.links.get_mut(name) else { return };
        let lane = link.lane_id();
        let text = format!("{} is started again", described(&link.plugin));
        if link.is_of_unit() {
            self.drivers.replace_in_unit(lane, link.plugin.for_unit());
            self.shared.parts.journal_writer.link(Subject::Fault, Weight::Normal, name, text);
            return;
        }
        match link.plugin.instance() {
            Ok(instance) => {
                let settings = link.plugin.values.clone();
                self.drivers.tell(lane, Command::Replace { instance, settings });
                self.shared.parts.journal_writer.link(Subject::Fault, Weight::Normal, name, text);
            }
            Err(error) => {
                let text = format!("{} cannot be started: {error}", described(&link.plugin));
                self.shared.parts.journal_writer.link(Subject::Fault, Weight::Warning, name, text);
                self.supervise_fault(name, Failed::Start);
            }
        }
    }

    /// Somebody stops the plug-in of a link at once, whatever it is doing.
    pub(super) fn quarantine(&mut self, name: &str) -> Result<(), Refusal> {
        let now = self.time();
        let link = self.link(name)?;
        if !link.supervisor.quarantine(now) {
            return Err(Refusal::Conflict(format!("the link \"{name}\" is in quarantine already")));
        }
        let lane = link.lane_id();
        let text = format!(
            "{} is stopped by hand; the link is in quarantine until somebody releases it",
            described(&link.plugin)
        );
        self.shared.parts.journal_writer.link(Subject::Fault, Weight::Alarm, name, text);
        // What is under way is broken off when the lane tells that it has stopped: until then
        // bytes leave, and are counted.
        self.drivers.tell(lane, Command::Halt("it was stopped by hand".to_owned()));
        Ok(())
    }

    /// Somebody lets a link out of quarantine.
    pub(super) fn release(&mut self, name: &str) -> Result<(), Refusal> {
        let link = self.link(name)?;
        if !link.supervisor.release() {
            return Err(Refusal::Conflict(format!("the link \"{name}\" is not in quarantine")));
        }
        let text = "the link is released from quarantine";
        self.shared.parts.journal_writer.link(Subject::Fault, Weight::Normal, name, text);
        self.start_plugin(name);
        Ok(())
    }
}

/// A plug-in in the journal.
pub(super) fn described(plugin: &Prepared) -> String {
    let which = &plugin.which;
    let digest = which.digest.get(..12).unwrap_or(&which.digest);
    format!("{} {} ({digest})", which.name, which.version)
}
