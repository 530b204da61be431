//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod bench;
mod df1;
mod giving;
mod hello;
mod machine;
mod parts;
mod settings;
mod state;
