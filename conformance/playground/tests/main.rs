//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod answers;
mod common;
mod page;
