//! Conformance reports of plug-ins: what they hold, and how the verdict follows
//! from it.
//!
//! A [`Report`] is the source of truth. It depends on the plug-in, the corpus and
//! the suite alone: no clock, no path and no name of a machine stands in it, so
//! that two runs give the same bytes.

mod model;
mod verdict;

pub use model::*;
pub use verdict::{Reason, VerdictKind, verdict};
