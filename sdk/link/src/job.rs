//! The job under way.

use softplug_abi::{Pass, limits};

/// A job to begin.
#[derive(Clone, Debug)]
pub struct Job {
    /// Its id, not 0 and not used before on this link.
    pub id: u32,
    /// Place of its kind in the manifest.
    pub kind: u16,
    /// Bytes of data, if known.
    pub size: Option<u64>,
    /// Its fields as value records.
    pub fields: Vec<u8>,
    /// Feed the data once as a check before carrying the job out.
    pub check: bool,
}

/// A job that the plug-in knows of.
#[derive(Clone, Debug)]
pub(crate) struct ActiveJob {
    pub(crate) job: Job,
    pub(crate) pass: Pass,
    /// The check was good: begin it for good.
    pub(crate) run_next: bool,
    /// Bytes asked for and not yet given.
    wanted: u64,
    data_ended: bool,
}

impl ActiveJob {
    pub(crate) fn new(job: Job) -> Self {
        let pass = if job.check { Pass::Check } else { Pass::Run };
        Self { job, pass, run_next: false, wanted: 0, data_ended: false }
    }

    /// From the check to the run.
    pub(crate) fn start_run(&mut self) {
        self.pass = Pass::Run;
        self.run_next = false;
        self.wanted = 0;
        self.data_ended = false;
    }

    pub(crate) fn want(&mut self, bytes: u32) {
        self.wanted = self.wanted.saturating_add(u64::from(bytes));
    }

    /// How many bytes may be given in one event; `None` if none were asked for.
    pub(crate) fn hungry(&self, input_capacity: usize) -> Option<usize> {
        if self.wanted == 0 || self.data_ended || self.run_next {
            return None;
        }
        let capacity = (input_capacity - 4).min(limits::RECORD_BYTES);
        Some(usize::try_from(self.wanted).unwrap_or(capacity).min(capacity))
    }

    pub(crate) fn given(&mut self, bytes: usize) {
        self.wanted = self.wanted.saturating_sub(bytes as u64);
    }

    pub(crate) fn end_data(&mut self) {
        self.data_ended = true;
    }
}
