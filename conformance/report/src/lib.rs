//! Conformance reports of plug-ins: what they hold, how the verdict follows from
//! it, and the forms in which they are written.
//!
//! A [`Report`] is the source of truth. It depends on the plug-in, the corpus and
//! the suite alone: no clock, no path and no name of a machine stands in it, so
//! that two runs give the same bytes. Everything else is made from it:
//!
//! | module | what |
//! |---|---|
//! | [`json`] | `conformance.json`: written, and read back with suspicion |
//! | [`junit`] | `junit.xml`, for CI systems |
//! | [`html`] | `report.html`, one file for people |
//! | [`badge`] | `badge.json`, for shields.io |
//! | [`annotations`] | workflow commands of GitHub Actions |
//! | [`attest`] | `attestation.json`: the result, signed |
//!
//! [`explain()`] puts a failed case into words; [`compare()`] tells two reports apart; [`check()`] tells whether one of them
//! follows from its own rows. Skipped is never green: no form of an incomplete
//! run can be taken for a conformant plug-in.

pub mod annotations;
#[cfg(feature = "attest")]
pub mod attest;
pub mod badge;
mod check;
mod compare;
mod coverage;
mod explain;
mod explored;
mod hex;
pub mod html;
pub mod json;
#[cfg(feature = "junit")]
pub mod junit;
mod model;
mod outcome;
mod score;
mod text;
mod verdict;

pub use check::{Inconsistency, check};
pub use compare::{Difference, compare, fuel_is_comparable};
pub use coverage::{Coverage, Executed, Place};
pub use explain::explain;
pub use explored::{Drawn, Explored, ExploredConfiguration, Found, Side};
pub use model::*;
pub use outcome::Outcome;
pub use score::{Noticed, Score, Shown, Survivor};
pub use verdict::{Reason, VerdictKind, verdict};
