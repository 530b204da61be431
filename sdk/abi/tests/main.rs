//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod c_header;
mod common;
mod decoder;
mod golden;
mod manifest;
mod spec;
