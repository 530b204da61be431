//! How much a corpus notices: a module is changed, one instruction at a time, and a
//! change that no run shows is a gap, or changes nothing that can be seen.

mod crossed;
mod crossings;
mod effects;
mod hunt;
mod options;

pub use hunt::score;
pub use options::{ScoreError, ScoreOptions};
