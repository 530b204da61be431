//! How far is explored, and how far an exploration is.

use std::path::PathBuf;
use std::time::Duration;

/// How far is explored.
///
/// ```
/// use softplug_explore::Bounds;
///
/// let bounds = Bounds { faults: 2, ..Bounds::default() };
/// assert_eq!((bounds.depth, bounds.threads), (None, 1));
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Bounds {
    /// Faults and requests out of turn, together.
    pub faults: u8,
    /// Choices one after the other, at most.
    pub depth: Option<u32>,
    /// States; the level in which there are as many is finished.
    pub states: Option<u64>,
    /// Time of this run.
    pub time: Option<Duration>,
    /// Threads; they change nothing of what is found.
    pub threads: usize,
    /// States that come next and are held in memory as they are, some 5 kB each. Others are made
    /// again from the ways that lead to them: that changes nothing of what is found and takes
    /// longer.
    pub held: usize,
    /// Where the states are kept.
    pub keep: Option<Kept>,
}

/// A file for the states, so that an exploration that was ended can go on.
///
/// ```
/// use softplug_explore::{Bounds, Kept};
///
/// let kept = Kept { file: "explored/states".into(), goes_on: true };
/// let bounds = Bounds { keep: Some(kept), ..Bounds::default() };
/// assert!(bounds.keep.is_some());
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Kept {
    /// The file, made anew or where it is missing.
    pub file: PathBuf,
    /// Where it is there, go on from what it holds.
    pub goes_on: bool,
}

impl Default for Bounds {
    /// One fault, one thread, and nothing else that ends it.
    fn default() -> Self {
        let held = 500_000;
        Self { faults: 1, depth: None, states: None, time: None, threads: 1, held, keep: None }
    }
}

/// How far an exploration is.
///
/// ```
/// use softplug_explore::Progress;
///
/// let progress = Progress { depth: 12, states: 900, transitions: 2_000, frontier: 30 };
/// assert!(progress.transitions >= progress.states);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Progress {
    /// Choices from the first state.
    pub depth: u32,
    /// States that were found.
    pub states: u64,
    /// Choices that were made.
    pub transitions: u64,
    /// States that come next.
    pub frontier: u64,
}
