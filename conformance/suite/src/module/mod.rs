//! A module's code: how it flows, what of it was executed, and what it can be changed to.

pub(crate) mod change;
pub(crate) mod covered;
pub(crate) mod executed;
pub(crate) mod flow;
mod instrument;
pub(crate) mod source;
