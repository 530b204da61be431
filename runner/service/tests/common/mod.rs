//! What several tests of the gateway need.

pub(crate) mod bench;
pub(crate) mod plugins;
