//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod loop_back;
mod sending;
mod settings;
