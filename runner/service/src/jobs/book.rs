//! Jobs and journal on the disk: what is in memory here is what is there.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use redb::{Database, ReadableDatabase, ReadableTable, ReadableTableMetadata, TableDefinition};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use softplug_gateway::store::sync_folder;

use super::ballast::Ballast;
use super::error::BookError;
use super::{Data, Entry, EntryFilter, Job, Keep, Note};

const JOBS: TableDefinition<u32, &[u8]> = TableDefinition::new("jobs");
const JOURNAL: TableDefinition<u64, &[u8]> = TableDefinition::new("journal");
/// What was sent last, by link and program.
const SENT: TableDefinition<(&str, &str), &[u8]> = TableDefinition::new("sent");
const NUMBERS: TableDefinition<&str, u64> = TableDefinition::new("numbers");
const NEXT_JOB: &str = "next-job";
const NEXT_ENTRY: &str = "next-entry";

/// Enough for the pages that are in use all the time.
const CACHE_BYTES: usize = 4 << 20;
/// The age of the oldest entries is looked at once in so many.
const LOOK_EVERY: u64 = 64;
const DAY: u64 = 24 * 60 * 60 * 1_000;

/// Where the database is; opened anew after an error.
pub(super) type Open = Box<dyn FnMut() -> Result<Database, redb::Error> + Send>;

/// What was sent last.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Sent {
    /// The job.
    pub job: u32,
    /// What it sent.
    #[serde(flatten)]
    pub data: Data,
}

/// What is written in one go, or not at all.
#[derive(Default)]
pub(super) struct Change {
    pub(super) jobs: Vec<Job>,
    pub(super) notes: Vec<Note>,
    /// Link, program and what was sent.
    pub(super) sent: Option<(String, String, Sent)>,
}

pub(super) struct Book {
    path: PathBuf,
    open: Open,
    /// None after an error, until the next use.
    database: Option<Database>,
    ballast: Option<Ballast>,
    keep: Keep,
    /// All jobs that have not ended.
    live: BTreeMap<u32, Job>,
    next_job: u32,
    next_entry: u64,
}

impl Book {
    /// Opens the database, or makes it.
    pub(super) fn open(
        path: &Path,
        open: Open,
        ballast: Option<Ballast>,
        keep: Keep,
    ) -> Result<Self, BookError> {
        let mut book = Self {
            path: path.to_owned(),
            open,
            database: None,
            ballast,
            keep,
            live: BTreeMap::new(),
            next_job: 1,
            next_entry: 1,
        };
        book.reopen().map_err(|error| book.blame(error))?;
        Ok(book)
    }

    pub(super) fn live(&self) -> &BTreeMap<u32, Job> {
        &self.live
    }

    /// The number that the next new job gets.
    pub(super) fn next_job(&self) -> u32 {
        self.next_job
    }

    /// Writes a change durably. After an error nothing of it counts, here or on the disk.
    pub(super) fn write(&mut self, change: &Change, now: u64) -> Result<(), BookError> {
        let mut written = self.try_to_write(change, now);
        let is_full =
            |error: &redb::Error| super::error::io_error(error).is_some_and(crate::disk::is_full);
        if written.as_ref().is_err_and(is_full)
            && self.ballast.as_ref().is_some_and(Ballast::drop_it)
        {
            tracing::error!(
                "the disk is full: the last reserve is used to write down what is under way"
            );
            self.database = None;
            written = self.try_to_write(change, now);
        }
        if let Err(error) = written {
            // What the disk says counts; if it says nothing, the next use asks again.
            self.database = None;
            let _ = self.reopen();
            return Err(self.blame(error));
        }
        for job in &change.jobs {
            if job.state.is_final() {
                self.live.remove(&job.id);
            } else {
                self.live.insert(job.id, job.clone());
            }
            self.next_job = self.next_job.max(job.id + 1);
        }
        self.next_entry += change.notes.len() as u64;
        Ok(())
    }

    /// Takes the reserve back in; an error means that the disk is still full.
    pub(super) fn load_ballast(&self) -> Result<(), crate::disk::DiskError> {
        self.ballast.as_ref().map_or(Ok(()), Ballast::load)
    }

    pub(super) fn job(&mut self, id: u32) -> Result<Option<Job>, BookError> {
        if let Some(job) = self.live.get(&id) {
            return Ok(Some(job.clone()));
        }
        self.read(|database| {
            let table = database.begin_read()?.open_table(JOBS)?;
            Ok(table.get(id)?.and_then(|value| decoded(value.value())))
        })
    }

    /// The newest first, of those for which `takes` says so, at most so many.
    pub(super) fn jobs(
        &mut self,
        most: usize,
        takes: impl Fn(&Job) -> bool,
    ) -> Result<Vec<Job>, BookError> {
        self.read(|database| {
            let table = database.begin_read()?.open_table(JOBS)?;
            let mut jobs = Vec::new();
            for row in table.iter()?.rev() {
                if jobs.len() >= most {
                    break;
                }
                jobs.extend(decoded(row?.1.value()).filter(&takes));
            }
            Ok(jobs)
        })
    }

    /// The newest first.
    pub(super) fn entries(&mut self, filter: &EntryFilter) -> Result<Vec<Entry>, BookError> {
        self.read(|database| {
            let table = database.begin_read()?.open_table(JOURNAL)?;
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
        })
    }

    pub(super) fn sent(&mut self, link: &str, program: &str) -> Result<Option<Sent>, BookError> {
        self.read(|database| {
            let table = database.begin_read()?.open_table(SENT)?;
            Ok(table.get((link, program))?.and_then(|value| decoded(value.value())))
        })
    }

    /// All snapshots that a job or a comparison may need.
    pub(super) fn data(&mut self) -> Result<Vec<Data>, BookError> {
        self.read(|database| {
            let reading = database.begin_read()?;
            let mut data = Vec::new();
            for row in reading.open_table(SENT)?.iter()? {
                data.extend(decoded::<Sent>(row?.1.value()).map(|sent| sent.data));
            }
            for row in reading.open_table(JOBS)?.iter()? {
                data.extend(decoded::<Job>(row?.1.value()).and_then(|job| job.order.data));
            }
            Ok(data)
        })
    }

    fn read<T>(
        &mut self,
        read: impl FnOnce(&Database) -> Result<T, redb::Error>,
    ) -> Result<T, BookError> {
        let read = self.database().and_then(read);
        read.map_err(|error| {
            self.database = None;
            self.blame(error)
        })
    }

    fn try_to_write(&mut self, change: &Change, now: u64) -> Result<(), redb::Error> {
        // First: it may bring the numbers up to date.
        self.database()?;
        let (first_new, keep, live) = (self.next_entry, self.keep, self.live.len());
        let next_job = change.jobs.iter().map(|job| job.id + 1).fold(self.next_job, u32::max);
        let writing = self.database()?.begin_write()?;
        {
            let mut jobs = writing.open_table(JOBS)?;
            for job in &change.jobs {
                jobs.insert(job.id, &*encoded(job))?;
            }
            if change.jobs.iter().any(|job| job.state.is_final()) {
                // Those that have not ended do not count.
                prune_jobs(&mut jobs, keep.jobs + live)?;
            }
            if let Some((link, program, sent)) = &change.sent {
                writing.open_table(SENT)?.insert((&**link, &**program), &*encoded(sent))?;
            }
            let mut journal = writing.open_table(JOURNAL)?;
            for (number, note) in (first_new..).zip(&change.notes) {
                let entry = Entry { number, time: now, note: note.clone() };
                journal.insert(number, &*encoded(&entry))?;
            }
            let next_entry = first_new + change.notes.len() as u64;
            if !change.notes.is_empty() {
                prune_journal(&mut journal, next_entry, keep, now)?;
            }
            let mut numbers = writing.open_table(NUMBERS)?;
            numbers.insert(NEXT_JOB, u64::from(next_job))?;
            numbers.insert(NEXT_ENTRY, next_entry)?;
        }
        Ok(writing.commit()?)
    }

    fn database(&mut self) -> Result<&Database, redb::Error> {
        if self.database.is_none() {
            self.reopen()?;
        }
        // Just opened; the borrow checker wants it said again.
        self.database.as_ref().ok_or(redb::Error::DatabaseClosed)
    }

    /// Takes over what the disk says.
    fn reopen(&mut self) -> Result<(), redb::Error> {
        let database = (self.open)()?;
        // A full disk must not keep a database from being read that is there already.
        if let Err(redb::TableError::TableDoesNotExist(_)) =
            database.begin_read()?.open_table(NUMBERS)
        {
            let writing = database.begin_write()?;
            writing.open_table(JOBS)?;
            writing.open_table(JOURNAL)?;
            writing.open_table(SENT)?;
            writing.open_table(NUMBERS)?;
            writing.commit()?;
        }
        let reading = database.begin_read()?;
        let mut live = BTreeMap::new();
        for row in reading.open_table(JOBS)?.iter()? {
            let (id, value) = row?;
            match decoded::<Job>(value.value()) {
                Some(job) if job.state.is_final() => {}
                Some(job) => drop(live.insert(id.value(), job)),
                None => {
                    tracing::error!(job = id.value(), "this job cannot be read, it is left out");
                }
            }
        }
        let numbers = reading.open_table(NUMBERS)?;
        let number =
            |name| Ok::<_, redb::Error>(numbers.get(name)?.map_or(1, |value| value.value()));
        self.next_job = number(NEXT_JOB)? as u32;
        self.next_entry = number(NEXT_ENTRY)?;
        self.live = live;
        self.database = Some(database);
        Ok(())
    }

    fn blame(&self, error: redb::Error) -> BookError {
        BookError { path: self.path.clone(), source: Box::new(error) }
    }
}

/// The database in a file.
pub(super) fn in_file(path: PathBuf) -> Open {
    Box::new(move || {
        if !path.exists() {
            make_file(&path)?;
        }
        Ok(builder().create(&path)?)
    })
}

fn builder() -> redb::Builder {
    let mut builder = redb::Builder::new();
    builder.set_cache_size(CACHE_BYTES);
    builder
}

/// A new database gets its name when it is whole: one that is killed while it is being made could
/// never be opened again.
fn make_file(path: &Path) -> Result<(), redb::Error> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let lock = File::create(folder.join(".lock"))?;
    lock.lock()?;
    if path.exists() {
        return Ok(());
    }
    let new = path.with_extension("new");
    if new.exists() {
        fs::remove_file(&new)?;
    }
    builder().create(&new)?.close()?;
    File::open(&new)?.sync_all()?;
    fs::rename(&new, path)?;
    Ok(sync_folder(folder)?)
}

type Table<'txn, K> = redb::Table<'txn, K, &'static [u8]>;

/// The oldest that have ended go, a tenth at a time.
fn prune_jobs(jobs: &mut Table<'_, u32>, keep: usize) -> Result<(), redb::Error> {
    let count = jobs.len()? as usize;
    if count <= keep + keep / 10 {
        return Ok(());
    }
    let mut old = Vec::new();
    for row in jobs.iter()? {
        if old.len() + keep >= count {
            break;
        }
        let (id, value) = row?;
        let is_final = |job: &Job| job.state.is_final();
        if decoded::<Job>(value.value()).as_ref().is_none_or(is_final) {
            old.push(id.value());
        }
    }
    for id in old {
        jobs.remove(id)?;
    }
    Ok(())
}

/// What is too much goes at once; what is too old is looked for now and then.
fn prune_journal(
    journal: &mut Table<'_, u64>,
    next: u64,
    keep: Keep,
    now: u64,
) -> Result<(), redb::Error> {
    let oldest = now.saturating_sub(keep.days.saturating_mul(DAY));
    let looks_at_age = next.is_multiple_of(LOOK_EVERY);
    loop {
        let Some((number, is_old)) = journal.first()?.map(|(number, value)| {
            let is_old = || decoded::<Entry>(value.value()).is_none_or(|entry| entry.time < oldest);
            (number.value(), looks_at_age && is_old())
        }) else {
            return Ok(());
        };
        if next - number <= keep.entries.max(1) && !is_old {
            return Ok(());
        }
        journal.remove(number)?;
    }
}

fn encoded(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain data with text keys is JSON")
}

fn decoded<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    serde_json::from_slice(bytes).ok()
}
