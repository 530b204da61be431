//! The suite proves that it bites: plug-ins that break one rule each, and which
//! case notices.
//!
//! A [`Catalogue`] names the mutants of a profile and what each does wrong. The plug-ins'
//! test-only builds hold them all, asleep; [`wake`] writes into such a module
//! which one is active. [`hunt`] runs the cases of the profile against it, those that cite the
//! broken clause first, until one sees wrong behaviour. What comes of it is the
//! [`Matrix`]. What came of changes of the finished modules are [`Scores`].

mod catalogue;
mod hunt;
mod hunt_all;
mod matrix;
mod page;
mod patch;
mod scores;

pub use catalogue::{Catalogue, CatalogueError, Mutant, Place, Unbreakable, check_all, unproved};
pub use hunt::{Hunt, Kill, NotAKill, hunt};
pub use hunt_all::{HuntError, hunt_all, subject};
pub use matrix::{KillRow, Matrix, SurvivorRow, UnbreakableRow, Unproved};
pub use patch::{MARKER, PatchError, id, wake};
pub use scores::{ScoreRow, Scores};
