//! What is given: cases as traces, the ledgers that they are written to, and what a trace
//! gives to a plug-in.

pub(crate) mod case;
pub(crate) mod disturb;
pub(crate) mod fields;
pub(crate) mod file_error;
pub mod ledger;
pub(crate) mod lines;
pub(crate) mod load;
pub(crate) mod neighbours;
pub(crate) mod read;
pub(crate) mod timeline;
