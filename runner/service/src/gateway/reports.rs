//! What the reactor tells, and what comes of it.

use softplug_live::SettingDifference;
use softplug_live::reactor::{Alarm, EndpointNews, JobEnd, JobOutcome, LaneFault, LaneId, Report};
use softplug_live::units::StoredDelivery;

use super::Control;
use super::faults::described;
use super::link::{After, Arriving, EndsAs, Lane};
use crate::jobs::{Ending, Extent, FromUnit, Job, Left, Reason, Subject, Weight};
use crate::reception_writer::Incoming;
use crate::supervise::{Failed, State};
use crate::view::{Change, CheckFault, DownView, now_ms};
use softplug_abi::{Failure, NoteLevel};
use std::fmt::Write as _;
use std::time::Instant;

impl Control {
    /// Something that a lane tells.
    pub(super) fn hear(&mut self, lane: LaneId, report: Report) {
        let Some(name) = self.lanes.get(&lane).cloned() else { return };
        match report {
            Report::Opened { path, differences } => {
                self.opened(&name, path, &texts(&differences));
            }
            Report::Up => {
                if let Some(link) = self.links.get_mut(&name) {
                    link.port.is_up = true;
                }
                self.tend_cells();
                self.begin_next(&name);
            }
            Report::HandedOver(kept) => self.shared.kept().push(kept),
            Report::Down { detail, retry_in, differences, .. } => {
                let retry_in_ms = retry_in.0.max(0) as u64 / 1_000;
                self.down(&name, &detail, texts(&differences), retry_in_ms);
            }
            Report::JobEnded(end) => self.job_ended(&name, end),
            Report::Rewind { job } => self.refill(&name, job),
            Report::DeliveryBegun { delivery, job, unit, bytes } => {
                let Some(link) = self.links.get_mut(&name) else { return };
                let gauge = bytes.figures();
                let arriving = Arriving { name: None, since_ms: now_ms(), gauge };
                link.deliveries.insert(delivery, arriving);
                if let Some(running) = &mut link.job
                    && Some(running.job.id) == job
                {
                    running.answers += 1;
                }
                let (place, port) = (link.config.receive.clone(), link.config.port.to_string());
                let link = name.clone();
                let unit =
                    unit.map(|unit| FromUnit { port, said: StoredDelivery { unit, delivery } });
                let incoming = Incoming { lane, link, place, delivery, job, unit, bytes };
                *self.to_put_away.entry(name).or_default() += 1;
                self.reception_writer.take(incoming);
            }
            Report::DeliveryNamed { delivery, name: called } => {
                self.reception_writer.name(lane, delivery, called.clone());
                let link = self.links.get_mut(&name);
                if let Some(arriving) = link.and_then(|link| link.deliveries.get_mut(&delivery)) {
                    arriving.name = Some(called);
                }
            }
            Report::DeliveryEnded { delivery, failure, status, bytes } => {
                self.reception_writer.end(lane, delivery, failure, status, bytes);
                if let Some(link) = self.links.get_mut(&name) {
                    link.deliveries.remove(&delivery);
                }
                self.tend_change(&name);
            }
            Report::Request { request, kind, fields } => self.asked(&name, request, kind, &fields),
            Report::Withdrawn { request } => self.withdrawn(&name, request),
            Report::Note { level, code, text } => self.said(&name, level, code, &text),
            Report::State(state) => {
                if let Some(link) = self.links.get_mut(&name) {
                    link.condition = Some(state);
                    link.condition_since = Instant::now();
                }
            }
            Report::Alarm(alarm) => self.alarm(&name, alarm),
            Report::Swapped(report) => self.swapped(&name, report),
            Report::Fault(fault) => self.failed(&name, *fault),
            Report::Endpoint(news) => self.endpoint_news(&name, &news),
            Report::Removed => self.lane_ended(lane, &name),
        }
    }

    fn opened(&mut self, name: &str, path: Option<std::path::PathBuf>, differences: &[String]) {
        let Some(link) = self.links.get_mut(name) else { return };
        let was_down = link.port.down.take().is_some();
        if path.is_some() {
            link.port.path = path;
        }
        let differs = link.port.differences != *differences && !differences.is_empty();
        differences.clone_into(&mut link.port.differences);
        let journal_writer = &self.shared.parts.journal_writer;
        if was_down {
            journal_writer.link(Subject::Port, Weight::Normal, name, "the port is back");
        }
        if differs {
            let text = format!("the port has other settings: {}", differences.join(", "));
            journal_writer.link(Subject::Port, Weight::Warning, name, text);
        }
    }

    fn down(&mut self, name: &str, reason: &str, differences: Vec<String>, retry_in_ms: u64) {
        let Some(link) = self.links.get_mut(name) else { return };
        let now = now_ms();
        link.port.is_up = false;
        // Trying again mends a cable, and not what somebody has to set.
        let is_new = !differences.is_empty() && link.port.differences != differences;
        link.port.differences = differences;
        let retry_at_ms = Some(now + retry_in_ms);
        let since_ms = link.port.down.as_ref().map_or(now, |down| down.since_ms);
        let was_down =
            link.port.down.replace(DownView { reason: reason.to_owned(), since_ms, retry_at_ms });
        if was_down.is_some() && !is_new {
            return;
        }
        let text = format!("the port is down: {reason}");
        self.shared.parts.journal_writer.link(Subject::Port, Weight::Warning, name, text);
    }

    fn job_ended(&mut self, name: &str, end: JobEnd) {
        let Some(link) = self.links.get_mut(name) else { return };
        let Some(running) = link.job.as_mut().filter(|running| running.job.id == end.job) else {
            return;
        };
        // It is not over before its answer is on the disk.
        if running.answers > 0 {
            running.ended = Some(end);
            return;
        }
        let Some(running) = link.job.take() else { return };
        let reason = |failure: Failure, status: u16| Reason {
            status,
            ..Reason::new(failure.name(), link.words(failure, status))
        };
        let is_answer_lost = running.is_answer_lost();
        let ending = match (end.outcome, running.ends_as) {
            (JobOutcome::Done, _) if is_answer_lost => {
                Ending::Failed(Reason::new("disk", "what came could not be put away"))
            }
            (JobOutcome::Done, _) => Ending::Done,
            (_, EndsAs::Aborted) => Ending::Aborted,
            (_, EndsAs::Interrupted(why)) => Ending::Interrupted(why.to_owned()),
            (JobOutcome::Failed { failure: Failure::LinkDown, .. }, _) => {
                Ending::Interrupted("the port was lost in the middle of it".to_owned())
            }
            (JobOutcome::Failed { failure: Failure::Interrupted, .. }, _) => {
                Ending::Interrupted(link.interrupted().to_owned())
            }
            (JobOutcome::Failed { failure, status }, _) => Ending::Failed(reason(failure, status)),
            (JobOutcome::CheckFailed { failure, status, line, column }, _) => {
                let check = Some(CheckFault { line, column });
                Ending::Failed(Reason { check, ..reason(failure, status) })
            }
            (JobOutcome::SourceFailed(text), _) => Ending::Failed(Reason::new("source", text)),
        };
        let from = running.job.spec.from;
        let taken = from + end.taken;
        let surely = running.job.extent.surely.max(from + end.bytes_surely_left);
        // A check sends nothing.
        let has_left = !matches!(ending, Ending::Failed(Reason { check: Some(_), .. }));
        let extent = if has_left {
            Extent { surely, maybe: surely.max(from + end.bytes_maybe_left) }
        } else {
            Extent { surely: from, maybe: from }
        };
        let left = Left { extent, taken, sent: end.sent };
        self.feeder.forget(end.job);
        let ended = self.shared.parts.jobs.end(end.job, ending, Some(left));
        if let Some(job) = self.wrote(ended) {
            self.show_job(&job);
        }
        self.tend_change(name);
        self.begin_next(name);
    }

    /// An answer to a job is put away, as far as it could be.
    pub(super) fn answered(&mut self, job: &Job) {
        let Some(link) = self.links.get_mut(&job.spec.link) else { return };
        let Some(running) = link.job.as_mut().filter(|running| running.job.id == job.id) else {
            return;
        };
        running.job.reception.clone_from(&job.reception);
        running.answers = running.answers.saturating_sub(1);
        if running.answers == 0
            && let Some(end) = running.ended.take()
        {
            self.job_ended(&job.spec.link.clone(), end);
        }
    }

    fn said(&mut self, name: &str, level: NoteLevel, code: u16, text: &str) {
        let Some(link) = self.links.get_mut(name) else { return };
        let text = text.escape_debug();
        let known = link.plugin.plugin.manifest().status(code);
        let words =
            known.map_or(String::new(), |known| format!(" ({}: {})", known.name, known.text));
        match level {
            NoteLevel::Error => tracing::warn!(link = name, "the plug-in: {text}{words}"),
            NoteLevel::Warning => tracing::info!(link = name, "the plug-in: {text}{words}"),
            _ => tracing::debug!(link = name, "the plug-in: {text}{words}"),
        }
    }

    fn alarm(&mut self, name: &str, alarm: Alarm) {
        let Some(link) = self.links.get_mut(name) else { return };
        link.alarms.retain(|(kind, _)| *kind != alarm.kind);
        let text = super::show::alarm_text(alarm.kind);
        if alarm.raised {
            link.alarms.push((alarm.kind, now_ms()));
            self.shared.parts.journal_writer.link(Subject::Alarm, Weight::Alarm, name, text);
        } else {
            let text = format!("it is over that {text}");
            self.shared.parts.journal_writer.link(Subject::Alarm, Weight::Normal, name, text);
        }
    }

    fn endpoint_news(&mut self, name: &str, news: &EndpointNews) {
        let Some(link) = self.links.get_mut(name) else { return };
        let (weight, text) = match news {
            EndpointNews::Connected(client) => {
                link.port.client = Some(client.to_string());
                (Weight::Normal, format!("{client} is connected to the endpoint"))
            }
            EndpointNews::Disconnected(client) => {
                link.port.client = None;
                (Weight::Normal, format!("{client} has left the endpoint"))
            }
            EndpointNews::Busy(client) => {
                (Weight::Warning, format!("{client} was sent away: the endpoint has a client"))
            }
            EndpointNews::JobFailed(outcome) => {
                let text = match outcome {
                    JobOutcome::Done => return,
                    JobOutcome::Failed { failure, status }
                    | JobOutcome::CheckFailed { failure, status, .. } => {
                        link.words(*failure, *status)
                    }
                    JobOutcome::SourceFailed(text) => text.clone(),
                };
                (Weight::Warning, format!("what the endpoint's client sent has failed: {text}"))
            }
            EndpointNews::Failed(text) => {
                link.port.endpoint_failure = Some(text.clone());
                (Weight::Alarm, format!("the endpoint does not work: {text}"))
            }
        };
        self.shared.parts.journal_writer.link(Subject::Port, weight, name, text);
        // What its client sends counts as work: a change may wait for its end.
        self.tend_change(name);
    }

    /// The plug-in has ended.
    fn failed(&mut self, name: &str, fault: LaneFault) {
        let Some(link) = self.links.get_mut(name) else { return };
        let what = if fault.on_probation { Failed::OnProbation } else { Failed::Settled };
        let mut text = format!("{} failed: {}", described(&link.plugin), fault.sentence);
        if let Some(words) = &fault.last_words {
            let _ = write!(text, "; its last words: {}", words.escape_debug());
        }
        let view = self.shared.fault_view(name, &link.plugin, fault);
        link.keep_fault(view);
        self.shared.parts.journal_writer.link(Subject::Fault, Weight::Warning, name, text);
        let is_stopped = self
            .links
            .get(name)
            .is_some_and(|link| matches!(link.supervisor.state(), State::Quarantined { .. }));
        self.break_off(
            name,
            if is_stopped {
                "the plug-in was stopped in the middle of it"
            } else {
                "the plug-in failed in the middle of it"
            },
        );
        self.supervise_fault(name, what);
    }

    /// What is under way ends: no more is heard of it.
    pub(super) fn break_off(&mut self, name: &str, why: &str) {
        let Some(link) = self.links.get_mut(name) else { return };
        let figures = link.status.read();
        let lane_progress =
            link.job.as_ref().and_then(|running| link.lane_progress(running.job.id, &figures));
        let running = link.job.take();
        link.deliveries.clear();
        link.requests.clear();
        self.reception_writer.lose(link.lane_id());
        let Some(running) = running else { return };
        let job = running.job;
        self.feeder.forget(job.id);
        // The lane may have forgotten how far it was: then all that was granted may have left.
        let lane_progress =
            lane_progress.filter(|lane_progress| lane_progress.taken > job.spec.from);
        let left = lane_progress.map(|lane_progress| Left {
            extent: lane_progress.extent,
            taken: lane_progress.taken,
            sent: 0,
        });
        let ended = self.shared.parts.jobs.end(job.id, Ending::Interrupted(why.to_owned()), left);
        if let Some(job) = self.wrote(ended) {
            self.show_job(&job);
        }
    }

    fn lane_ended(&mut self, lane: LaneId, name: &str) {
        self.lanes.remove(&lane);
        self.drivers.forget(lane);
        self.break_off(name, "the link was closed in the middle of it");
        let Some(link) = self.links.get_mut(name) else { return };
        match link.lane {
            Lane::Closing(id, After::Remake) if id == lane => self.remake(name),
            Lane::Closing(id, After::Remove) if id == lane => {
                self.links.remove(name);
                self.shared.changed(Change::LinkRemoved { name: name.to_owned() });
            }
            // It ended by itself: the reactor is taken down.
            Lane::Open(_) | Lane::Closing(..) => {}
        }
    }
}

/// What a port has otherwise than it was asked to, in words.
fn texts(differences: &[SettingDifference]) -> Vec<String> {
    differences.iter().map(ToString::to_string).collect()
}
