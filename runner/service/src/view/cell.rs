//! A cell of links that work together, as it is shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::TimeMs;

/// A cell: its channels, axes and groups.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CellView {
    /// Its name in `gateway.toml`.
    pub name: String,
    /// Nothing begins before somebody clears it: the gateway was ended in the middle of its work.
    pub is_stopped: bool,
    /// Its channels, which are links of the same name.
    pub channels: Vec<CellChannelView>,
    /// Its axes: whatever there is one of.
    pub axes: Vec<CellAxisView>,
    /// Which channels are always in one mode.
    pub groups: Vec<CellGroupView>,
    /// Channels that cannot go on, whatever the others do.
    pub stuck: Vec<CellStuckView>,
    /// The gateway's time, by which open spans are drawn.
    pub now_ms: TimeMs,
}

/// A channel of a cell.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CellChannelView {
    /// The link.
    pub link: String,
    /// What it does.
    pub state: CellChannelState,
    /// What it does, in words.
    pub text: String,
    /// Since when.
    pub since_ms: TimeMs,
    /// The program that runs.
    pub program: Option<String>,
    /// The job that sends it.
    pub job: Option<u32>,
    /// The program that was loaded by another channel and waits to be started.
    pub loaded: Option<String>,
    /// Links for which it waits.
    pub waits_for: Vec<String>,
    /// Words of coordination in its program that are behind it.
    pub words_passed: u32,
    /// All words of coordination in its program.
    pub words: u32,
    /// What it did lately, the oldest first.
    pub spans: Vec<CellSpanView>,
}

/// What a channel does.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CellChannelState {
    /// It runs no program.
    Idle,
    /// Its program is sent.
    Runs,
    /// It stands behind a block and waits.
    Waits,
    /// Its program stands for another reason.
    Stands,
}

/// A channel did one thing for a while.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CellSpanView {
    /// From.
    pub from_ms: TimeMs,
    /// To; `null`: it still does.
    pub to_ms: Option<TimeMs>,
    /// What.
    pub state: CellChannelState,
    /// The program, or for what it waited.
    pub text: String,
}

/// An axis of a cell.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CellAxisView {
    /// Its name.
    pub name: String,
    /// Who has it; `null`: it is neutral.
    pub owner: Option<String>,
    /// Who waits for it, the first first.
    pub queue: Vec<String>,
}

/// A mode group of a cell.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CellGroupView {
    /// Its name.
    pub name: String,
    /// Its channels.
    pub channels: Vec<String>,
    /// Its mode.
    pub mode: CellMode,
}

/// The mode of a group.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CellMode {
    /// Programs run.
    Auto,
    /// AUTO, and axes are moved by hand meanwhile: programs stand where they are.
    JogInAuto,
    /// Only what a person begins runs.
    Mda,
    /// Axes are moved by hand; nothing begins.
    Jog,
}

/// Why a channel cannot go on.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CellStuckView {
    /// The channel.
    pub link: String,
    /// It is one of several that wait for each other; otherwise for one that runs no program.
    pub is_deadlock: bool,
    /// Since when it stands behind its block; `null`: an axis was taken from it.
    pub since_ms: Option<TimeMs>,
    /// For whom and what it waits, and what would free it.
    pub text: String,
}

/// Who is to get an axis.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceOrder {
    /// The channel, which must run a program.
    pub channel: String,
}

/// Which mode a group is to have.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ModeOrder {
    /// The mode.
    pub mode: CellMode,
}
