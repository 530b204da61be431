//! What the handles and the control loop share.

use std::sync::Arc;

use tokio::sync::broadcast;

use crate::view::{Change, TimeMs};

/// Shared by all handles.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) changes: broadcast::Sender<Arc<Change>>,
    pub(crate) started_ms: TimeMs,
}
