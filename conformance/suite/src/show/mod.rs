//! What is shown: runs taken apart for people, traces that take over what was seen, records that
//! become cases, and parts of the protocol pages.

pub(crate) mod bless;
pub(crate) mod flight;
pub mod page;
pub(crate) mod phrase;
pub(crate) mod recorded;
pub(crate) mod sent;
pub(crate) mod stepper;
