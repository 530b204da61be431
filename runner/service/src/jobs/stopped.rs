//! Where in its program a job stopped.

use super::{Extent, Job};
use crate::disk::DiskError;
use crate::programs::Snapshots;
use crate::programs::blocks::{self, Between};

impl Snapshots {
    /// Between which blocks of its program a job stopped; nothing if it has none.
    ///
    /// # Errors
    /// The snapshot cannot be read.
    pub fn between(&self, job: &Job) -> Result<Between, DiskError> {
        let Some(data) = job.spec.data else { return Ok(Between::default()) };
        let Extent { surely, maybe } = job.extent;
        let found = blocks::between(self.open(data)?, surely, maybe);
        found.map_err(DiskError::when("read", &self.path(data)))
    }
}
