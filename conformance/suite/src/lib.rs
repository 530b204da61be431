//! Judges Softplug plug-ins: traces replayed in virtual time, simulated
//! partners, reports.
//!
//! A [`Subject`] is a plug-in to be judged, in the sandbox ([`Sandboxed`]) or
//! native ([`FromFn`]). [`load`] reads traces; [`run_all`] replays each of them in every
//! [`Permutation`] and compares what the plug-in does, µs by µs, with what the
//! trace demands. What fails carries its first [`Divergence`].

mod bless;
pub mod closed_loop;
mod compare;
mod course;
mod cut;
mod deed;
mod divergence;
mod fault;
mod fields;
mod lines;
mod load;
pub mod mutants;
pub mod page;
pub mod partners;
mod permute;
mod replay;
mod run;
mod show;
mod subject;
mod verdict;

pub use bless::{BlessFailure, bless};
pub use course::CourseError;
pub use deed::{Deed, Delivered};
pub use divergence::{Divergence, Side};
pub use fault::{Fault, FaultClass};
pub use load::{Case, LoadError, load};
pub use permute::{Permutation, UnknownPermutation};
pub use replay::{Outcome, Seen, replay};
pub use run::{Filter, Judge, Summary, judge, run_all};
pub use subject::{FromFn, Sandboxed, Subject, SubjectError};
pub use verdict::{Class, Failure, Verdict};
