//! All tests of this crate that use it from outside: one program, so that what it needs is linked once.

mod bites;
mod certify;
mod common;
mod controls;
mod explore;
mod fanuc_feed;
mod fanuc_loop;
mod feed;
mod interpreter;
mod lathes;
mod ledgers;
mod loading;
mod mutants;
mod natively;
mod page;
mod profiles;
mod r3964_loop;
mod scripts;
mod sessions;
mod stepper;
