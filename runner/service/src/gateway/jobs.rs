//! Jobs: from the queue to the plug-in, and what people do with them meanwhile.

use softplug_abi::JobId;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use softplug_link::Job as LaneJob;
use softplug_live::reactor::{Command, Feed};
use softplug_live::reservoir::{ReservoirReader, reservoir};

use super::Control;
use super::link::{EndsAs, Link, Running};
use super::rate::Rate;
use crate::Refusal;
use crate::config::PortConfig;
use crate::feeder::{FeederNews, Feeding, Pace, Stream};
use crate::jobs::{Ending, Job, JobSpec, JobsError, Note, Reason, Subject, Weight};
use crate::reception_writer::ReceptionWriterNews;
use crate::view::{Change, JobView};

impl From<JobsError> for Refusal {
    fn from(error: JobsError) -> Self {
        let text = error.to_string();
        match error {
            JobsError::NotFound(_) => Self::NotFound(text),
            JobsError::State { .. } | JobsError::NotEnded { .. } | JobsError::QueueFull { .. } => {
                Self::Conflict(text)
            }
            JobsError::Spec(_) => Self::invalid("job", text),
            JobsError::Disk(_) | JobsError::Store(_) => Self::Unavailable(text),
        }
    }
}

impl Control {
    /// Begins what waits on every link that can take it. Most are begun at once
    /// where their turn comes; this is for what nobody told.
    pub(super) fn begin_where_possible(&mut self) {
        for name in self.shared.parts.jobs.queued().into_keys() {
            self.begin_next(&name);
        }
    }

    /// Begins the job whose turn it is on a link, if it can take one.
    pub(super) fn begin_next(&mut self, name: &str) {
        while self.stopping.is_none() && self.links.get(name).is_some_and(Link::takes_jobs) {
            let Some(job) = self.shared.parts.jobs.next(name) else { return };
            if self.keeps_waiting(name, &job) {
                return;
            }
            // Written down before it takes effect: after a crash it is known to have begun.
            let begun = match self.begin_in_cell(name, &job) {
                Some(begun) => begun,
                None => self.shared.parts.jobs.begin(job.id),
            };
            let Some(job) = self.wrote(begun) else { return };
            self.show_job(&job);
            let needs_check = self.links.get(name).is_some_and(|link| {
                link.plugin.plugin.manifest().needs.check_pass && job.spec.data.is_some()
            });
            let source = self.source(name, &job, needs_check);
            let size = Some(job.size() - job.spec.from);
            if let Err(reason) = self.give(name, &job, source, size, needs_check) {
                self.feeder.forget(job.id);
                let ended = self.shared.parts.jobs.end(job.id, Ending::Failed(reason), None);
                match self.wrote(ended) {
                    Some(job) => self.show_job(&job),
                    None => return,
                }
            }
        }
    }

    /// Gives a job to the plug-in; why it cannot be.
    fn give(
        &mut self,
        name: &str,
        job: &Job,
        source: ReservoirReader,
        size: Option<u64>,
        check: bool,
    ) -> Result<(), Reason> {
        let Some(link) = self.links.get_mut(name) else {
            return Err(Reason::new("interrupted", "the link is gone"));
        };
        let manifest = link.plugin.plugin.manifest();
        let kind = manifest.job_kind(&job.spec.job_kind).ok_or_else(|| {
            let text =
                format!("the plug-in {} has no job \"{}\"", manifest.name, job.spec.job_kind);
            Reason::new("not-supported", text)
        })?;
        let fields = job.spec.fields.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let fields = manifest.jobs[usize::from(kind)]
            .records(fields)
            .map_err(|error| Reason::new("bad-job", error.to_string()))?;
        link.gauge = Some(source.figures());
        link.job = Some(Running {
            job: job.clone(),
            ends_as: EndsAs::ItIs,
            answers: 0,
            ended: None,
            is_check: check,
            is_held_by_cell: false,
            rate: Rate::default(),
            block: None,
        });
        let lane_job = LaneJob { id: job.id, kind, size, fields, check };
        let lane = link.lane_id();
        self.drivers.tell(lane, Command::Begin(Feed { job: lane_job, source }));
        Ok(())
    }

    /// The job's data from its beginning on: all at once for a check, else paced.
    fn source(&self, name: &str, job: &Job, is_check: bool) -> ReservoirReader {
        let link = &self.links[name];
        let buffer = link.config.buffer;
        let (mut writer, reader) =
            reservoir(buffer.size as usize, buffer.low as usize, buffer.high as usize);
        let Some(data) = job.spec.data else {
            writer.finish();
            return reader;
        };
        let line = link.config.line;
        // A unit has a line of its own, and says by its credit what it has room for.
        let is_paced = line.baud > 0 && !matches!(link.config.port, PortConfig::Unit(_));
        let characters_a_second =
            is_paced.then(|| f64::from(line.baud) * 2.0 / f64::from(line.half_bits()));
        self.feeder.feed(Feeding {
            job: job.id,
            data,
            from: job.spec.from,
            gate: self.gate(name, job.id),
            to: writer,
            pace: Pace { packet: buffer.packet as usize, characters_a_second },
            is_check,
            status: Some(Arc::clone(&link.status)),
        });
        reader
    }

    /// A job whose data comes from a connection: begun at once or not at all.
    pub(super) fn feed(
        &mut self,
        name: &str,
        order: JobSpec,
        size: Option<u64>,
    ) -> Result<(u32, Stream), Refusal> {
        let waits = self.shared.parts.jobs.next(name).is_some();
        let link = self.link(name)?;
        if waits || !link.takes_jobs() {
            return Err(Refusal::Conflict(format!(
                "the link \"{name}\" cannot take a job at once: upload the program, and send it then"
            )));
        }
        let jobs = self.shared.parts.jobs.clone();
        let job = jobs.submit(order)?;
        let job = jobs.begin(job.id)?;
        let buffer = self.link(name)?.config.buffer;
        let (writer, source) =
            reservoir(buffer.size as usize, buffer.low as usize, buffer.high as usize);
        if let Err(reason) = self.give(name, &job, source, size, false) {
            let text = reason.text.clone();
            jobs.end(job.id, Ending::Failed(reason), None)?;
            return Err(Refusal::invalid("job", text));
        }
        self.show_job(&job);
        Ok((job.id.0, Stream::new(jobs, job.id, writer)))
    }

    /// The check was good: the data once more.
    pub(super) fn refill(&mut self, name: &str, id: JobId) {
        let Some(running) = self.links.get(name).and_then(|link| link.job.as_ref()) else { return };
        if running.job.id != id {
            return;
        }
        let job = running.job.clone();
        let source = self.source(name, &job, false);
        let Some(link) = self.links.get_mut(name) else { return };
        link.gauge = Some(source.figures());
        if let Some(running) = &mut link.job {
            running.is_check = false;
        }
        let lane = link.lane_id();
        self.drivers.tell(lane, Command::Refill { job: id, source });
    }

    /// What the feeder tells: the disk, or what is written on it.
    pub(super) fn feeder_news(&mut self, news: FeederNews) {
        match news {
            FeederNews::AtGate { job, gate } => self.at_gate(job, gate),
            FeederNews::Stalled(why) => {
                let text = format!("no job is fed further: {why}");
                tracing::error!("{text}");
                self.trouble = Some(text);
            }
            FeederNews::GoesOn => {
                tracing::info!("jobs are fed again");
                self.trouble = None;
            }
        }
    }

    /// What the writer of receptions tells.
    pub(super) fn reception_writer_news(&mut self, news: ReceptionWriterNews) {
        match news {
            ReceptionWriterNews::Begun(job) => self.show_job(&job),
            ReceptionWriterNews::Kept(job) => {
                self.shared.changed(Change::Receptions { link: job.spec.link.clone() });
                self.show_job(&job);
                self.answered(&job);
            }
            ReceptionWriterNews::Stuck { link, why } => {
                let text = format!("what \"{link}\" receives cannot be put away: {why}");
                if let Some(note) = self.stuck_note(&link, &text) {
                    let journal_writer = &self.shared.parts.journal_writer;
                    journal_writer.link(Subject::Reception, Weight::Alarm, &link, note);
                }
                self.trouble = Some(text);
            }
            ReceptionWriterNews::GoesOn { link } => {
                let note = "what it receives is put away again";
                self.shared.parts.journal_writer.link(
                    Subject::Reception,
                    Weight::Normal,
                    &link,
                    note,
                );
                self.trouble = None;
            }
            ReceptionWriterNews::Lost { link, job, bytes, why } => {
                self.shared.lost.fetch_add(bytes, Ordering::Relaxed);
                let text = format!("{bytes} bytes that \"{link}\" received are lost: {why}");
                let mut note = Note::new(Subject::Reception, text).of_link(link);
                if let Some(job) = job {
                    note = note.of_job(job);
                }
                self.shared.parts.journal_writer.note(note.weighing(Weight::Alarm));
            }
            ReceptionWriterNews::Over { link } => self.put_away(&link),
        }
    }

    /// The writer of receptions has no more to do with a delivery.
    fn put_away(&mut self, link: &str) {
        let Some(count) = self.to_put_away.get_mut(link) else { return };
        *count -= 1;
        if *count == 0 {
            self.to_put_away.remove(link);
        }
    }

    /// Somebody wants a job to pause, to go on or to end.
    pub(super) fn steer(&mut self, id: JobId, command: JobCommand) -> Result<JobView, Refusal> {
        let jobs = &self.shared.parts.jobs;
        let job = match command {
            JobCommand::Pause => jobs.pause(id)?,
            JobCommand::Resume => jobs.resume(id)?,
            JobCommand::Abort => jobs.abort(id)?,
            JobCommand::Prioritise(priority) => jobs.prioritise(id, priority)?,
        };
        let name = job.spec.link.clone();
        if let Some(link) = self.links.get_mut(&name)
            && let Some(running) = link.job.as_mut().filter(|running| running.job.id == id)
        {
            running.job = job.clone();
            let command = match command {
                JobCommand::Pause => Some(Command::Pause(id)),
                // Its cell lets it go on when that is free to do so.
                JobCommand::Resume if running.is_held_by_cell => None,
                JobCommand::Resume => Some(Command::Resume(id)),
                JobCommand::Abort => {
                    running.ends_as = EndsAs::Aborted;
                    Some(Command::Abort(id))
                }
                JobCommand::Prioritise(_) => None,
            };
            let lane = link.lane_id();
            if let Some(command) = command {
                self.drivers.tell(lane, command);
            }
        }
        self.steered_in_cell(&job);
        self.show_job(&job);
        self.begin_next(&name);
        Ok(self.job_view(&job))
    }

    /// A job as it is now, with what its lane knows of it.
    pub(super) fn job_view(&self, job: &Job) -> JobView {
        let link = self.links.get(&job.spec.link);
        let lane_progress = link.and_then(|link| link.lane_progress(job.id, &link.status.read()));
        job.view(lane_progress.as_ref())
    }
}

/// What somebody wants of a job.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum JobCommand {
    Pause,
    Resume,
    Abort,
    Prioritise(i32),
}
