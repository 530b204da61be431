//! Coordinates machines that work together.
//!
//! A *channel* runs one NC program at a time. Channels keep in step by words in their programs: they
//! meet at *marks*, load and start each other's programs, and hand *axes* over: a bar feeder, a
//! gantry, a robot, anything of which there is one. `docs/cells.md` says what each word does.
//!
//! [`Cell`] is a state machine without I/O and clock: it takes [`Event`]s and answers with
//! [`Change`]s. It is saved and restored between any two events. Who cannot go on, whatever the
//! others do, is told at once.
//!
//! | module | subject |
//! |---|---|
//! | `setup` | channels, axes and groups, by name |
//! | `word` | what programs say to other channels |
//! | `notation` | how they are written |
//! | `event` | what a cell is told, and what comes of it |
//! | `cell` | the state machine |
//! | `checking` | which events fit |
//! | `saving` | a cell as it is written down |
//! | `chart` | who did what over time |
//! | `picture` | a chart as SVG |
//! | `rehearsal` | programs without machines |
//! | `timing` | how long blocks take |
//! | `stuck` | who waits for whom for ever |
#![forbid(unsafe_code)]

mod cell;
mod chart;
mod checking;
mod event;
mod notation;
mod picture;
mod rehearsal;
mod saving;
mod setup;
mod stuck;
mod timing;
mod word;

pub use cell::{Cell, ChannelView};
pub use chart::{Chart, Doing, Span};
pub use event::{AfterCrash, Change, End, Event, Mode, Refused};
pub use notation::{MOST_WORDS, NoNotation, Notation, Program, Stop, WordError};
pub use picture::draw;
pub use rehearsal::{Course, Outcome, Rehearsal, rehearse};
pub use saving::{RestoreError, Saved};
pub use setup::{AxisId, ChannelId, ChannelSet, GroupId, MOST, Setup, SetupError};
pub use stuck::Stuck;
pub use timing::{BlockTimes, Machine};
pub use word::Word;
