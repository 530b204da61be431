//! A program tried through a plug-in before anything is sent.
//!
//! A [`Trial`] runs the plug-in on its line in virtual time, with a partner that wants what is sent
//! and says all that its protocol has it say. [`Trial::run`] tells what would be on the wire;
//! [`Trial::check`] what becomes of each character of a program: whether it passes, is left out,
//! replaced or refused. No port is touched, and no instance but its own.
//!
//! | module | what |
//! |---|---|
//! | `closed_loop` | both ends of a line: a plug-in and a simulated machine, in virtual time |
//! | `setup`, `trial`, `tried` | what is tried; a job in the loop; what came of it |
//! | `paper` | the host's side of the job |
//! | `willing`, `blockwise` | the partner for each profile |
//! | `characters`, `fate`, `check` | what a program is written in, and what becomes of it |
//! | `budget` | how much all of it may cost |
#![forbid(unsafe_code)]

mod blockwise;
mod budget;
mod characters;
mod check;
mod closed_loop;
mod error;
mod exchange;
mod fate;
mod paper;
mod reason;
mod settings;
mod setup;
mod trial;
mod tried;
mod willing;

pub use budget::{Budget, MeteredFault};
pub use characters::{Found, Written, characters};
pub use check::{Altered, CheckResult, Checked, Refused};
pub use closed_loop::ClosedLoop;
pub use error::{PartnerError, TrialError};
pub use exchange::Side;
pub use fate::Fate;
pub use reason::{WAITS, reason};
pub use setup::{Setup, is_beginning};
pub use trial::Trial;
pub use tried::{End, Note, Tried};
