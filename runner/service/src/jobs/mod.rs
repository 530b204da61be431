//! Jobs and the journal: written down before they take effect outside, so that after
//! a crash it is known what may have left, and nothing is sent again unasked.
//!
//! Every call that changes something returns when the change is on the disk. After
//! an error nothing has changed.

mod ballast;
mod begin;
mod cell;
mod claims;
mod error;
mod job;
mod journal;
mod progress;
mod reading;
mod receiving;
mod shown;
mod state;
mod stopped;
mod store;
mod tables;
mod told;
mod turns;

#[doc(inline)]
pub use crate::programs::blocks::{self, Between, Block};
#[doc(inline)]
pub use crate::programs::{Data, Today};
pub use begin::{BeginAt, Words, beginning_at};
pub use cell::{Arrived, CellStep, Resumed};
pub use claims::{Claim, Claimed};
pub use error::{JobsError, StoreError};
pub use job::{
    CheckFault, Comparison, Extent, FromUnit, Job, JobSpec, Kind, Left, Origin, Reason, Reception,
    Start,
};
pub use journal::{Entry, EntryFilter, Keep, Note, Subject, Weight};
pub use progress::LaneProgress;
pub(crate) use progress::grouped;
pub use reading::JobsReader;
pub use state::{State, Step, after};
pub use tables::Sent;

use softplug_abi::JobId;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, RwLock};
use std::time::{SystemTime, UNIX_EPOCH};

use redb::Database;
use softplug_cell::Stop;

use crate::disk::make_folder;
use crate::programs::Snapshots;
use ballast::Ballast;
use store::{Change, JobStore, Known, look};
use told::{ended_note, note, what};
use turns::{Turn, Turns, Who};

/// Most jobs that wait on one link.
const WAITING: usize = 1_000;

/// Most jobs that are acknowledged in one change.
const SEEN_AT_ONCE: usize = 32;

/// All jobs and the journal of a gateway, to be changed: one after the other, what serves a
/// line first. Clones are the same.
///
/// What can be read is read through [`JobsReader`], which has no part in these turns.
#[derive(Clone)]
pub struct Jobs {
    store: Arc<Turns<JobStore>>,
    known: Arc<RwLock<Known>>,
    reader: JobsReader,
}

/// What was found at the start.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Recovery {
    /// Jobs that were under way when the gateway ended. They are not begun again.
    pub interrupted: Vec<Job>,
    /// Jobs that wait for their turn.
    pub queued: usize,
}

/// Which jobs are wanted.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct JobFilter {
    /// Of this link only.
    pub link: Option<String>,
    /// In this state only.
    pub state: Option<State>,
    /// Of this kind only, as it is shown.
    pub kind: Option<String>,
    /// With this, in small letters, in the program's name.
    pub find: Option<String>,
    /// Ordered at this time or later, in milliseconds since 1970.
    pub since: Option<u64>,
    /// Ordered before this time.
    pub until: Option<u64>,
    /// Older than the job of this number.
    pub before: Option<u32>,
    /// At most so many, the newest first.
    pub most: usize,
}

impl JobFilter {
    /// Whether it asks for what only the jobs themselves tell.
    fn looks_into(&self) -> bool {
        self.kind.is_some() || self.find.is_some() || self.since.is_some() || self.until.is_some()
    }

    /// Whether a job of the link and the state is as asked.
    fn takes(&self, job: &Job) -> bool {
        self.kind.as_ref().is_none_or(|kind| *kind == shown::kind_name(job.spec.job_kind.clone()))
            && self.since.is_none_or(|since| job.created >= since)
            && self.until.is_none_or(|until| job.created < until)
            && self.find.as_ref().is_none_or(|find| {
                let mut names = job.spec.program.iter().chain(&job.spec.named);
                names.any(|name| name.to_lowercase().contains(find))
            })
    }
}

/// How a job ends.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Ending {
    /// All of it has left, or come.
    Done,
    /// It could not be carried out.
    Failed(Reason),
    /// Somebody ended it.
    Aborted,
    /// The plug-in ended, or the gateway does. Says why.
    Interrupted(String),
}

/// How far a job may go, or has come.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Advance {
    /// The job.
    pub id: JobId,
    /// Nothing from this byte on is given away before more is granted.
    pub grant: Option<u64>,
    /// All before this byte has left.
    pub surely: Option<u64>,
}

impl Jobs {
    /// The jobs in a state folder, which is made if need be. What was under way when the last
    /// gateway ended is interrupted now.
    ///
    /// # Errors
    /// They cannot be read or written, or another gateway has them.
    pub fn open(folder: &Path, keep: Keep) -> Result<(Self, Recovery), JobsError> {
        make_folder(folder)?;
        let path = folder.join("jobs.redb");
        let ballast = Ballast::new(folder.join("reserve"));
        let opener = store::in_file(path.clone());
        Self::start(JobStore::open(&path, opener, Some(ballast), keep)?)
    }

    /// Opens the jobs in a database that somebody else opens, each time anew after an error.
    ///
    /// # Errors
    /// It cannot be read or written.
    pub fn open_with(
        mut open: impl FnMut() -> Result<Database, redb::DatabaseError> + Send + 'static,
        keep: Keep,
    ) -> Result<(Self, Recovery), JobsError> {
        let opener = Box::new(move || Ok(open()?));
        Self::start(JobStore::open(Path::new("a database"), opener, None, keep)?)
    }

    fn start(mut store: JobStore) -> Result<(Self, Recovery), JobsError> {
        let now = now();
        let mut change = Change::default();
        let mut recovery = Recovery::default();
        let live: Vec<Job> = store.known().live.values().cloned().collect();
        for mut job in live {
            match after(job.state, job.has_begun(), Step::Recover) {
                Some(State::Interrupted) => {
                    interrupt(&mut job, "the gateway ended in the middle of it", now);
                    job.is_unseen = true;
                    change.notes.push(ended_note(&job));
                    recovery.interrupted.push(job.clone());
                    change.jobs.push(job);
                }
                _ => recovery.queued += usize::from(job.state == State::Queued),
            }
        }
        if !change.jobs.is_empty() {
            store.write(&change, now)?;
        }
        // Without it a disk that is full now is found out at the first job.
        if let Err(error) = store.load_ballast() {
            tracing::warn!(%error, "no room is kept for the case of a full disk");
        }
        let (known, reader) = (store.shared(), store.reader());
        Ok((Self { store: Arc::new(Turns::new(store)), known, reader }, recovery))
    }

    /// What can be read, for whoever only reads.
    pub fn reader(&self) -> &JobsReader {
        &self.reader
    }

    /// All jobs that have not ended, the oldest first. Asks no disk, and waits for nobody who
    /// writes.
    pub fn live(&self) -> Vec<Job> {
        look(&self.known).live.values().cloned().collect()
    }

    /// How many jobs wait for their turn on each link that has such.
    pub fn queued(&self) -> BTreeMap<String, u32> {
        let mut queued = BTreeMap::new();
        for job in look(&self.known).live.values() {
            if job.state == State::Queued {
                match queued.get_mut(&job.spec.link) {
                    Some(count) => *count += 1,
                    None => drop(queued.insert(job.spec.link.clone(), 1)),
                }
            }
        }
        queued
    }

    /// Takes a job into the queue of its link.
    ///
    /// # Errors
    /// It cannot be written down, or too many wait. It is not taken then.
    pub fn submit(&self, spec: JobSpec) -> Result<Job, JobsError> {
        self.submit_with(spec, Vec::new())
    }

    /// As [`submit`](Self::submit), for a program whose feed stops at these places.
    ///
    /// # Errors
    /// As there.
    pub fn submit_with(&self, spec: JobSpec, stops: Vec<Stop>) -> Result<Job, JobsError> {
        Self::submit_as(&mut self.store.take(Who::Other), spec, stops, None)
    }

    /// `claim`: what the job is written down with, in one change.
    fn submit_as(
        store: &mut JobStore,
        spec: JobSpec,
        stops: Vec<Stop>,
        claim: Option<&Claim>,
    ) -> Result<Job, JobsError> {
        if spec.from > spec.data.map_or(0, |data| data.size) {
            return Err(JobsError::Spec("the job would begin behind the program's end".to_owned()));
        }
        let on_link = |job: &&Job| job.spec.link == spec.link && job.spec.kind != Kind::Receive;
        let waiting = store.known().live.values().filter(on_link).count();
        if waiting >= WAITING {
            return Err(JobsError::QueueFull { link: spec.link, waiting });
        }
        // New work is taken only with the reserve in place.
        store.load_ballast()?;
        let job = created(JobId(store.next_job()), spec, State::Queued);
        let notes = vec![queued_note(&job)];
        let stops = if stops.is_empty() { Vec::new() } else { vec![(job.id, stops)] };
        let claimed = claim.map(|claim| (claim.name.clone(), Some((job.id, claim.size))));
        let jobs = vec![job.clone()];
        let change = Change { jobs, notes, stops, claimed, ..Change::default() };
        store.write(&change, now())?;
        Ok(job)
    }

    /// The job whose turn it is on a link, if the link is not busy.
    pub fn next(&self, link: &str) -> Option<Job> {
        let known = look(&self.known);
        job::next(known.live.values().filter(|job| job.spec.link == link)).cloned()
    }

    /// The job is about to be given to the plug-in.
    ///
    /// # Errors
    /// It cannot be written down, or does not wait. It must not be given away then.
    pub fn begin(&self, id: JobId) -> Result<Job, JobsError> {
        self.step(id, Step::Begin, |job, now| Some(begun(job, now)))
    }

    /// The job shall pause. If it has begun, the plug-in must be told.
    ///
    /// # Errors
    /// It has ended, or is paused, or it cannot be written down.
    pub fn pause(&self, id: JobId) -> Result<Job, JobsError> {
        self.step(id, Step::Pause, |job, _| Some(format!("job {} is paused", job.id)))
    }

    /// The job shall go on. If it has begun, the plug-in must be told.
    ///
    /// # Errors
    /// It is not paused, or it cannot be written down.
    pub fn resume(&self, id: JobId) -> Result<Job, JobsError> {
        self.step(id, Step::Resume, |job, _| Some(format!("job {} goes on", job.id)))
    }

    /// The job shall end. One that has not begun has ended then; one that has is ended by
    /// the plug-in, which must be told.
    ///
    /// # Errors
    /// It has ended, or it cannot be written down.
    pub fn abort(&self, id: JobId) -> Result<Job, JobsError> {
        self.step(id, Step::Abort, |job, now| {
            if job.has_begun() {
                return Some(format!("job {} is to be aborted", job.id));
            }
            job.ended = Some(now);
            Some(format!("job {} is aborted, it had not begun", job.id))
        })
    }

    /// The job shall go before those with a lower priority.
    ///
    /// # Errors
    /// It has ended, or it cannot be written down.
    pub fn prioritise(&self, id: JobId, priority: i32) -> Result<Job, JobsError> {
        let mut store = self.store();
        let mut job = live(&store, id, Step::Pause)?;
        job.spec.priority = priority;
        let note = note(&job, format!("job {id} has priority {priority}"));
        put(&mut store, job, vec![note])
    }

    /// The job has ended. `left` is what the link knows of the bytes that left, which may be
    /// more exact than what was granted.
    ///
    /// # Errors
    /// It is not under way, or it cannot be written down.
    pub fn end(&self, id: JobId, ending: Ending, left: Option<Left>) -> Result<Job, JobsError> {
        let mut store = self.store();
        let mut job = live(&store, id, Step::End(State::Done))?;
        let (state, reason) = match ending {
            Ending::Done => (State::Done, None),
            Ending::Failed(reason) => (State::Failed, Some(reason)),
            Ending::Aborted => (State::Aborted, None),
            Ending::Interrupted(text) => {
                (State::Interrupted, Some(Reason::new("interrupted", text)))
            }
        };
        let step = Step::End(state);
        job.state = after(job.state, job.has_begun(), step).ok_or(JobsError::State {
            id,
            state: job.state,
            step,
        })?;
        job.reason = reason;
        job.ended = Some(now());
        job.is_unseen = job.has_ended_badly();
        if let Some(left) = left {
            (job.taken, job.sent) = (left.taken, left.sent);
            job.extent = narrowed(job.extent, left.extent);
        }
        if state == State::Done {
            // All that was taken; a plug-in may be done before that is all there is.
            let all = match (left, job.spec.data) {
                (None, Some(data)) => data.size,
                _ => job.taken,
            };
            job.extent = Extent { surely: all, maybe: all };
        }
        let notes = vec![ended_note(&job)];
        let sent = sent(&job);
        let change = Change { jobs: vec![job.clone()], notes, sent, ..Change::default() };
        store.write(&change, now())?;
        Ok(job)
    }

    /// Somebody has seen how jobs of a link ended: the last of `jobs`, and those before it.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn acknowledge(&self, jobs: &[Job]) -> Result<Vec<Job>, JobsError> {
        let Some(last) = jobs.last() else { return Ok(Vec::new()) };
        let seen = |job: &Job| Job { is_unseen: false, ..job.clone() };
        let text = match jobs.len() {
            1 => format!("job {} is {}: somebody has seen it", last.id, last.state.name()),
            count => format!("{count} jobs, the last one {}, have been seen", last.id),
        };
        let mut notes = vec![note(last, text)];
        let seen: Vec<Job> = jobs.iter().map(seen).collect();
        // The newest first, which is what was asked for: a line may have its turn in between.
        for some in seen.rchunks(SEEN_AT_ONCE) {
            let notes = std::mem::take(&mut notes);
            let change = Change { jobs: some.to_vec(), notes, ..Change::default() };
            self.store().write(&change, now())?;
        }
        Ok(seen)
    }

    /// Notes how far jobs may go and have come, all at once. What has ended meanwhile is left
    /// out.
    ///
    /// # Errors
    /// It cannot be written down: then nothing more may be given away.
    pub fn advance(&self, advances: &[Advance]) -> Result<(), JobsError> {
        let mut store = self.store();
        let mut change = Change::default();
        for advance in advances {
            let job = store.known().live.get(&advance.id).filter(|job| job.has_begun()).cloned();
            let Some(job) = job else { continue };
            let Extent { surely, maybe } = job.extent;
            let maybe = maybe.max(advance.grant.unwrap_or(0));
            let surely = surely.max(advance.surely.unwrap_or(0)).min(maybe);
            let extent = Extent { surely, maybe };
            if extent != job.extent {
                change.jobs.push(Job { extent, ..job });
            }
        }
        if change.jobs.is_empty() {
            return Ok(());
        }
        Ok(store.write(&change, now())?)
    }

    /// A new job that does an ended one again, from its beginning or further on, with the
    /// data as they were then. `field`: the field of the job's kind that takes the number of the
    /// first block, for a plug-in that finds blocks itself.
    ///
    /// # Errors
    /// The job has not ended or has no data, there is no such block or byte, or it cannot be
    /// written down.
    pub fn restart(
        &self,
        id: JobId,
        at: BeginAt,
        field: Option<&str>,
        snapshots: &Snapshots,
    ) -> Result<Job, JobsError> {
        let job = self.reader.job(id)?;
        if !job.state.is_final() {
            return Err(JobsError::NotEnded { id, state: job.state });
        }
        let spec = JobSpec { restarts: Some(id), origin: Origin::Order, start: None, ..job.spec };
        if spec.kind == Kind::Receive || (spec.kind == Kind::Send && spec.data.is_none()) {
            return Err(JobsError::Spec(format!(
                "job {id} cannot be restarted: the gateway has no data to send"
            )));
        }
        let stops = self.reader.stops(id)?;
        let words = Words { stops: &stops, stood: Some(job.passed) };
        self.submit_with(beginning_at(spec, at, field, words, snapshots)?, stops)
    }

    fn step(
        &self,
        id: JobId,
        step: Step,
        change: impl FnOnce(&mut Job, u64) -> Option<String>,
    ) -> Result<Job, JobsError> {
        let mut store = self.store();
        let mut job = live(&store, id, step)?;
        job.state = after(job.state, job.has_begun(), step).ok_or(JobsError::State {
            id,
            state: job.state,
            step,
        })?;
        let text = change(&mut job, now());
        let notes = text.map(|text| note(&job, text)).into_iter().collect();
        put(&mut store, job, notes)
    }

    /// Writes something into the journal.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn note(&self, note: Note) -> Result<(), JobsError> {
        let change = Change { notes: vec![note.tamed()], ..Change::default() };
        Ok(self.store.take(Who::Other).write(&change, now())?)
    }

    fn store(&self) -> Turn<'_, JobStore> {
        self.store.take(Who::Line)
    }
}

impl std::fmt::Debug for Jobs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Jobs").finish_non_exhaustive()
    }
}

/// Milliseconds since 1970.
pub fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_millis() as u64)
}

/// What the journal says of a job that begins.
fn begun(job: &mut Job, now: u64) -> String {
    job.began = Some(now);
    job.extent = Extent { surely: job.spec.from, maybe: job.spec.from };
    format!("job {} begins: {}", job.id, what(job))
}

fn queued_note(job: &Job) -> Note {
    note(job, format!("job {} is queued: {}", job.id, what(job)))
}

fn created(id: JobId, spec: JobSpec, state: State) -> Job {
    Job {
        id,
        passed: spec.words_before,
        spec,
        state,
        extent: Extent::default(),
        taken: 0,
        sent: 0,
        reason: None,
        reception: None,
        is_unseen: false,
        created: now(),
        began: None,
        ended: None,
    }
}

fn put(store: &mut JobStore, job: Job, notes: Vec<Note>) -> Result<Job, JobsError> {
    let change = Change { jobs: vec![job], notes, ..Change::default() };
    store.write(&change, now())?;
    Ok(change.jobs.into_iter().next().expect("it was just put there"))
}

fn live(store: &JobStore, id: JobId, step: Step) -> Result<Job, JobsError> {
    if let Some(job) = store.known().live.get(&id) {
        return Ok(job.clone());
    }
    let job = store.job(id)?.ok_or(JobsError::NotFound(id))?;
    Err(JobsError::State { id, state: job.state, step })
}

fn interrupt(job: &mut Job, text: &str, now: u64) {
    job.state = State::Interrupted;
    job.reason = Some(Reason::new("interrupted", text));
    job.ended = Some(now);
}

/// Neither bound gets worse than what is known already.
fn narrowed(known: Extent, left: Extent) -> Extent {
    let maybe = known.maybe.min(left.maybe).max(known.surely);
    Extent { surely: known.surely.max(left.surely).min(maybe), maybe }
}

/// Only a whole program is what the machine has.
fn sent(job: &Job) -> Vec<(String, String, Sent)> {
    let (Some(program), Some(data)) = (&job.spec.program, job.spec.data) else { return Vec::new() };
    let begins_later = job.spec.fields.iter().any(|(name, _)| softplug_trial::is_beginning(name));
    let is_all = job.spec.from == 0 && !begins_later && job.extent.surely >= data.size;
    let is_whole = job.state == State::Done && job.spec.kind == Kind::Send && is_all;
    // The machine sends it back under the name that it says of itself.
    let names = std::iter::once(plain_name(program)).chain(job.spec.named.as_deref());
    let rows =
        names.map(|name| (job.spec.link.clone(), name.to_owned(), Sent { job: job.id, data }));
    if is_whole { rows.collect() } else { Vec::new() }
}

/// As a machine would call it: without folders and extension.
fn plain_name(program: &str) -> &str {
    let file = program.rsplit('/').next().unwrap_or(program);
    file.rsplit_once('.').map_or(file, |(stem, _)| if stem.is_empty() { file } else { stem })
}
