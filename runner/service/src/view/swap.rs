//! Swaps of plug-ins as they are ordered and shown.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

use super::{PluginRef, TimeMs};

/// A swap that is wanted.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SwapOrder {
    /// The plug-in: `name`, `name@version` or `name@sha256:…`.
    pub plugin: String,
    /// Its settings; if nothing is said those that the link has, or the defaults where another
    /// plug-in runs.
    #[serde(default)]
    pub settings: Option<BTreeMap<String, String>>,
    /// When.
    #[serde(default)]
    pub when: SwapWhen,
    /// Probation; as configured if nothing is said.
    #[serde(default)]
    pub probation: Option<ProbationOrder>,
}

/// When to swap.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SwapWhen {
    /// At once with the state carried over; refused if the formats do not match. Another
    /// plug-in, by its name, takes over no state: it is refused unless nothing is under way.
    Now,
    /// At the next moment at which nothing is under way.
    Idle,
    /// At once if it is the same plug-in by name and the formats match, else when idle.
    #[default]
    NowOrIdle,
}

/// How long a new plug-in is on probation: until both have passed.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbationOrder {
    /// Events that it must survive.
    #[serde(default)]
    pub events: u64,
    /// Seconds that it must survive.
    #[serde(default)]
    pub seconds: u32,
}

/// A swap.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct SwapView {
    /// The link.
    pub link: String,
    /// The plug-in that ran; none if the link had none.
    pub from: Option<PluginRef>,
    /// The one that is to run.
    pub to: PluginRef,
    /// How far it is.
    pub state: SwapState,
    /// When it was ordered, or last changed its state.
    pub at_ms: TimeMs,
    /// For how long the link stood still for it.
    pub pause_us: Option<u64>,
    /// Why it was refused or taken back.
    pub message: Option<String>,
}

/// How far a swap is.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SwapState {
    /// It is under way.
    Ordered,
    /// It waits until the link is idle.
    Waiting,
    /// The new plug-in runs; its probation is not over.
    Probation,
    /// The new plug-in runs for good.
    Done,
    /// It was not done; the old plug-in runs as if nothing had been.
    Refused,
    /// The new plug-in failed; the old one runs again.
    Reverted,
}

/// The probation that is under way.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct ProbationView {
    /// The plug-in to which the link returns if this one fails.
    pub returns_to: PluginRef,
    /// Since when.
    pub since_ms: TimeMs,
}
