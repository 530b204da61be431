//! What stands in the database: its tables, and how a job is found in them.

use redb::{
    ReadTransaction, ReadableTable, ReadableTableMetadata, Table, TableDefinition, TableError,
    WriteTransaction,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use softplug_abi::JobId;
use softplug_cell::Stop;

use super::{Data, Job, State};

pub(super) const JOBS: TableDefinition<u32, &[u8]> = TableDefinition::new("jobs");
/// So that a page of the jobs in one state is found without reading others.
pub(super) const BY_STATE: TableDefinition<(u8, u32), ()> = TableDefinition::new("jobs-by-state");
/// So that a page of one link's jobs in one state is found without reading others.
pub(super) const BY_LINK: TableDefinition<(&str, u8, u32), ()> =
    TableDefinition::new("jobs-by-link");
/// The job that a reception belongs to, by link and file.
pub(super) const RECEIVED: TableDefinition<(&str, &str), u32> = TableDefinition::new("received");
pub(super) const JOURNAL: TableDefinition<u64, &[u8]> = TableDefinition::new("journal");
/// What was sent last, by link and program.
pub(super) const SENT: TableDefinition<(&str, &str), &[u8]> = TableDefinition::new("sent");
pub(super) const NUMBERS: TableDefinition<&str, u64> = TableDefinition::new("numbers");
/// What a link has received on a day: the day's number, receptions, bytes.
pub(super) const TODAY: TableDefinition<&str, (u64, u64, u64)> = TableDefinition::new("today");
/// By port of a link: the identity of its unit, and the last delivery of it that is stored.
pub(super) const UNIT_DELIVERIES: TableDefinition<&str, (u64, u32)> =
    TableDefinition::new("unit-deliveries");

/// Cells, by name, as they were left.
pub(super) const CELLS: TableDefinition<&str, &[u8]> = TableDefinition::new("cells");
/// The job of a file that was taken from a drop folder, and the file's size, until that is put away.
pub(super) const CLAIMS: TableDefinition<&str, (u32, u64)> = TableDefinition::new("claims");
/// Drop folders that were looked after.
pub(super) const DROP_FOLDERS: TableDefinition<&str, ()> = TableDefinition::new("drop-folders");
/// Where the feed of a job stops, of those in whose program words of coordination stand.
pub(super) const STOPS: TableDefinition<u32, &[u8]> = TableDefinition::new("stops");

/// Jobs that go with one change at most: a change must not take long.
const PRUNED_AT_ONCE: usize = 8;

/// What was sent last.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Sent {
    /// The job.
    pub job: JobId,
    /// What it sent.
    #[serde(flatten)]
    pub data: Data,
}

/// All states, each at the place that is its code. A code never changes.
pub(super) const STATES: [State; 7] = [
    State::Queued,
    State::Running,
    State::Paused,
    State::Done,
    State::Failed,
    State::Aborted,
    State::Interrupted,
];

/// What stands for a state in keys.
pub(super) fn code(state: State) -> u8 {
    match state {
        State::Queued => 0,
        State::Running => 1,
        State::Paused => 2,
        State::Done => 3,
        State::Failed => 4,
        State::Aborted => 5,
        State::Interrupted => 6,
    }
}

type Bytes = &'static [u8];

/// The jobs with what leads to them, in one transaction.
pub(super) struct JobTables<'txn> {
    jobs: Table<'txn, u32, Bytes>,
    by_state: Table<'txn, (u8, u32), ()>,
    by_link: Table<'txn, (&'static str, u8, u32), ()>,
    received: Table<'txn, (&'static str, &'static str), u32>,
    stops: Table<'txn, u32, Bytes>,
}

impl<'txn> JobTables<'txn> {
    pub(super) fn open(writing: &'txn WriteTransaction) -> Result<Self, redb::Error> {
        Ok(Self {
            jobs: writing.open_table(JOBS)?,
            by_state: writing.open_table(BY_STATE)?,
            by_link: writing.open_table(BY_LINK)?,
            received: writing.open_table(RECEIVED)?,
            stops: writing.open_table(STOPS)?,
        })
    }

    /// Writes a job; `known`: the state in which it stands there, if that is known.
    pub(super) fn put(&mut self, job: &Job, known: Option<State>) -> Result<(), redb::Error> {
        let before = match known {
            Some(state) => Some(state),
            None => self.job(job.id)?.map(|before| before.state),
        };
        let link = &*job.spec.link;
        if let Some(before) = before.filter(|before| *before != job.state) {
            self.by_state.remove((code(before), job.id.0))?;
            self.by_link.remove((link, code(before), job.id.0))?;
        }
        if before != Some(job.state) {
            self.by_state.insert((code(job.state), job.id.0), ())?;
            self.by_link.insert((link, code(job.state), job.id.0), ())?;
        }
        if let Some(file) = job.file() {
            self.received.insert((link, file), job.id.0)?;
        }
        self.jobs.insert(job.id.0, &*encoded(job))?;
        Ok(())
    }

    /// Writes where the feed of a job stops.
    pub(super) fn put_stops(&mut self, id: JobId, stops: &[Stop]) -> Result<(), redb::Error> {
        self.stops.insert(id.0, &*encoded(&stops))?;
        Ok(())
    }

    /// The oldest that have ended go as long as there are more than `most`, a few at a time.
    pub(super) fn prune(&mut self, most: usize) -> Result<(), redb::Error> {
        let excess = (self.jobs.len()? as usize).saturating_sub(most);
        for _ in 0..excess.min(PRUNED_AT_ONCE) {
            let Some(id) = self.oldest_ended()? else { break };
            self.remove(JobId(id))?;
        }
        Ok(())
    }

    /// Makes anew what leads to the jobs, if it does not lead to all of them: the database is
    /// from a gateway that knew nothing of it.
    pub(super) fn complete(&mut self) -> Result<(), redb::Error> {
        if self.by_state.len()? == self.jobs.len()? && self.by_link.len()? == self.jobs.len()? {
            return Ok(());
        }
        self.by_state.retain(|_, ()| false)?;
        self.by_link.retain(|_, ()| false)?;
        for row in self.jobs.iter()? {
            let (id, value) = row?;
            let Some(job) = decoded::<Job>(value.value()) else { continue };
            let (link, code, id) = (&*job.spec.link, code(job.state), id.value());
            self.by_state.insert((code, id), ())?;
            self.by_link.insert((link, code, id), ())?;
            if let Some(file) = job.file() {
                self.received.insert((link, file), id)?;
            }
        }
        Ok(())
    }

    fn job(&self, id: JobId) -> Result<Option<Job>, redb::Error> {
        Ok(self.jobs.get(id.0)?.and_then(|value| decoded(value.value())))
    }

    fn oldest_ended(&self) -> Result<Option<u32>, redb::Error> {
        let mut oldest: Option<u32> = None;
        for state in STATES.into_iter().filter(|state| state.is_final()) {
            let code = code(state);
            if let Some(row) = self.by_state.range((code, 0)..=(code, u32::MAX))?.next() {
                let (_, id) = row?.0.value();
                oldest = Some(oldest.map_or(id, |other| other.min(id)));
            }
        }
        Ok(oldest)
    }

    fn remove(&mut self, id: JobId) -> Result<(), redb::Error> {
        let job = self.job(id)?;
        self.jobs.remove(id.0)?;
        self.stops.remove(id.0)?;
        let Some(job) = job else { return Ok(()) };
        let link = &*job.spec.link;
        self.by_state.remove((code(job.state), id.0))?;
        self.by_link.remove((link, code(job.state), id.0))?;
        if let Some(file) = job.file() {
            // A later one may have the name.
            let is_its = self.received.get((link, file))?.is_some_and(|of| of.value() == id.0);
            if is_its {
                self.received.remove((link, file))?;
            }
        }
        Ok(())
    }
}

/// Whether all jobs can be found by link and state.
pub(super) fn is_complete(reading: &ReadTransaction) -> Result<bool, redb::Error> {
    let count = reading.open_table(JOBS)?.len()?;
    match (reading.open_table(BY_STATE), reading.open_table(BY_LINK), reading.open_table(RECEIVED))
    {
        (Ok(by_state), Ok(by_link), Ok(_)) => {
            Ok(by_state.len()? == count && by_link.len()? == count)
        }
        (Err(TableError::TableDoesNotExist(_)), ..)
        | (_, Err(TableError::TableDoesNotExist(_)), _)
        | (.., Err(TableError::TableDoesNotExist(_))) => Ok(false),
        (Err(error), ..) | (_, Err(error), _) | (.., Err(error)) => Err(error.into()),
    }
}

pub(super) fn encoded(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain data with text keys is JSON")
}

pub(super) fn decoded<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    serde_json::from_slice(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_has_its_place_as_its_code() {
        for (place, state) in STATES.into_iter().enumerate() {
            assert_eq!(usize::from(code(state)), place);
        }
    }
}
