//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod common;
mod invariants;
mod named;
mod positions;
mod probation;
mod rerun;
mod rules;
