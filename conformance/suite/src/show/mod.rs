//! What is shown: runs taken apart for people, traces that take over what was seen, and
//! parts of the protocol pages.

pub(crate) mod bless;
pub mod page;
pub(crate) mod phrase;
pub(crate) mod stepper;
