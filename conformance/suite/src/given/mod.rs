//! What is given: cases as traces, the ledgers that they are written to, and what a trace
//! gives to a plug-in.

pub(crate) mod disturb;
pub(crate) mod fields;
pub(crate) mod file_error;
mod hashes;
pub mod ledger;
pub(crate) mod lines;
pub(crate) mod load;
pub(crate) mod neighbours;
pub(crate) mod timeline;
