//! A link's job: one at a time, fed by credit, kept until its end has been noted.

use softplug_abi::{Failure, JobId, Micros};
use softplug_link::Job;
use softplug_live::reactor::{Command, Feed, JobEnd, JobOutcome, LaneFigures, LaneId};
use softplug_live::reservoir::{ReservoirWriter, reservoir};
use softplug_unit_protocol::{CREDIT_PARTS, CreditError, Fed, Outcome, ToServer, ToUnit};
use thiserror::Error;

use super::{Surroundings, short};

/// How often the server is told how far a job is.
const PROGRESS: Micros = Micros::from_millis(250);

/// Data that a job does not take.
#[derive(Debug, Error)]
enum BadData {
    #[error(transparent)]
    Position(#[from] CreditError),
    #[error("its data has ended")]
    Ended,
    #[error("no room")]
    NoRoom,
}

pub(super) struct Jobs {
    link: u8,
    buffer: usize,
    active: Option<Active>,
    /// Numbers of the lane.
    next: u32,
}

struct Active {
    /// The server's number.
    job: u64,
    /// The lane's.
    of_lane: JobId,
    pass: u8,
    fed: Fed,
    /// None once all has come, or the job has ended.
    writer: Option<ReservoirWriter>,
    /// Data no longer fits together: it is being aborted.
    is_broken: bool,
    end: Option<JobEnd>,
    /// In this session.
    is_end_told: bool,
    told_at: Option<Micros>,
    told: (bool, bool),
}

impl Jobs {
    pub(super) fn new(link: u8, buffer: usize) -> Self {
        Self { link, buffer, active: None, next: 1 }
    }

    pub(super) fn is_under_way(&self) -> bool {
        self.active.as_ref().is_some_and(|active| active.end.is_none())
    }

    /// The server's number of the lane's job.
    pub(super) fn number_of(&self, of_lane: JobId) -> Option<u64> {
        self.active.as_ref().filter(|active| active.of_lane == of_lane).map(|active| active.job)
    }

    /// Job, pass, what has come, and whether that is all.
    pub(super) fn received(&self) -> (u64, u8, u64, bool) {
        self.active.as_ref().map_or((0, 0, 0, false), |active| {
            (active.job, active.pass, active.fed.received(), active.fed.is_whole())
        })
    }

    pub(super) fn hear(
        &mut self,
        message: &ToUnit<'_>,
        ready: Option<(LaneId, usize)>,
        around: &mut Surroundings<'_>,
    ) {
        match *message {
            ToUnit::Begin { job, kind, size, check, fields, .. } => {
                let size = (size != u64::MAX).then_some(size);
                let fields = fields.to_vec();
                self.begin(
                    job,
                    Job { id: JobId(self.next), kind, size, fields, check },
                    ready,
                    around,
                );
            }
            ToUnit::Data { job, pass, at, bytes, .. } => {
                let lane = ready.map(|(lane, _)| lane);
                self.fed(message.kind(), job, pass, lane, around, |active| {
                    active.fed.data(at, bytes.len() as u64)?;
                    let writer = active.writer.as_mut().ok_or(BadData::Ended)?;
                    // There is room for what credit was given for.
                    if writer.write(bytes) == bytes.len() { Ok(()) } else { Err(BadData::NoRoom) }
                });
            }
            ToUnit::End { job, pass, size, .. } => {
                let lane = ready.map(|(lane, _)| lane);
                self.fed(message.kind(), job, pass, lane, around, |active| {
                    active.fed.end(size)?;
                    if let Some(writer) = &mut active.writer {
                        writer.finish();
                    }
                    Ok(())
                });
            }
            ToUnit::Fail { job, why, .. } => {
                if let Some(active) = self.under_way(job)
                    && let Some(mut writer) = active.writer.take()
                {
                    writer.fail(why);
                }
            }
            ToUnit::Pause { job, .. } => self.command(job, ready, around, Command::Pause),
            ToUnit::Resume { job, .. } => self.command(job, ready, around, Command::Resume),
            ToUnit::Abort { job, .. } => self.command(job, ready, around, Command::Abort),
            ToUnit::Noted { job, .. } => {
                let is_over = |active: &Active| active.job == job && active.end.is_some();
                if self.active.as_ref().is_some_and(is_over) {
                    self.active = None;
                }
            }
            _ => {}
        }
    }

    fn begin(
        &mut self,
        job: u64,
        of_lane: Job,
        ready: Option<(LaneId, usize)>,
        around: &mut Surroundings<'_>,
    ) {
        if self.active.as_ref().is_some_and(|active| active.job == job) {
            self.tell_all(around);
            return;
        }
        let refused = match (&self.active, ready) {
            _ if job == 0 => Some("a job's number is never 0"),
            (Some(_), _) => Some("another job is there"),
            (None, None) => Some("no plug-in runs"),
            (None, Some((_, kinds))) if usize::from(of_lane.kind) >= kinds => {
                Some("the plug-in has no job of this kind")
            }
            (None, Some(_)) => None,
        };
        let Some((lane, _)) = ready.filter(|_| refused.is_none()) else {
            let why = refused.unwrap_or("no plug-in runs");
            around.say(&ToServer::Refused { message: ToUnit::BEGIN, link: self.link, job, why });
            return;
        };
        let id = of_lane.id;
        self.next += 1;
        let (writer, source) = self.reservoir(around);
        around.reactor.tell(lane, Command::Begin(Feed { job: of_lane, source }));
        self.active = Some(Active {
            job,
            of_lane: id,
            pass: 0,
            fed: Fed::default(),
            writer: Some(writer),
            is_broken: false,
            end: None,
            is_end_told: false,
            told_at: None,
            told: (false, false),
        });
        self.give(true, around);
    }

    fn reservoir(
        &self,
        around: &Surroundings<'_>,
    ) -> (ReservoirWriter, softplug_live::reservoir::ReservoirReader) {
        let (writer, source) = reservoir(self.buffer, self.buffer / 4, self.buffer);
        writer.wake_with(around.waker.clone());
        (writer, source)
    }

    fn under_way(&mut self, job: u64) -> Option<&mut Active> {
        self.active.as_mut().filter(|active| active.job == job && active.end.is_none())
    }

    /// Data, or its end. What comes for a job that has ended, or for a pass that is over, was under
    /// way then.
    fn fed(
        &mut self,
        message: u8,
        job: u64,
        pass: u8,
        lane: Option<LaneId>,
        around: &mut Surroundings<'_>,
        take: impl FnOnce(&mut Active) -> Result<(), BadData>,
    ) {
        let link = self.link;
        let Some(active) = self.under_way(job) else { return };
        if active.pass != pass || active.is_broken {
            return;
        }
        if let Err(error) = take(active) {
            active.is_broken = true;
            let of_lane = active.of_lane;
            let why = error.to_string();
            around.say(&ToServer::Refused { message, link, job, why: short(&why) });
            if let Some(lane) = lane {
                around.reactor.tell(lane, Command::Abort(of_lane));
            }
        }
    }

    fn command(
        &mut self,
        job: u64,
        ready: Option<(LaneId, usize)>,
        around: &mut Surroundings<'_>,
        command: fn(JobId) -> Command<softplug_host::Session>,
    ) {
        if let Some(active) = self.under_way(job)
            && let Some((lane, _)) = ready
        {
            around.reactor.tell(lane, command(active.of_lane));
        }
    }

    /// The check was good: the data comes once more.
    pub(super) fn rewind(
        &mut self,
        of_lane: JobId,
        lane: Option<LaneId>,
        around: &mut Surroundings<'_>,
    ) {
        let (writer, source) = self.reservoir(around);
        let link = self.link;
        let Some(active) = self.active.as_mut().filter(|active| active.of_lane == of_lane) else {
            return;
        };
        (active.pass, active.fed, active.writer) = (1, Fed::default(), Some(writer));
        around.say(&ToServer::Rewind { link, job: active.job });
        if let Some(lane) = lane {
            around.reactor.tell(lane, Command::Refill { job: of_lane, source });
        }
        self.give(true, around);
    }

    /// It is told when its answers have been stored.
    pub(super) fn ended(&mut self, end: JobEnd) {
        if let Some(active) = self.active.as_mut().filter(|active| active.of_lane == end.job) {
            active.end = Some(end);
            active.writer = None;
        }
    }

    /// The server's number of the job that is there, under way or ended.
    pub(super) fn number(&self) -> Option<u64> {
        self.active.as_ref().map(|active| active.job)
    }

    /// The plug-in has ended, or its lane: a job under way ends with it. What had left, its lane
    /// says, as far as it was shown.
    pub(super) fn break_off(
        &mut self,
        figures: Option<LaneFigures>,
        around: &mut Surroundings<'_>,
    ) {
        let Some(active) = self.active.as_mut().filter(|active| active.end.is_none()) else {
            return;
        };
        let outcome = JobOutcome::Failed { failure: Failure::Interrupted, status: 0 };
        // What the lane drew may have left, however little of it was shown.
        let drawn = active.writer.as_ref().map_or(active.fed.received(), ReservoirWriter::consumed);
        let shown = figures.filter(|figures| figures.job == active.of_lane.0);
        active.end = Some(match shown {
            Some(figures) => JobEnd {
                job: active.of_lane,
                outcome,
                taken: figures.job_taken,
                sent: figures.job_bytes_surely_left,
                maybe_left: figures.job_maybe_left.max(drawn),
                surely_left: figures.job_surely_left,
                bytes_maybe_left: drawn,
                bytes_surely_left: figures.job_bytes_surely_left,
            },
            None => JobEnd {
                job: active.of_lane,
                outcome,
                taken: drawn,
                sent: 0,
                maybe_left: drawn,
                surely_left: 0,
                bytes_maybe_left: drawn,
                bytes_surely_left: 0,
            },
        });
        active.writer = None;
        self.tell_end(around);
    }

    /// In a new session.
    pub(super) fn tell_all(&mut self, around: &mut Surroundings<'_>) {
        self.give(true, around);
        if let Some(active) = &mut self.active {
            (active.told_at, active.is_end_told) = (None, false);
        }
    }

    /// Once in a session.
    pub(super) fn tell_end(&mut self, around: &mut Surroundings<'_>) {
        let Some(active) = self.active.as_mut().filter(|active| !active.is_end_told) else {
            return;
        };
        let Some(end) = &active.end else { return };
        if !around.is_up {
            return;
        }
        active.is_end_told = true;
        let mut told = (Outcome::Done, None, 0, 0, 0, "");
        match &end.outcome {
            JobOutcome::Done => {}
            JobOutcome::Failed { failure, status } => {
                told = (Outcome::Failed, Some(*failure), *status, 0, 0, "");
            }
            JobOutcome::CheckFailed { failure, status, line, column } => {
                told = (Outcome::CheckFailed, Some(*failure), *status, *line, *column, "");
            }
            JobOutcome::SourceFailed(why) => {
                told = (Outcome::SourceFailed, Some(Failure::Aborted), 0, 0, 0, short(why));
            }
        }
        let (outcome, failure, status, line, column, why) = told;
        around.say(&ToServer::Ended {
            link: self.link,
            job: active.job,
            outcome,
            failure,
            status,
            line,
            column,
            taken: end.taken,
            sent: end.sent,
            maybe_left: end.maybe_left,
            surely_left: end.surely_left,
            bytes_maybe_left: end.bytes_maybe_left,
            bytes_surely_left: end.bytes_surely_left,
            why,
        });
    }

    /// Credit, if there is notably more of it than before.
    fn give(&mut self, at_any_rate: bool, around: &mut Surroundings<'_>) {
        let (link, buffer) = (self.link, self.buffer);
        let Some(active) = &mut self.active else { return };
        let Some(writer) = active.writer.as_ref().filter(|_| !active.fed.is_whole()) else {
            return;
        };
        let room = buffer - writer.level();
        let step = (buffer / CREDIT_PARTS as usize).max(1);
        let is_worth_it = active.fed.received() + room as u64 >= active.fed.until() + step as u64;
        if at_any_rate || is_worth_it {
            active.fed.give(room as u64);
            around.say(&ToServer::Credit {
                link,
                job: active.job,
                pass: active.pass,
                received: active.fed.received(),
                until: active.fed.until(),
            });
        }
        let missing = (active.fed.until() - active.fed.received()) as usize;
        // Woken when a step more can be given; never, if all of the buffer is given already.
        if let Some(level) = buffer.checked_sub(missing + step) {
            writer.wake_at(level);
        }
    }

    /// Credit, and how far the job is.
    pub(super) fn pump(
        &mut self,
        figures: Option<&LaneFigures>,
        now: Micros,
        around: &mut Surroundings<'_>,
    ) {
        self.give(false, around);
        let link = self.link;
        let Some(active) = self.active.as_mut().filter(|active| active.end.is_none()) else {
            return;
        };
        let Some(figures) = figures.filter(|figures| figures.job == active.of_lane.0) else {
            return;
        };
        let told = (figures.is_held, figures.is_starved);
        let is_due = active.told_at.is_none_or(|at| now >= at + PROGRESS) || told != active.told;
        if !is_due || !around.is_up {
            return;
        }
        (active.told_at, active.told) = (Some(now), told);
        around.remark(&ToServer::Progress {
            link,
            job: active.job,
            taken: figures.job_taken,
            maybe_left: figures.job_maybe_left,
            surely_left: figures.job_surely_left,
            bytes_left: figures.job_bytes_surely_left,
            level: u32::try_from(figures.level).unwrap_or(u32::MAX),
            is_held: figures.is_held,
            is_starved: figures.is_starved,
        });
    }
}
