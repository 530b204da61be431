//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod bombs;
mod budget;
mod cache;
mod common;
mod files;
mod fuzz;
mod hostile;
mod lint;
mod rules;
mod state;
