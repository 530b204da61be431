//! Ports on systems that are not Linux, below the common interface.

pub(crate) mod holders;
pub(crate) mod tty;
