//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod arrows;
mod dependencies;
mod modules;
mod packages;
