//! Judges Softplug plug-ins: traces replayed in virtual time, scripts played
//! with simulated machines, reports.
//!
//! A [`Subject`] is a plug-in to be judged, in the sandbox ([`Sandboxed`]) or
//! native ([`FromFn`]). [`load`] reads traces; [`run_all`] replays each of them in every
//! [`Permutation`] and compares what the plug-in does, µs by µs, with what the
//! trace demands. What fails carries its first [`Divergence`].
//!
//! The rooms of the crate, in the order in which they are entered; each uses only those
//! above it:
//!
//! | room | what |
//! |---|---|
//! | `given` | traces, [ledgers](ledger), and what a trace gives to a plug-in |
//! | `run` | subjects, permutations, replay, and what was seen |
//! | `module` | a module's code: what of it is executed, what it can be changed to |
//! | [`script`] | cases that are code, against simulated machines |
//! | `judge` | demands, comparison, divergences, verdicts |
//! | [`mutants`] | plug-ins that are wrong on purpose, and which case notices |
//! | `corpus` | all that plug-ins are judged by, and [whether it fits](lint) |
//! | [`certify`] | a whole profile under two engines, as a report |
//! | `explored` | all configurations of a profile explored, and ways that were found |
//! | `show` | runs walked through, blessed traces, parts of [pages](page) |

#[cfg(feature = "wasmtime")]
pub mod certify;
mod corpus;
#[cfg(feature = "wasmtime")]
mod explored;
mod given;
mod judge;
#[cfg(feature = "wasmtime")]
mod module;
pub mod mutants;
mod random;
mod run;
#[cfg(feature = "wasmtime")]
pub mod score;
pub mod script;
mod show;

pub use corpus::{Corpus, CorpusError, Listed, Source, lint};
#[cfg(feature = "wasmtime")]
pub use explored::{
    differs_from_explored, explore_checked, explore_profile, rows_of_way, traces_of_way,
};
pub use given::case::Case;
pub use given::disturb::{Disturbed, Noise, disturb};
pub use given::file_error::FileError;
pub use given::ledger;
pub use given::lines::{bad_kind, damage, line_parameters, modem_lines};
pub use given::load::{LoadError, load};
pub use given::timeline::TimelineError;
pub use judge::divergence::{Divergence, Side};
pub use judge::run::{Filter, Judge, Summary, judge, run_all};
pub use judge::verdict::{Failure, Verdict};
#[cfg(feature = "wasmtime")]
pub use module::executed::{MeasureError, Places};
pub use random::{FailedSession, GroupRun, SessionGroup, Sessions};
pub use run::class::Class;
pub use run::fault::{Fault, FaultClass};
pub use run::outcome::Outcome;
pub use run::overhear::{Call, calls};
pub use run::permute::{Clock, Permutation, Rooms, UnknownPermutation};
pub use run::replay::replay;
pub use run::seen::Seen;
pub use run::subject::{FromFn, Fuel, Sandboxed, Subject, SubjectError};
pub use show::bless::{BlessFailure, Blessing, bless, blessing};
pub use show::flight::{FlightError, FlightFault, record_of_flight};
pub use show::page;
pub use show::phrase::{Other, Phrase};
pub use show::recorded::{Made, Standing as RecordStanding, case_of_record};
pub use show::sent::Lost;
pub use show::stepper::{Happening, Moment, Standing, Step, Stepper, Timer};
