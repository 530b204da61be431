//! Who has a port open, where the system does not tell.

use std::path::Path;

use crate::error::Holder;

/// Nobody is known.
pub(crate) fn holders(_: &Path) -> Vec<Holder> {
    Vec::new()
}
