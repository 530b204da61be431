//! Drop folders: a file that is put into the folder of a link becomes a job of the link, and is put
//! away beside what became of it.
//!
//! Each has a thread of its own, as a share can keep whoever asks it waiting for minutes. It only
//! looks, now and then: shares tell nobody of a change.
//!
//! What must never happen is that a file becomes two jobs, or is taken half. A file is taken in four
//! steps, each of which is found again by whoever comes after a kill:
//!
//! 1. It has not changed for a while, and nobody is known to write to it ([`settling`]).
//! 2. It is claimed: moved into a folder whose name, the claim, is never given twice ([`place`]).
//! 3. The job is written down together with the claim, in one change (`jobs/claims.rs`).
//! 4. When the job has ended, result and file are put away ([`shelf`](place::shelf)), then the claim is forgotten.
//!
//! A claim without a job gets one; one with a job waits for its end.

mod names;
mod place;
mod result;
mod settling;
mod watch;

pub(crate) use watch::{DropFolder, Dropped, NotTaken, Queue};
