//! What is known of jobs, and the journal: read from a state of the database that stands
//! still, beside whoever writes.
//!
//! There is nothing here by which a reader could keep a writer waiting: no turn, no lock but a
//! shared one, which is taken alone only while a database is opened anew after an error.

use softplug_abi::{DeliveryId, JobId};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock};

use redb::{Database, ReadTransaction, ReadableDatabase, ReadableTable, TableError};
use softplug_cell::Stop;
use softplug_host::Digest;
use softplug_live::units::StoredDelivery;

use super::error::StoreError;
use super::tables::{
    BY_LINK, BY_STATE, CELLS, JOBS, JOURNAL, RECEIVED, SENT, STATES, STOPS, Sent, UNIT_DELIVERIES,
    code, decoded,
};
use super::{Data, Entry, EntryFilter, Job, JobFilter, JobsError, plain_name};

/// The database while it is open.
pub(super) struct Opened {
    pub(super) path: PathBuf,
    database: RwLock<Option<Database>>,
}

impl Opened {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, database: RwLock::new(None) }
    }

    pub(super) fn is_open(&self) -> bool {
        self.database.read().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Another one, or none after an error.
    pub(super) fn set(&self, database: Option<Database>) {
        *self.database.write().unwrap_or_else(PoisonError::into_inner) = database;
    }

    pub(super) fn with<T>(
        &self,
        act: impl FnOnce(&Database) -> Result<T, redb::Error>,
    ) -> Result<T, redb::Error> {
        let database = self.database.read().unwrap_or_else(PoisonError::into_inner);
        act(database.as_ref().ok_or(redb::Error::DatabaseClosed)?)
    }

    pub(super) fn blame(&self, error: redb::Error) -> StoreError {
        StoreError { path: self.path.clone(), source: Box::new(error) }
    }

    /// As it is now, whatever is written from here on.
    pub(super) fn snapshot(&self) -> Result<ReadTransaction, redb::Error> {
        self.with(|database| Ok(database.begin_read()?))
    }

    pub(super) fn job(&self, id: JobId) -> Result<Option<Job>, redb::Error> {
        let table = self.snapshot()?.open_table(JOBS)?;
        Ok(table.get(id.0)?.and_then(|value| decoded(value.value())))
    }
}

/// Reads jobs and journal, and cannot do anything else. Clones are the same.
#[derive(Clone)]
pub struct JobsReader {
    pub(super) opened: Arc<Opened>,
}

impl JobsReader {
    /// A job, also one that has ended.
    ///
    /// # Errors
    /// There is none, or the database cannot be read.
    pub fn job(&self, id: JobId) -> Result<Job, JobsError> {
        self.tell(self.opened.job(id))?.ok_or(JobsError::NotFound(id))
    }

    /// Jobs, the newest first. What is left out is not read.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn list(&self, filter: &JobFilter) -> Result<Vec<Job>, JobsError> {
        self.tell(self.page(filter))
    }

    /// Entries of the journal, the newest first.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn journal(&self, filter: &EntryFilter) -> Result<Vec<Entry>, JobsError> {
        let page = || {
            let table = self.opened.snapshot()?.open_table(JOURNAL)?;
            let mut entries = Vec::new();
            for row in table.range(..filter.before.unwrap_or(u64::MAX))?.rev() {
                if entries.len() >= filter.most {
                    break;
                }
                let (number, value) = row?;
                let entry = decoded::<Entry>(value.value());
                let entry = entry.map(|entry| Entry { number: number.value(), ..entry });
                entries.extend(entry.filter(|entry| filter.takes(entry)));
            }
            Ok(entries)
        };
        self.tell(page())
    }

    /// The last delivery that is stored of what came from a unit by this port.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn stored_delivery(&self, port: &str) -> Result<Option<StoredDelivery>, JobsError> {
        let look = || {
            let table = match self.opened.snapshot()?.open_table(UNIT_DELIVERIES) {
                Ok(table) => table,
                Err(TableError::TableDoesNotExist(_)) => return Ok(None),
                Err(error) => return Err(error.into()),
            };
            let found = table.get(port)?.map(|found| found.value());
            Ok(found
                .map(|(unit, delivery)| StoredDelivery { unit, delivery: DeliveryId(delivery) }))
        };
        self.tell(look())
    }

    /// The cells that there were, each as it was left, encoded; nothing of one that has another name now.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(crate) fn cells(&self) -> Result<BTreeMap<String, Vec<u8>>, JobsError> {
        let look = || {
            let table = match self.opened.snapshot()?.open_table(CELLS) {
                Ok(table) => table,
                Err(TableError::TableDoesNotExist(_)) => return Ok(BTreeMap::new()),
                Err(error) => return Err(error.into()),
            };
            let mut cells = BTreeMap::new();
            for row in table.iter()? {
                let (name, saved) = row?;
                if !saved.value().is_empty() {
                    cells.insert(name.value().to_owned(), saved.value().to_vec());
                }
            }
            Ok(cells)
        };
        self.tell(look())
    }

    /// Where the feed of a job stops.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn stops(&self, id: JobId) -> Result<Vec<Stop>, JobsError> {
        let look = || match self.opened.snapshot()?.open_table(STOPS) {
            Ok(table) => Ok(table.get(id.0)?.and_then(|value| decoded(value.value()))),
            Err(TableError::TableDoesNotExist(_)) => Ok(None),
            Err(error) => Err(error.into()),
        };
        Ok(self.tell(look())?.unwrap_or_default())
    }

    /// What was sent last to a link under this name, as a whole.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn last_sent(&self, link: &str, program: &str) -> Result<Option<Sent>, JobsError> {
        let look = || {
            let table = self.opened.snapshot()?.open_table(SENT)?;
            let row = table.get((link, plain_name(program)))?;
            Ok(row.and_then(|value| decoded(value.value())))
        };
        self.tell(look())
    }

    /// The jobs that these of a link's receptions belong to, by file.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn of_receptions<'a>(
        &self,
        link: &str,
        files: impl IntoIterator<Item = &'a str>,
    ) -> Result<BTreeMap<&'a str, Job>, JobsError> {
        let look = || {
            let snapshot = self.opened.snapshot()?;
            let (received, jobs) = (snapshot.open_table(RECEIVED)?, snapshot.open_table(JOBS)?);
            let mut found = BTreeMap::new();
            for file in files {
                let Some(id) = received.get((link, file))? else { continue };
                let job = jobs.get(id.value())?.and_then(|value| decoded(value.value()));
                found.extend(job.map(|job| (file, job)));
            }
            Ok(found)
        };
        self.tell(look())
    }

    /// The snapshots that a job or a comparison may need yet.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn needed_data(&self) -> Result<BTreeSet<Digest>, JobsError> {
        let look = || {
            let snapshot = self.opened.snapshot()?;
            let mut needed = BTreeSet::new();
            for row in snapshot.open_table(SENT)?.iter()? {
                needed.extend(decoded::<Sent>(row?.1.value()).map(|sent| sent.data.digest));
            }
            for row in snapshot.open_table(JOBS)?.iter()? {
                let data = |job: Job| job.spec.data.map(|data: Data| data.digest);
                needed.extend(decoded::<Job>(row?.1.value()).and_then(data));
            }
            Ok(needed)
        };
        self.tell(look())
    }

    /// Jobs that have begun and ended: the newest of each link, and all that nobody has
    /// acknowledged, the oldest first. Reads them all: for the start.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn results(&self) -> Result<Vec<Job>, JobsError> {
        let look = || {
            let (mut results, mut links) = (Vec::new(), BTreeSet::new());
            for row in self.opened.snapshot()?.open_table(JOBS)?.iter()?.rev() {
                let Some(job) = decoded::<Job>(row?.1.value()) else { continue };
                let has_ended = job.state.is_final() && job.has_begun();
                if has_ended && (links.insert(job.spec.link.clone()) || job.is_unseen) {
                    results.push(job);
                }
            }
            results.reverse();
            Ok(results)
        };
        self.tell(look())
    }

    pub(super) fn tell<T>(&self, read: Result<T, redb::Error>) -> Result<T, JobsError> {
        read.map_err(|error| self.opened.blame(error).into())
    }

    fn page(&self, filter: &JobFilter) -> Result<Vec<Job>, redb::Error> {
        let snapshot = self.opened.snapshot()?;
        let before = filter.before.unwrap_or(u32::MAX);
        let jobs = snapshot.open_table(JOBS)?;
        let states = filter.state.map_or(STATES.to_vec(), |state| vec![state]);
        // Of a page that is chosen by more than link and state, any may be left out.
        let most_ids = if filter.looks_into() { usize::MAX } else { filter.most };
        let mut ids = Vec::new();
        match &filter.link {
            None if filter.state.is_none() => {
                let rows = jobs.range(..before)?.rev().take(most_ids);
                let job = |row: Result<(_, redb::AccessGuard<'_, &[u8]>), _>| match row {
                    Ok((_, value)) => decoded(value.value()).map(Ok),
                    Err(error) => Some(Err(redb::Error::from(error))),
                };
                let is_asked = |job: &Result<Job, _>| match job {
                    Ok(job) => filter.takes(job),
                    Err(_) => true,
                };
                return rows.filter_map(job).filter(is_asked).take(filter.most).collect();
            }
            None => {
                let table = snapshot.open_table(BY_STATE)?;
                for code in states.into_iter().map(code) {
                    let rows = table.range((code, 0)..(code, before))?.rev();
                    for row in rows.take(most_ids) {
                        ids.push(row?.0.value().1);
                    }
                }
            }
            Some(link) => {
                let table = snapshot.open_table(BY_LINK)?;
                let link = link.as_str();
                for code in states.into_iter().map(code) {
                    let rows = table.range((link, code, 0)..(link, code, before))?.rev();
                    for row in rows.take(most_ids) {
                        ids.push(row?.0.value().2);
                    }
                }
            }
        }
        // At most a page of each state.
        ids.sort_unstable_by(|one, other| other.cmp(one));
        ids.truncate(most_ids);
        let mut found = Vec::with_capacity(ids.len().min(filter.most));
        for id in ids {
            if found.len() >= filter.most {
                break;
            }
            let job = jobs.get(id)?.and_then(|value| decoded::<Job>(value.value()));
            found.extend(job.filter(|job| filter.takes(job)));
        }
        Ok(found)
    }
}

impl std::fmt::Debug for JobsReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JobsReader").finish_non_exhaustive()
    }
}
