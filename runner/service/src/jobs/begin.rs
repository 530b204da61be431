//! Jobs that begin further on in their program.

use std::path::Path;

use softplug_cell::Stop;
use softplug_trial::is_beginning;

use super::{JobSpec, JobsError};
use crate::disk::DiskError;
use crate::programs::{Snapshots, blocks};

/// Where a job begins.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum BeginAt {
    /// At the program's beginning.
    Start,
    /// At the block of this number, counted from 1 at the program's beginning.
    Block(u64),
    /// At this byte of the program.
    Byte(u64),
}

/// Words of coordination in a program.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Words<'a> {
    /// Where its feed stops.
    pub stops: &'a [Stop],
    /// The word at which the job stood that this one goes on with.
    pub stood: Option<u32>,
}

impl Words<'_> {
    /// How many lie before this byte. Who stood at a word and begins there again is not behind it.
    fn before(self, byte: u64) -> u32 {
        let is_there = |word: &u32| {
            self.stops.get(*word as usize).is_some_and(|stop| byte > 0 && stop.at == byte)
        };
        let behind = || self.stops.iter().filter(|stop| byte > 0 && stop.at <= byte).count();
        self.stood.filter(is_there).unwrap_or_else(|| behind() as u32)
    }
}

/// What a job is to do, beginning there. `field`: the field of the job's kind that takes the number of
/// the first block, for a plug-in that finds blocks itself.
///
/// # Errors
/// There is no such block or byte, or the program cannot be read.
pub fn beginning_at(
    mut spec: JobSpec,
    at: BeginAt,
    field: Option<&str>,
    words: Words<'_>,
    snapshots: &Snapshots,
) -> Result<JobSpec, JobsError> {
    (spec.from, spec.from_block, spec.words_before) = (0, 1, 0);
    if field.is_some() {
        // It begins here, wherever it began before.
        spec.fields.retain(|(name, _)| !is_beginning(name));
    }
    let data = match (at, spec.data) {
        (BeginAt::Start, _) => return Ok(spec),
        (_, Some(data)) => data,
        (_, None) => {
            return Err(JobsError::Spec("the job has no program, and so no blocks".to_owned()));
        }
    };
    match at {
        BeginAt::Byte(byte) if byte < data.size => {
            (spec.from, spec.from_block) = (byte, 0);
            spec.words_before = words.before(byte);
        }
        BeginAt::Byte(byte) => {
            return Err(JobsError::Spec(format!(
                "the program has no byte {byte}, it has {}",
                data.size
            )));
        }
        BeginAt::Block(number) => {
            let program = snapshots.open(data)?;
            let failed = DiskError::when("read", Path::new("the snapshot"));
            let Some(block) = blocks::block(program, number).map_err(failed)? else {
                return Err(JobsError::Spec(format!("the program has no block {number}")));
            };
            spec.from_block = number;
            spec.words_before = words.before(block.start);
            match field {
                Some(field) => spec.fields.push((field.to_owned(), number.to_string())),
                None => spec.from = block.start,
            }
        }
        BeginAt::Start => {}
    }
    Ok(spec)
}
