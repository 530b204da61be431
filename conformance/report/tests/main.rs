//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod attestation;
mod common;
mod comparison;
mod forms;
mod json;
mod page;
mod schema;
mod sweep;
