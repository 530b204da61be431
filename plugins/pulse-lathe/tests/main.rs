//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod exact;
mod running;
mod turned;
mod underrun;
