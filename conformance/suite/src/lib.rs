//! Judges Softplug plug-ins: traces replayed in virtual time, simulated
//! partners, reports.
//!
//! A [`Subject`] is a plug-in to be judged, in the sandbox ([`Sandboxed`]) or
//! native ([`FromFn`]). [`load`] reads traces; [`run_all`] replays each of them in every
//! [`Permutation`] and compares what the plug-in does, µs by µs, with what the
//! trace demands. What fails carries its first [`Divergence`].

mod bless;
#[cfg(feature = "wasmtime")]
pub mod certify;
pub mod closed_loop;
mod compare;
mod corpus;
mod course;
mod cut;
mod deed;
mod disturb;
mod divergence;
mod fault;
mod fields;
mod file_error;
pub mod ledger;
mod lines;
mod load;
pub mod mutants;
mod overhear;
pub mod page;
pub mod partners;
mod permute;
mod phrase;
mod replay;
mod rerun;
mod run;
pub mod script;
mod show;
mod stepper;
mod subject;
mod verdict;

pub use bless::{BlessFailure, bless};
pub use corpus::{Corpus, CorpusError, Listed, Source};
pub use course::CourseError;
pub use deed::{Deed, Delivered};
pub use disturb::{Disturbed, Noise, disturb};
pub use divergence::{Divergence, Side};
pub use fault::{Fault, FaultClass};
pub use file_error::FileError;
pub use lines::modem_lines;
pub use load::{Case, LoadError, load};
pub use overhear::{Call, calls};
pub use permute::{Permutation, UnknownPermutation};
pub use phrase::{Other, Phrase};
pub use replay::{Outcome, Seen, replay};
pub use run::{Filter, Judge, Summary, judge, run_all};
pub use stepper::{Happening, Moment, Standing, Step, Stepper, Timer};
pub use subject::{FromFn, Fuel, Sandboxed, Subject, SubjectError};
pub use verdict::{Class, Failure, Verdict};
