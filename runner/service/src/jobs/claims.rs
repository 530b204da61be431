//! Files of drop folders that became jobs: a file never becomes two.
//!
//! A file is claimed first, by a move into a folder of its own whose name is the claim. The claim is
//! written down with the job, in one change, and forgotten when the file has been put away.

use softplug_abi::JobId;
use std::fs::File;
use std::io::Read as _;

use redb::TableError;
use softplug_cell::Stop;

use super::store::{Change, OWNER};
use super::tables::{CLAIMS, DROP_FOLDERS, NUMBERS};
use super::turns::Who;
use super::{Job, JobSpec, Jobs, JobsError, JobsReader, StoreError, now};

/// A file that was taken from a drop folder.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Claim {
    /// What it is known by; never given twice.
    pub name: String,
    /// Bytes of the file.
    pub size: u64,
}

/// What became of a claim.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Claimed {
    /// The job.
    pub job: JobId,
    /// Bytes of the file when it was taken.
    pub size: u64,
}

impl Jobs {
    /// Takes a job into the queue of its link, for this claim: once, however often it is said.
    ///
    /// # Errors
    /// It cannot be written down, or too many wait. It is not taken then.
    ///
    /// # Examples
    /// ```
    /// # let folder = tempfile::tempdir()?;
    /// use softplug_service::jobs::{Claim, Jobs, JobSpec, Keep, Kind};
    ///
    /// let (jobs, _) = Jobs::open(folder.path(), Keep::default())?;
    /// let claim = Claim { name: "a file".to_owned(), size: 7 };
    /// let order = || JobSpec::new("lathe", Kind::Fetch, "read");
    /// let job = jobs.submit_claimed(order(), Vec::new(), &claim)?;
    /// assert_eq!(jobs.submit_claimed(order(), Vec::new(), &claim)?.id, job.id);
    /// assert_eq!(jobs.reader().claimed("a file")?.map(|claimed| claimed.job), Some(job.id));
    /// jobs.settle("a file")?;
    /// assert_eq!(jobs.reader().claimed("a file")?, None);
    /// # Ok::<_, Box<dyn std::error::Error>>(())
    /// ```
    pub fn submit_claimed(
        &self,
        spec: JobSpec,
        stops: Vec<Stop>,
        claim: &Claim,
    ) -> Result<Job, JobsError> {
        let mut store = self.store.take(Who::Other);
        if let Some(claimed) = self.reader.claimed(&claim.name)? {
            return self.reader.job(claimed.job);
        }
        Self::submit_as(&mut store, spec, stops, Some(claim))
    }

    /// The file of a claim has been put away: nothing is left to be known of it.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn settle(&self, claim: &str) -> Result<(), JobsError> {
        let claimed = Some((claim.to_owned(), None));
        let change = Change { claimed, ..Change::default() };
        Ok(self.store.take(Who::Other).write(&change, now())?)
    }

    /// A folder is looked after from now on: what stands in its place without its mark is another.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn know_drop_folder(&self, folder: &str) -> Result<(), JobsError> {
        let change = Change { drop_folder: Some(folder.to_owned()), ..Change::default() };
        Ok(self.store.take(Who::Other).write(&change, now())?)
    }

    /// A number by which a drop folder knows whose it is: that of these jobs, and of no others.
    ///
    /// # Errors
    /// It cannot be read, or, the first time, not be made and written down.
    pub fn owner(&self) -> Result<u64, JobsError> {
        let mut store = self.store.take(Who::Other);
        if let Some(owner) = self.reader.owner()? {
            return Ok(owner);
        }
        let mut random = [0; 8];
        let read = File::open("/dev/urandom").and_then(|mut from| from.read_exact(&mut random));
        read.map_err(|error| StoreError {
            path: "/dev/urandom".into(),
            source: Box::new(redb::Error::Io(error)),
        })?;
        let owner = u64::from_le_bytes(random);
        store.write(&Change { owner: Some(owner), ..Change::default() }, now())?;
        Ok(owner)
    }
}

impl JobsReader {
    /// The job that was made of a claim.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn claimed(&self, claim: &str) -> Result<Option<Claimed>, JobsError> {
        let look = || match self.opened.snapshot()?.open_table(CLAIMS) {
            Ok(table) => Ok(table.get(claim)?.map(|row| {
                let (job, size) = row.value();
                Claimed { job: JobId(job), size }
            })),
            Err(TableError::TableDoesNotExist(_)) => Ok(None),
            Err(error) => Err(error.into()),
        };
        self.tell(look())
    }

    /// Whether a folder was looked after before.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn knows_drop_folder(&self, folder: &str) -> Result<bool, JobsError> {
        let look = || match self.opened.snapshot()?.open_table(DROP_FOLDERS) {
            Ok(table) => Ok(table.get(folder)?.is_some()),
            Err(TableError::TableDoesNotExist(_)) => Ok(false),
            Err(error) => Err(error.into()),
        };
        self.tell(look())
    }

    fn owner(&self) -> Result<Option<u64>, JobsError> {
        let look = || {
            Ok(self.opened.snapshot()?.open_table(NUMBERS)?.get(OWNER)?.map(|owner| owner.value()))
        };
        self.tell(look())
    }
}
