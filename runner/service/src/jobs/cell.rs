//! What a step of a cell writes down: the cell, what it does to jobs, and what the journal says of it,
//! all at once or not at all.

use softplug_abi::JobId;
use softplug_cell::Stop;

use super::store::Change;
use super::{Extent, Job, JobSpec, Jobs, JobsError, Note, Start, State, Step};
use super::{after, begun, created, live, note, now, queued_note};

/// A step of a cell.
#[derive(Clone, Debug, Default)]
pub struct CellStep {
    /// The cell's name.
    pub cell: String,
    /// The cell as it is behind the step, encoded.
    pub saved: Vec<u8>,
    /// Jobs that came to a word.
    pub arrived: Vec<Arrived>,
    /// A job that begins with it.
    pub begins: Option<JobId>,
    /// Jobs that were loaded, and are started now.
    pub started: Vec<JobId>,
    /// Jobs that go on behind a block at which another one stood.
    pub resumed: Vec<Resumed>,
    /// What the journal says.
    pub notes: Vec<Note>,
}

/// A job that came to a word, or went past it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Arrived {
    /// The job.
    pub id: JobId,
    /// Words that are behind it.
    pub passed: u32,
    /// All before this byte has left.
    pub left: u64,
}

/// A job that goes on with one that stood behind a block.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Resumed {
    /// What it is to do.
    pub spec: JobSpec,
    /// Where its feed stops.
    pub stops: Vec<Stop>,
    /// Somebody had the other one pause.
    pub is_paused: bool,
}

impl Jobs {
    /// Carries out a step of a cell; the jobs that it changed.
    ///
    /// # Errors
    /// It cannot be written down, or a job is in another state. Nothing has happened then.
    pub fn step_cell(&self, step: CellStep) -> Result<Vec<Job>, JobsError> {
        let mut store = self.store();
        let time = now();
        let mut change = Change { cell: Some((step.cell, step.saved)), ..Change::default() };
        change.notes = step.notes.into_iter().map(Note::tamed).collect();
        for Arrived { id, passed, left } in step.arrived {
            let Some(job) = store.known().live.get(&id).cloned() else { continue };
            let surely = job.extent.surely.max(left);
            let extent = Extent { surely, maybe: job.extent.maybe.max(surely) };
            change.jobs.push(Job { extent, passed, ..job });
        }
        for id in step.started {
            let mut job = live(&store, id, Step::Begin)?;
            job.spec.start = Some(Start::Given);
            change.notes.push(note(&job, format!("job {id} is started by its cell")));
            change.jobs.push(job);
        }
        if let Some(id) = step.begins {
            let mut job = live(&store, id, Step::Begin)?;
            job.state = after(job.state, job.has_begun(), Step::Begin).ok_or(JobsError::State {
                id,
                state: job.state,
                step: Step::Begin,
            })?;
            let text = begun(&mut job, time);
            change.notes.push(note(&job, text));
            change.jobs.push(job);
        }
        for (at, Resumed { spec, stops, is_paused }) in step.resumed.into_iter().enumerate() {
            let state = if is_paused { State::Paused } else { State::Queued };
            let job = created(JobId(store.next_job() + at as u32), spec, state);
            change.notes.push(queued_note(&job));
            change.stops.push((job.id, stops));
            change.jobs.push(job);
        }
        store.write(&change, time)?;
        Ok(change.jobs)
    }
}
