//! Programs: the folders that people and machines take them from, the snapshots
//! that are sent, and what machines have sent.

pub mod blocks;
mod compare;
mod error;
mod folders;
mod quota;
mod receptions;
mod snapshots;

pub use compare::first_difference;
pub use error::ProgramError;
pub use folders::{Program, ProgramName, Programs};
pub use quota::{FREE_SPACE, OverQuota, Quota, Quotas, Today, WithinFree};
pub use receptions::{Arrival, Arrived, LeftOver, ReceptionFile, Receptions};
pub use snapshots::{Data, Snapshots};
