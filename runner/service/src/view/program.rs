//! Programs and receptions as they are shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::TimeMs;

/// A program in one of the folders.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct ProgramView {
    /// Its name, with the folder below the programs' folder before it: `lathes/O1234.nc`.
    pub name: String,
    /// Bytes.
    pub bytes: u64,
    /// When it was last changed.
    pub changed_ms: TimeMs,
}

/// Something that was received.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReceptionView {
    /// The file's name in the link's folder.
    pub file: String,
    /// The link.
    pub link: String,
    /// The name that the machine gave it.
    pub name: Option<String>,
    /// Bytes.
    pub bytes: u64,
    /// When it ended.
    pub at_ms: TimeMs,
    /// Why it failed; what came is kept.
    pub failure: Option<String>,
    /// The job that it answers.
    pub job: Option<u32>,
    /// How it compares with the program of that name that was last sent.
    pub compared: Option<Compared>,
}

/// A reception beside what was last sent under its name.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct Compared {
    /// The job that sent it.
    pub job: Option<u32>,
    /// Whether they are the same.
    pub is_same: bool,
    /// The first byte in which they differ, counted from 0.
    pub differs_at: Option<u64>,
}
