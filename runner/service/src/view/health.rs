//! How the gateway is.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::TimeMs;

/// How the gateway is.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct HealthView {
    /// Whether its control loop answers and its database can be written.
    pub is_healthy: bool,
    /// What is wrong, in sentences.
    pub problems: Vec<String>,
    /// What somebody should look at, in sentences; the gateway works all the same.
    pub warnings: Vec<String>,
    /// Its version.
    pub version: String,
    /// When it started.
    pub started_ms: TimeMs,
    /// Its links by state.
    pub links: LinkCounts,
}

/// How many links there are.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct LinkCounts {
    /// In all.
    pub all: u32,
    /// With an open port and a plug-in that runs.
    pub up: u32,
    /// Without a port.
    pub down: u32,
    /// In quarantine.
    pub quarantined: u32,
}

/// Whether the gateway takes work.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReadyView {
    /// It does.
    pub is_ready: bool,
    /// Why not.
    pub reasons: Vec<String>,
}

/// What a new configuration changed.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct ReloadView {
    /// Links that are new.
    pub added: Vec<String>,
    /// Links that are gone.
    pub removed: Vec<String>,
    /// Links that were changed, and what of them.
    pub changed: Vec<RemadeLink>,
    /// Buses that are new, gone or changed.
    #[serde(default)]
    pub buses: Vec<String>,
    /// Cells that are new, gone or changed.
    #[serde(default)]
    pub cells: Vec<String>,
    /// How many links were not touched.
    pub untouched: u32,
    /// Keys that take effect only when the gateway is started anew.
    pub needs_restart: Vec<String>,
}

/// A link whose configuration changed.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct RemadeLink {
    /// The link.
    pub name: String,
    /// The keys that changed.
    pub keys: Vec<String>,
    /// It is busy: the change waits until it is idle.
    pub waits: bool,
}

/// What a stop does with jobs that run.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StopHow {
    /// They are ended in an orderly way and can be restarted at a block.
    #[default]
    Park,
    /// They are finished first; none is begun.
    Finish,
}
