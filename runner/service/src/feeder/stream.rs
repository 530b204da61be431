//! A job's data from a connection instead of a file. Who writes waits as long as the machine
//! does, so that the source is held back too.

use softplug_abi::JobId;
use std::io::{self, Write};
use std::sync::Arc;
use std::task::{Wake, Waker};
use std::thread::{self, Thread};
use std::time::Duration;

use softplug_live::reservoir::ReservoirWriter;

use crate::jobs::{Advance, Jobs};

/// A wake-up that was lost is made up for after this.
const LOOK: Duration = Duration::from_millis(250);

/// Takes a job's data. Belongs to one thread, which may block.
#[derive(Debug)]
pub struct Stream {
    jobs: Jobs,
    job: JobId,
    to: ReservoirWriter,
    at: u64,
    granted: u64,
}

impl Stream {
    /// For a job that has begun.
    pub fn new(jobs: Jobs, job: JobId, to: ReservoirWriter) -> Self {
        Self { jobs, job, to, at: 0, granted: 0 }
    }

    /// That was all. A stream that is dropped without it has failed, and so has the job.
    pub fn finish(mut self) {
        self.to.finish();
    }

    /// The source has failed.
    pub fn fail(mut self, why: impl Into<String>) {
        self.to.fail(why);
    }
}

impl Write for Stream {
    /// Waits until there is room for some of it.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let mut is_told = false;
        loop {
            if self.to.is_abandoned() {
                return Err(io::Error::new(io::ErrorKind::BrokenPipe, "the job has ended"));
            }
            let count = bytes.len().min(self.to.room_to_high());
            if count > 0 {
                if self.at + count as u64 > self.granted {
                    let (_, _, high) = self.to.figures().marks();
                    let grant = self.at + high.max(count) as u64;
                    let advance = Advance { id: self.job, grant: Some(grant), surely: None };
                    self.jobs.advance(&[advance]).map_err(io::Error::other)?;
                    self.granted = grant;
                }
                let written = self.to.write(&bytes[..count]);
                self.at += written as u64;
                return Ok(written);
            }
            if !is_told {
                self.to.wake_with(Waker::from(Arc::new(Unpark(thread::current()))));
                is_told = true;
            }
            self.to.wake_at(self.to.level().saturating_sub(1));
            thread::park_timeout(LOOK);
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}
