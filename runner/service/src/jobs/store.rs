//! Jobs and journal on the disk: what is in memory here is what is there.

use softplug_abi::JobId;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use redb::{Database, ReadableDatabase, ReadableTable};
use softplug_cell::Stop;
use softplug_live::store::sync_folder;

use super::ballast::Ballast;
use super::error::StoreError;
use super::reading::{JobsReader, Opened};
use super::tables::{
    CELLS, CLAIMS, DROP_FOLDERS, JOBS, JOURNAL, JobTables, NUMBERS, SENT, Sent, TODAY,
    UNIT_DELIVERIES, decoded, encoded,
};
use super::{Entry, FromUnit, Job, Keep, Note};
use crate::programs::Today;
use crate::view::DAY;

const NEXT_JOB: &str = "next-job";
const NEXT_ENTRY: &str = "next-entry";
pub(super) const OWNER: &str = "owner";

/// Enough for the pages that are in use all the time.
const CACHE_BYTES: usize = 4 << 20;
/// The age of the oldest entries is looked at once in so many.
const LOOK_EVERY: u64 = 64;
/// Entries that go with one change at most: a change must not take long.
const PRUNED_AT_ONCE: usize = 2 * LOOK_EVERY as usize;

/// Where the database is; opened anew after an error.
pub(super) type Open = Box<dyn FnMut() -> Result<Database, redb::Error> + Send>;

/// What is written in one go, or not at all.
#[derive(Default)]
pub(super) struct Change {
    pub(super) jobs: Vec<Job>,
    pub(super) notes: Vec<Note>,
    /// Link, program and what was sent.
    pub(super) sent: Vec<(String, String, Sent)>,
    /// Link, receptions that began and bytes of those that ended.
    pub(super) came: Option<(String, u64, u64)>,
    /// A delivery of a unit that is stored, and with it all that came from there before.
    pub(super) stored: Option<FromUnit>,
    /// A cell as it is now, encoded.
    pub(super) cell: Option<(String, Vec<u8>)>,
    /// Where the feeds of these jobs stop.
    pub(super) stops: Vec<(JobId, Vec<Stop>)>,
    /// A claim with its job and the bytes of its file; none: it is settled, and forgotten.
    pub(super) claimed: Option<(String, Option<(JobId, u64)>)>,
    /// A drop folder that is looked after from now on.
    pub(super) drop_folder: Option<String>,
    /// Who has these jobs, as drop folders know it.
    pub(super) owner: Option<u64>,
}

/// What everybody may look at without a turn: locked for as long as memory takes, never while
/// something is written.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// All jobs that have not ended.
    pub(super) live: BTreeMap<JobId, Job>,
    today: BTreeMap<String, Today>,
}

impl Known {
    /// What a link has received today.
    pub(super) fn today(&self, link: &str, now: u64) -> Today {
        self.today.get(link).copied().unwrap_or_default().at(now)
    }
}

pub(super) struct JobStore {
    opened: Arc<Opened>,
    open: Open,
    ballast: Option<Ballast>,
    keep: Keep,
    known: Arc<RwLock<Known>>,
    next_job: u32,
    next_entry: u64,
}

impl JobStore {
    /// Opens the database, or makes it.
    pub(super) fn open(
        path: &Path,
        open: Open,
        ballast: Option<Ballast>,
        keep: Keep,
    ) -> Result<Self, StoreError> {
        let mut store = Self {
            opened: Arc::new(Opened::new(path.to_owned())),
            open,
            ballast,
            keep,
            known: Arc::default(),
            next_job: 1,
            next_entry: 1,
        };
        store.reopen().map_err(|error| store.opened.blame(error))?;
        Ok(store)
    }

    pub(super) fn reader(&self) -> JobsReader {
        JobsReader { opened: Arc::clone(&self.opened) }
    }

    pub(super) fn shared(&self) -> Arc<RwLock<Known>> {
        Arc::clone(&self.known)
    }

    pub(super) fn known(&self) -> RwLockReadGuard<'_, Known> {
        look(&self.known)
    }

    /// The number that the next new job gets.
    pub(super) fn next_job(&self) -> u32 {
        self.next_job
    }

    /// Writes a change durably. After an error nothing of it counts, here or on the disk.
    pub(super) fn write(&mut self, change: &Change, now: u64) -> Result<(), StoreError> {
        let mut written = self.try_to_write(change, now);
        let is_full =
            |error: &redb::Error| super::error::io_error(error).is_some_and(crate::disk::is_full);
        if written.as_ref().is_err_and(is_full)
            && self.ballast.as_ref().is_some_and(Ballast::drop_it)
        {
            tracing::error!(
                "the disk is full: the last reserve is used to write down what is under way"
            );
            self.opened.set(None);
            written = self.try_to_write(change, now);
        }
        if let Err(error) = written {
            // What the disk says counts; if it says nothing, the next use asks again.
            self.opened.set(None);
            let _ = self.reopen();
            return Err(self.opened.blame(error));
        }
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        for job in &change.jobs {
            if job.state.is_final() {
                known.live.remove(&job.id);
            } else {
                known.live.insert(job.id, job.clone());
            }
            self.next_job = self.next_job.max(job.id.0 + 1);
        }
        if let Some((link, today)) = today_after(&known, change, now) {
            known.today.insert(link.to_owned(), today);
        }
        self.next_entry += change.notes.len() as u64;
        Ok(())
    }

    /// Takes the reserve back in; an error means that the disk is still full.
    pub(super) fn load_ballast(&self) -> Result<(), crate::disk::DiskError> {
        self.ballast.as_ref().map_or(Ok(()), Ballast::load)
    }

    /// A job, also one that has ended.
    pub(super) fn job(&self, id: JobId) -> Result<Option<Job>, StoreError> {
        if let Some(job) = self.known().live.get(&id) {
            return Ok(Some(job.clone()));
        }
        self.opened.job(id).map_err(|error| self.opened.blame(error))
    }

    fn try_to_write(&mut self, change: &Change, now: u64) -> Result<(), redb::Error> {
        // First: it may bring the numbers up to date.
        if !self.opened.is_open() {
            self.reopen()?;
        }
        let (first_new, keep) = (self.next_entry, self.keep);
        let next_job = change.jobs.iter().map(|job| job.id.0 + 1).fold(self.next_job, u32::max);
        self.opened.with(|database| {
            let writing = database.begin_write()?;
            {
                let mut jobs = JobTables::open(&writing)?;
                let known = |id: JobId| self.known().live.get(&id).map(|job| job.state);
                for job in &change.jobs {
                    jobs.put(job, known(job.id))?;
                }
                for (id, stops) in &change.stops {
                    jobs.put_stops(*id, stops)?;
                }
                if let Some(FromUnit { port, said }) = &change.stored {
                    let row = (said.unit, said.delivery.0);
                    writing.open_table(UNIT_DELIVERIES)?.insert(&**port, row)?;
                }
                if let Some((name, cell)) = &change.cell {
                    writing.open_table(CELLS)?.insert(&**name, &**cell)?;
                }
                if change.jobs.iter().any(|job| job.state.is_final()) {
                    // Those that have not ended do not count.
                    let live = self.known().live.len();
                    jobs.prune(keep.jobs + live)?;
                }
                for (link, program, sent) in &change.sent {
                    let mut table = writing.open_table(SENT)?;
                    table.insert((&**link, &**program), &*encoded(sent))?;
                }
                let today = today_after(&self.known(), change, now);
                if let Some((link, Today { day, receptions, bytes })) = today {
                    writing.open_table(TODAY)?.insert(link, (day, receptions, bytes))?;
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
                if let Some((claim, job)) = &change.claimed {
                    let mut claims = writing.open_table(CLAIMS)?;
                    match job {
                        Some(job) => drop(claims.insert(&**claim, (job.0.0, job.1))?),
                        None => drop(claims.remove(&**claim)?),
                    }
                }
                if let Some(folder) = &change.drop_folder {
                    writing.open_table(DROP_FOLDERS)?.insert(&**folder, ())?;
                }
                let mut numbers = writing.open_table(NUMBERS)?;
                if let Some(owner) = change.owner {
                    numbers.insert(OWNER, owner)?;
                }
                numbers.insert(NEXT_JOB, u64::from(next_job))?;
                numbers.insert(NEXT_ENTRY, next_entry)?;
            }
            Ok(writing.commit()?)
        })
    }

    /// Takes over what the disk says.
    fn reopen(&mut self) -> Result<(), redb::Error> {
        let database = (self.open)()?;
        // A full disk must not keep a database from being read that is there already.
        if lacks_tables(&database)? {
            let writing = database.begin_write()?;
            JobTables::open(&writing)?.complete()?;
            writing.open_table(JOURNAL)?;
            writing.open_table(SENT)?;
            writing.open_table(NUMBERS)?;
            writing.open_table(TODAY)?;
            writing.commit()?;
        }
        let reading = database.begin_read()?;
        let mut known = Known::default();
        for row in reading.open_table(JOBS)?.iter()? {
            let (id, value) = row?;
            match decoded::<Job>(value.value()) {
                Some(job) if job.state.is_final() => {}
                Some(job) => drop(known.live.insert(JobId(id.value()), job)),
                None => {
                    tracing::error!(job = id.value(), "this job cannot be read, it is left out");
                }
            }
        }
        for row in reading.open_table(TODAY)?.iter()? {
            let (link, value) = row?;
            let (day, receptions, bytes) = value.value();
            known.today.insert(link.value().to_owned(), Today { day, receptions, bytes });
        }
        let numbers = reading.open_table(NUMBERS)?;
        let number =
            |name| Ok::<_, redb::Error>(numbers.get(name)?.map_or(1, |value| value.value()));
        self.next_job = number(NEXT_JOB)? as u32;
        self.next_entry = number(NEXT_ENTRY)?;
        *self.known.write().unwrap_or_else(PoisonError::into_inner) = known;
        drop(reading);
        self.opened.set(Some(database));
        Ok(())
    }
}

/// What everybody may look at.
pub(super) fn look(known: &RwLock<Known>) -> RwLockReadGuard<'_, Known> {
    known.read().unwrap_or_else(PoisonError::into_inner)
}

/// What a link has received today when this is written.
fn today_after<'a>(known: &Known, change: &'a Change, now: u64) -> Option<(&'a str, Today)> {
    let (link, receptions, bytes) = change.came.as_ref()?;
    let mut today = known.today(link, now);
    today.receptions += receptions;
    today.bytes += bytes;
    Some((link, today))
}

/// It is new, or from a gateway that knew less.
fn lacks_tables(database: &Database) -> Result<bool, redb::Error> {
    let reading = database.begin_read()?;
    match (reading.open_table(NUMBERS), reading.open_table(TODAY)) {
        (Ok(_), Ok(_)) => Ok(!super::tables::is_complete(&reading)?),
        (Err(redb::TableError::TableDoesNotExist(_)), _)
        | (_, Err(redb::TableError::TableDoesNotExist(_))) => Ok(true),
        (Err(error), _) | (_, Err(error)) => Err(error.into()),
    }
}

/// The database in a file.
pub(super) fn in_file(path: PathBuf) -> Open {
    Box::new(move || {
        match fs::metadata(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => make_file(&path)?,
            Err(error) => return Err(error.into()),
            Ok(file) if !file.is_file() => return Err(not_ours("it is no file")),
            // No gateway leaves one behind: it is made whole before it gets its name.
            Ok(file) if file.len() == 0 => return Err(not_ours("the file is empty")),
            Ok(_) => {}
        }
        Ok(builder().open(&path)?)
    })
}

fn not_ours(what: &str) -> redb::Error {
    redb::Error::Io(io::Error::new(
        io::ErrorKind::InvalidData,
        format!(
            "{what}; put a copy of it in its place, or move it away to begin without jobs and journal"
        ),
    ))
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

/// What is too much goes, a few at a time; what is too old is looked for now and then.
fn prune_journal(
    journal: &mut Table<'_, u64>,
    next: u64,
    keep: Keep,
    now: u64,
) -> Result<(), redb::Error> {
    let oldest = now.saturating_sub(keep.days.saturating_mul(DAY));
    let looks_at_age = next.is_multiple_of(LOOK_EVERY);
    for _ in 0..PRUNED_AT_ONCE {
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
    Ok(())
}
