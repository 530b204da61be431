//! One delivery on its way to the disk. Every step can be tried again.

use std::fs::File;
use std::io;

use softplug_abi::{DeliveryId, Failure, JobId};
use softplug_live::reactor::LaneId;
use softplug_live::reservoir::{Drawn, ReservoirReader};
use softplug_live::store::Mark;
use thiserror::Error;

use super::{Incoming, ReceptionWriterNews, Stores};
use crate::jobs::{Comparison, FromUnit, JobsError, Reason, Reception};
use crate::programs::{Arrival, Arrived, OverQuota, ProgramError, first_difference};

/// Turns of one delivery before the next has its turn.
const TURNS: usize = 4;
/// Bytes of one turn at most.
const PIECE: usize = 64 << 10;

pub(super) struct Delivery {
    pub(super) lane: LaneId,
    pub(super) id: DeliveryId,
    pub(super) link: String,
    place: String,
    answers: Option<JobId>,
    unit: Option<FromUnit>,
    bytes: ReservoirReader,
    pub(super) name: Option<String>,
    end: Option<End>,
    /// There may be something to read, or it has ended.
    pub(super) is_woken: bool,
    /// The disk refused; when it is tried again.
    pub(super) retry_at: Option<std::time::Instant>,
    /// That was told.
    pub(super) is_told: bool,
    written: u64,
    stage: Stage,
}

/// How it ended.
struct End {
    failure: Option<Failure>,
    status: u16,
    /// How many bytes the plug-in gave, if it said so.
    bytes: Option<u64>,
}

enum Stage {
    /// No job and no file yet.
    New,
    /// Its job is known.
    Numbered(u32),
    /// Its file is being written.
    Coming(u32, Box<Arrival>),
    /// It is on the disk, and not yet in the book.
    Kept(u32, Arrived, Option<Reason>),
    Over,
}

/// Why what comes cannot be put away.
#[derive(Debug, Error)]
pub(super) enum NotPutAway {
    #[error(transparent)]
    Quota(#[from] OverQuota),
    #[error(transparent)]
    Jobs(#[from] JobsError),
    #[error(transparent)]
    Begin(#[from] ProgramError),
    #[error("what comes on \"{link}\" cannot be written: {error}")]
    Write { link: String, error: io::Error },
}

/// What of a delivery is lost that was given up.
pub(super) struct Loss {
    pub(super) job: Option<JobId>,
    pub(super) bytes: u64,
}

/// What a delivery waits for.
pub(super) enum Next {
    /// Being woken.
    Woken,
    /// Its next turn.
    Again,
    /// Nothing.
    Over,
}

impl Delivery {
    pub(super) fn new(incoming: Incoming) -> Self {
        let Incoming { lane, link, place, delivery, job, unit, bytes } = incoming;
        Self {
            lane,
            id: delivery,
            link,
            place,
            answers: job,
            unit,
            bytes,
            name: None,
            end: None,
            is_woken: true,
            retry_at: None,
            is_told: false,
            written: 0,
            stage: Stage::New,
        }
    }

    pub(super) fn has_ended(&self) -> bool {
        self.end.is_some()
    }

    /// The first end counts.
    pub(super) fn end(&mut self, failure: Option<Failure>, status: u16, bytes: Option<u64>) {
        self.end.get_or_insert(End { failure, status, bytes });
        self.is_woken = true;
    }

    /// Its unit has all of it, and says it again to the next gateway.
    pub(super) fn is_in_unit(&self) -> bool {
        self.unit.is_some() && matches!(self.stage, Stage::New | Stage::Numbered(_))
    }

    /// Goes as far as it can. `is_last`: the gateway ends, so that what was taken of the
    /// machine is put away whatever the quotas say; it is no more than the room for deliveries.
    pub(super) fn work(
        &mut self,
        stores: &Stores,
        is_last: bool,
        tell: &mut dyn FnMut(ReceptionWriterNews),
    ) -> Result<Next, NotPutAway> {
        if let Stage::New = self.stage {
            if self.is_stored(stores)? {
                return Ok(Next::Over);
            }
            if !is_last && self.answers.is_none() {
                stores.quotas.begin(&self.link, stores.jobs.today(&self.link))?;
            }
            self.stage = Stage::Numbered(self.number(stores, tell)?);
        }
        if let Stage::Numbered(job) = self.stage {
            let arrival = stores.receptions.begin(&self.place, JobId(job))?;
            self.stage = Stage::Coming(job, Box::new(arrival));
        }
        if let Stage::Coming(..) = self.stage
            && let Some(next) = self.take(stores)?
        {
            return Ok(next);
        }
        self.keep();
        self.write_down(stores, tell)?;
        Ok(Next::Over)
    }

    /// The job that it belongs to: its own, if it answers none.
    fn number(
        &self,
        stores: &Stores,
        tell: &mut dyn FnMut(ReceptionWriterNews),
    ) -> Result<u32, JobsError> {
        if let Some(job) = self.answers {
            return Ok(job.0);
        }
        let job = stores.jobs.receive(&self.link)?;
        let number = job.id.0;
        tell(ReceptionWriterNews::Begun(Box::new(job)));
        Ok(number)
    }

    /// Its unit has said it before, to another lane of the link, and it is stored since.
    fn is_stored(&self, stores: &Stores) -> Result<bool, JobsError> {
        let Some(FromUnit { port, said }) = &self.unit else { return Ok(false) };
        let stored = stores.jobs.reader().stored_delivery(port)?;
        Ok(stored.is_some_and(|last| last.covers(*said)))
    }

    /// Writes what there is; `None` when that was all.
    fn take(&mut self, stores: &Stores) -> Result<Option<Next>, NotPutAway> {
        let Stage::Coming(_, arrival) = &mut self.stage else { return Ok(None) };
        let cannot = |error| NotPutAway::Write { link: self.link.clone(), error };
        for _ in 0..TURNS {
            let room = if self.end.is_some() {
                // No more comes than has been taken of the machine already.
                u64::MAX
            } else {
                let today = stores.jobs.today(&self.link);
                match stores.quotas.room(&self.link, today, self.written) {
                    Ok(room) => room,
                    Err(over) if self.bytes.level() > 0 => return Err(over.into()),
                    Err(_) => 1,
                }
            };
            let most = usize::try_from(room).unwrap_or(usize::MAX).min(PIECE);
            // Only what is written counts as read: a unit forgets what is told of it.
            let drawn = self.bytes.read_into(most, |bytes| arrival.write(bytes));
            match drawn.map_err(cannot)? {
                Drawn::Bytes(count) => self.written += count as u64,
                // The lane says when it ends, and closes the buffer before.
                _ if self.end.is_none() => return Ok(Some(Next::Woken)),
                Drawn::Later | Drawn::End | Drawn::Failed => return Ok(None),
            }
        }
        Ok(Some(Next::Again))
    }

    fn keep(&mut self) {
        let (job, arrival) = match std::mem::replace(&mut self.stage, Stage::Over) {
            Stage::Coming(job, arrival) => (job, arrival),
            other => {
                self.stage = other;
                return;
            }
        };
        let reason = self.reason();
        let mark = if reason.is_some() { Mark::Failed } else { Mark::Complete };
        let (arrived, reason) = match arrival.end(self.name.as_deref(), mark) {
            Ok(arrived) => (arrived, reason),
            // Not to be tried again: after a failed write the system forgets what it had.
            Err(error) => {
                let lost = Arrived { path: None, name: self.name.clone(), bytes: self.written };
                (lost, Some(Reason::new("disk", error.to_string())))
            }
        };
        self.stage = Stage::Kept(job, arrived, reason);
    }

    /// What is not on the disk by now does not get there. Its job says so, where that can be
    /// written down.
    pub(super) fn give_up(
        &mut self,
        stores: &Stores,
        why: &NotPutAway,
        tell: &mut dyn FnMut(ReceptionWriterNews),
    ) -> Loss {
        // What was not read of a unit's is in the unit yet.
        let is_of_unit = self.unit.is_some();
        let bytes = if is_of_unit { 0 } else { self.bytes.level() as u64 };
        let what = if bytes > 0 {
            format!("{why}; {bytes} bytes of it are lost")
        } else {
            why.to_string()
        };
        let (name, written) = (self.name.clone(), self.written);
        let kept = |job, arrived: Option<Arrived>| {
            let nothing = Arrived { path: None, name: name.clone(), bytes: written };
            Stage::Kept(job, arrived.unwrap_or(nothing), Some(Reason::new("disk", what)))
        };
        if !matches!(self.stage, Stage::Kept(..)) {
            // It is not stored, whatever its end was.
            self.unit = None;
        }
        self.stage = match std::mem::replace(&mut self.stage, Stage::Over) {
            Stage::New if !is_of_unit => match self.number(stores, tell) {
                Ok(job) => kept(job, None),
                Err(error) => {
                    tracing::error!(link = self.link, %error, "no job says what is lost");
                    Stage::Over
                }
            },
            Stage::Numbered(job) => kept(job, None),
            Stage::Coming(job, arrival) => {
                kept(job, arrival.end(name.as_deref(), Mark::Failed).ok())
            }
            stage @ (Stage::New | Stage::Kept(..) | Stage::Over) => stage,
        };
        let job = if let Stage::Kept(job, ..) = &self.stage { Some(JobId(*job)) } else { None };
        if let Err(error) = self.write_down(stores, tell) {
            let (link, error) = (&self.link, error.to_string());
            tracing::error!(
                link,
                job = job.map(|job| job.0),
                error,
                "a job does not know its file"
            );
        }
        Loss { job, bytes }
    }

    fn reason(&self) -> Option<Reason> {
        let end = self.end.as_ref()?;
        match (end.failure, end.bytes) {
            (Some(failure), _) => {
                Some(Reason { status: end.status, ..Reason::new(failure.name(), failure.text()) })
            }
            (None, Some(bytes)) if bytes != self.written => Some(Reason::new(
                "internal",
                format!("{bytes} bytes came, and {} were put away", self.written),
            )),
            (None, _) => None,
        }
    }

    fn write_down(
        &mut self,
        stores: &Stores,
        tell: &mut dyn FnMut(ReceptionWriterNews),
    ) -> Result<(), NotPutAway> {
        let Stage::Kept(job, arrived, reason) = &self.stage else { return Ok(()) };
        let reception = Reception {
            file: arrived.file(),
            bytes: arrived.bytes,
            is_complete: reason.is_none(),
            compared: compare(stores, &self.link, arrived),
        };
        let name = arrived.name.clone();
        // Of what was given up here, its unit still has the rest.
        let unit =
            self.unit.clone().filter(|_| self.end.as_ref().is_some_and(|end| end.bytes.is_some()));
        match stores.jobs.received(JobId(*job), name, reception, reason.clone(), unit) {
            Ok(job) => tell(ReceptionWriterNews::Kept(Box::new(job))),
            Err(error @ (JobsError::Disk(_) | JobsError::Store(_))) => return Err(error.into()),
            // The job that it answers has ended in the meantime; the file stays.
            Err(error) => tracing::warn!(job, %error, "a reception belongs to no job any more"),
        }
        self.stage = Stage::Over;
        Ok(())
    }
}

/// With what was sent last under this name. What cannot be compared is not.
fn compare(stores: &Stores, link: &str, arrived: &Arrived) -> Option<Comparison> {
    let (name, path) = (arrived.name.as_ref()?, arrived.path.as_ref()?);
    let sent = stores.jobs.reader().last_sent(link, name).ok()??;
    let (one, other) = (File::open(path).ok()?, stores.snapshots.open(sent.data).ok()?);
    let differs_at = first_difference(one, other).ok()?;
    Some(Comparison { with: sent.job.0, differs_at })
}
