//! What a link did over the last day, as it is shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::TimeMs;

/// What a link did: the last ten minutes by the second, the last day by the minute. It begins
/// anew with the gateway.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct HistoryView {
    /// By the second, at most 600.
    pub seconds: HistorySpan,
    /// By the minute, at most 1,440.
    pub minutes: HistorySpan,
}

/// Samples that follow each other without a gap, the newest last: as many in each list.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct HistorySpan {
    /// From one to the next, in milliseconds.
    pub step_ms: u64,
    /// When the newest ended.
    pub end_ms: TimeMs,
    /// Bytes in the buffer at its end; of a minute the mean.
    pub level: Vec<u32>,
    /// Bytes that the port took.
    pub sent: Vec<u32>,
    /// Good bytes from the machine.
    pub received: Vec<u32>,
    /// For how many milliseconds the machine held the line.
    pub held_ms: Vec<u32>,
    /// Damaged characters.
    pub line_errors: Vec<u32>,
}
