//! A lane's jobs: begun, fed from a reservoir or from the endpoint, ended.

use softplug_abi::{Failure, JobId, Micros, ModemLines};
use softplug_link::{HoldState, Job};

use super::{Lane, Phase};
use crate::channel::Place;
use crate::reactor::ENDPOINT_JOBS;
use crate::reactor::LaneInstance;
use crate::reactor::endpoint::{EndpointNews, EndpointRequest};
use crate::reactor::host::Ended;
use crate::reactor::job_end::{JobEnd, JobOutcome};
use crate::reactor::report::Report;
use crate::reactor::setup::Feed;
use crate::reactor::thread::Thread;
use crate::recorder::Recorded;

impl<I: LaneInstance> Lane<I> {
    pub(super) fn begin(&mut self, thread: &Thread<I>, feed: Feed) {
        let job = feed.job.id;
        let Some(from) = self.place_if_up() else { return self.refuse(job, Failure::LinkDown) };
        if self.host.job.is_some() || self.closing_until.is_some() {
            return self.refuse(job, Failure::Busy);
        }
        let job = self.host.begin(feed, from);
        self.ask(thread, |link, now, host| link.begin_job(now, job, host));
    }

    /// What the port was given so far, on a link that can take a job.
    fn place_if_up(&self) -> Option<Place> {
        match &self.phase {
            Phase::Open(channel) if !self.is_faulted && channel.gone().is_none() => {
                Some(channel.place())
            }
            _ => None,
        }
    }

    fn refuse(&mut self, job: JobId, failure: Failure) {
        let outcome = JobOutcome::Failed { failure, status: 0 };
        let end = JobEnd::unbegun(job, outcome, 0);
        self.host.tell(Report::JobEnded(end));
    }

    /// What the endpoint has to say, and data that came in there, which becomes a
    /// job.
    pub(super) fn turn_endpoint(&mut self, thread: &Thread<I>) {
        let Some(lane) = &mut self.host.endpoint else { return };
        lane.endpoint.turn(&thread.registry, self.clock.now());
        while let Some(news) = self.host.endpoint_news() {
            self.host.tell(Report::Endpoint(news));
        }
        while let Some(request) = self.host.next_endpoint_request() {
            self.grant(thread, request);
        }
        if !self.endpoint_waits() {
            return;
        }
        let Some(from) = self.place_if_up() else { return };
        let Some(lane) = &self.host.endpoint else { return };
        let job = Job {
            id: self.next_endpoint_job,
            kind: lane.job_kind,
            size: None,
            fields: lane.fields.clone(),
            check: lane.check,
        };
        self.next_endpoint_job = self.next_endpoint_job.next().max(ENDPOINT_JOBS);
        self.host.begin_endpoint(job.id, from);
        self.ask(thread, |link, now, host| link.begin_job(now, job, host));
    }

    /// Whether data at the endpoint could begin a job.
    pub(super) fn endpoint_waits(&self) -> bool {
        let waits = self.host.endpoint.as_ref().is_some_and(|lane| lane.endpoint.wants_job());
        let is_up = matches!(&self.phase, Phase::Open(channel) if channel.gone().is_none());
        waits
            && is_up
            && !self.is_faulted
            && self.closing_until.is_none()
            && self.host.job.is_none()
    }

    fn grant(&mut self, thread: &Thread<I>, request: EndpointRequest) {
        match request {
            EndpointRequest::ModemLines(mask, on) => self.set_modem_lines(thread, mask, on),
            EndpointRequest::Break(on) => self.set_break(thread, on),
            EndpointRequest::Purge => {
                if let Some(job) =
                    self.host.job.as_ref().map(|active| active.id).filter(|id| *id >= ENDPOINT_JOBS)
                {
                    self.ask(thread, |link, now, host| link.abort(now, job, host));
                }
            }
        }
    }

    fn set_modem_lines(&mut self, thread: &Thread<I>, mask: ModemLines, on: ModemLines) {
        let Phase::Open(channel) = &mut self.phase else { return };
        if let Err(error) = channel.set_modem_lines(Some((mask, on))) {
            self.port_failed(thread, &error);
        }
    }

    fn set_break(&mut self, thread: &Thread<I>, on: bool) {
        let Phase::Open(channel) = &mut self.phase else { return };
        if let Err(error) = channel.set_break(on) {
            self.port_failed(thread, &error);
        }
    }

    /// The job under way is paused by the host, or no longer.
    pub(super) fn count_pause(&mut self, job: JobId, is_paused: bool) {
        let is_it = self.host.job.as_ref().is_some_and(|active| active.id == job);
        if let Phase::Open(channel) = &mut self.phase
            && is_it
        {
            channel.count_pause(self.clock.now(), is_paused);
        }
    }

    /// A job whose source failed is aborted: it must not pass for whole.
    pub(super) fn abort_without_source(&mut self, thread: &Thread<I>) {
        let Some(active) = &mut self.host.job else { return };
        if active.source_failed.is_some() && !active.is_aborted {
            active.is_aborted = true;
            let job = active.id;
            self.ask(thread, |link, now, host| link.abort(now, job, host));
        }
    }

    /// Tells of a job that has ended.
    pub(super) fn conclude(&mut self, now: Micros) {
        let Some(Ended { active, outcome, sent }) = self.host.ended.take() else { return };
        let Phase::Open(channel) = &mut self.phase else { return };
        channel.count_pause(now, false);
        let left = channel.left(now, active.from);
        let outcome = match active.source_failed {
            Some(why) if outcome != JobOutcome::Done => JobOutcome::SourceFailed(why),
            _ => outcome,
        };
        // A plug-in counts what the port was given, and cannot know that it stopped there.
        let sent = if outcome == JobOutcome::Done { sent } else { sent.min(left.surely) };
        if active.id < ENDPOINT_JOBS {
            let is_done = outcome == JobOutcome::Done;
            let maybe = if is_done { active.taken } else { channel.job_may_have_left(now) };
            self.host.tell(Report::JobEnded(JobEnd {
                job: active.id,
                outcome,
                taken: active.taken,
                sent,
                maybe_left: left.maybe,
                surely_left: left.surely,
                bytes_maybe_left: maybe,
                bytes_surely_left: self.status.bytes_surely_left(active.id),
            }));
            return;
        }
        if let Some(lane) = &mut self.host.endpoint {
            lane.endpoint.job_ended(&outcome);
        }
        self.host.own.endpoint_jobs += 1;
        self.host.own.endpoint_bytes += active.taken;
        if outcome != JobOutcome::Done {
            self.host.own.endpoint_failed += 1;
            self.host.tell(Report::Endpoint(EndpointNews::JobFailed(outcome)));
        }
    }

    /// Whether the job waits for data that does not come, so that the line will
    /// stand idle.
    pub(super) fn is_about_to_starve(&self) -> bool {
        let is_hungry = self.host.job.as_ref().is_some_and(|active| {
            active.is_hungry
                && active.taken > 0
                && active.id < ENDPOINT_JOBS
                && !active.is_source_stopped()
        });
        let is_free = |channel: &crate::channel::Channel<Recorded<I>>| {
            channel.gone().is_none() && channel.link().hold() == HoldState::Free
        };
        is_hungry
            && !self.is_faulted
            && self.starved_since.is_none()
            && matches!(&self.phase, Phase::Open(channel) if is_free(channel))
    }

    /// Whether the source has stopped on purpose, and it is not shown yet that all before that has left.
    pub(super) fn is_stopped_and_not_drained(&self) -> bool {
        self.host.job.as_ref().is_some_and(|active| {
            active.is_hungry
                && active.is_source_stopped()
                && self.status.drained(active.id) != Some(active.taken)
        })
    }

    /// Counts the time for which a job waits for data while the line stands idle.
    pub(super) fn count_starved(&mut self, now: Micros) {
        let was_since = self.starved_since.take();
        let idle = |channel: &crate::channel::Channel<Recorded<I>>| !channel.is_sending(now);
        let is_starved = self.is_about_to_starve()
            && matches!(&self.phase, Phase::Open(channel) if idle(channel));
        match (was_since, is_starved) {
            (None, true) => {
                self.host.own.starvations += 1;
                self.starved_since = Some(now);
            }
            (Some(since), true) => self.starved_since = Some(since),
            (Some(since), false) => {
                self.host.own.starved = self.host.own.starved + (now - since);
            }
            (None, false) => {}
        }
    }
}
