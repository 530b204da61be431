//! Explores a plug-in: everything that a line, a partner and a host may do, up to so many
//! faults, on the module as it is shipped.
//!
//! A plug-in imports nothing, has no clock and little memory: a copy of its memory is a copy of
//! all that it is. So the states of a plug-in on its line can be enumerated like those of a
//! model. From each state every [`Choice`] is made; states that differ in nothing that decides
//! the future count as one. In every state the promises are held against what happened: a
//! [`Breach`] comes with the shortest way that leads to it.
//!
//! | in a state | is kept as |
//! |---|---|
//! | the plug-in's memory and globals | blocks that differ from a new instance's, times as they are ahead of now |
//! | its stack and its mailbox | nothing: they are cleared after every event, but in a second instance |
//! | link, wire and line | what decides what comes, see `Link::hash_ahead` |
//! | the partner | a second plug-in, or a small machine that can be copied |
//!
//! What is a time in memory is found by a second instance that is given the same events with
//! its clock ahead: what differs by just that is a time. Its stack and mailbox are as they were
//! left. A plug-in that does something else because of the clock alone, or of what it left
//! there, cannot be explored.
#![forbid(unsafe_code)]

mod bounds;
mod choice;
mod course;
mod end;
mod error;
mod explore;
mod graph;
mod hash;
mod held;
mod image;
mod instance;
mod keep;
mod leftovers;
mod log;
mod marked;
mod module;
mod partner;
mod plans;
mod promise;
mod sandbox;
mod scenario;
mod search;
#[cfg(test)]
mod sound;
mod walk;
mod world;

pub use bounds::{Bounds, Kept, Progress};
pub use choice::{Choice, Damage};
pub use error::ExploreError;
pub use explore::{Counterexample, Exploration, Way, explore, explore_marked};
pub use log::Log;
pub use marked::Marked;
pub use plans::{LARGER, PLANS, Plan, larger, plans};
pub use promise::Breach;
pub use scenario::{Changes, Setup};
pub use walk::{Walked, Walks, walk};
