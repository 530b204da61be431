//! What a cell is told, and what comes of it.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::setup::{AxisId, ChannelId, ChannelSet, GroupId, Setup, listed};
use crate::word::Word;

/// How the channels of a group are worked with.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Programs run.
    #[default]
    Auto,
    /// AUTO, and somebody moves axes by hand meanwhile: programs stay where they are, and stand.
    JogInAuto,
    /// Blocks that somebody types: only what a person begins runs.
    Mda,
    /// Axes are moved by hand. Nothing begins.
    Jog,
}

/// How a program ended.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// All of it was sent. Its axes become neutral.
    Done,
    /// It failed, was ended by somebody, or was cut off. It keeps its axes: they may stand
    /// anywhere, and somebody has to look before another channel moves them.
    Failed,
}

/// What becomes of a cell whose gateway was ended in the middle of it.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AfterCrash {
    /// Every program ends where it is, and nothing begins before somebody clears the cell.
    #[default]
    Stop,
    /// Who stood behind a block stands there still. Who was sending has ended; its program can be
    /// begun again at a block, and the others wait for it.
    Resume,
}

/// What a cell is told.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// A program is to begin, from the queue or by somebody's hand.
    Begin {
        /// Where.
        channel: ChannelId,
        /// Its name.
        program: String,
        /// Somebody began it, not the queue.
        by_hand: bool,
    },
    /// Everything up to the end of a block has left, and this word stands in the block. Of a channel
    /// from which an axis was taken it is told when it has the axis back.
    Reached {
        /// Whose.
        channel: ChannelId,
        /// What it says.
        word: Word,
    },
    /// A program has ended.
    Ended {
        /// Whose.
        channel: ChannelId,
        /// How.
        end: End,
    },
    /// What is loaded there was taken away by somebody.
    Unloaded {
        /// Where.
        channel: ChannelId,
    },
    /// Somebody has a program pause, or go on.
    Paused {
        /// Whose.
        channel: ChannelId,
        /// Whether it stands now.
        is: bool,
    },
    /// A port is gone or a plug-in in quarantine, or it is back.
    Lost {
        /// Whose.
        channel: ChannelId,
        /// Whether it is gone now.
        is: bool,
    },
    /// Somebody chooses a mode for a group.
    Mode {
        /// Which.
        group: GroupId,
        /// What it is to be.
        mode: Mode,
    },
    /// Somebody gives an axis to a channel, whoever has it.
    Force {
        /// Which.
        axis: AxisId,
        /// To whom.
        channel: ChannelId,
    },
    /// Somebody makes an axis neutral, whoever has it.
    Free {
        /// Which.
        axis: AxisId,
    },
    /// The gateway starts again. These were sending when it ended.
    Restarted {
        /// Whose programs were cut off.
        cut_off: ChannelSet,
        /// What becomes of the others.
        policy: AfterCrash,
    },
    /// Somebody has looked after a crash: programs may begin again.
    Clear,
}

/// What has come of an event, in the order in which it came.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// A program has begun. `by`: the channel that started it; the host has to begin it then.
    Began {
        /// Where.
        channel: ChannelId,
        /// Its name.
        program: String,
        /// Who started it.
        by: Option<ChannelId>,
    },
    /// A channel stands behind a block until its word is fulfilled.
    Waits {
        /// Who.
        channel: ChannelId,
        /// For what.
        word: Word,
    },
    /// All who meet at a mark are there: all go on.
    Met {
        /// Its number.
        mark: u32,
        /// Who.
        with: ChannelSet,
    },
    /// A program is loaded, and waits to be started.
    Loaded {
        /// Where.
        channel: ChannelId,
        /// Its name.
        program: String,
        /// By whom.
        by: ChannelId,
    },
    /// What was loaded there is loaded no more.
    Unloaded {
        /// Where.
        channel: ChannelId,
    },
    /// An axis has an owner.
    Owned {
        /// Which.
        axis: AxisId,
        /// By whom.
        channel: ChannelId,
        /// Who lost it.
        from: Option<ChannelId>,
    },
    /// A channel waits for an axis, behind so many others.
    Queued {
        /// For which.
        axis: AxisId,
        /// Who.
        channel: ChannelId,
        /// How many wait before it.
        behind: usize,
    },
    /// An axis is neutral.
    Released {
        /// Which.
        axis: AxisId,
        /// Who had it.
        by: Option<ChannelId>,
    },
    /// A channel released what it did not have.
    NotOwned {
        /// Which.
        axis: AxisId,
        /// Who.
        channel: ChannelId,
    },
    /// A program has ended.
    Ended {
        /// Whose.
        channel: ChannelId,
        /// How.
        end: End,
    },
    /// A channel may be fed.
    Goes {
        /// Which.
        channel: ChannelId,
    },
    /// A channel may be fed no further.
    Stands {
        /// Which.
        channel: ChannelId,
    },
    /// A group has a mode.
    Mode {
        /// Which.
        group: GroupId,
        /// What it is.
        mode: Mode,
    },
    /// Nothing begins before somebody clears the cell.
    Stopped,
    /// Programs may begin again.
    Cleared,
    /// These wait for each other: none of them goes on unless somebody helps.
    Deadlock {
        /// Who.
        channels: ChannelSet,
    },
    /// These wait for a channel that runs no program, and nobody is left who would start one.
    NobodyComes {
        /// Who.
        channels: ChannelSet,
    },
    /// These were stuck, and are no longer.
    Free {
        /// Who.
        channels: ChannelSet,
    },
}

/// Why a cell does not take an event. Nothing has changed then.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum Refused {
    /// There is no such channel, axis or group.
    #[error("the cell has no {0}")]
    Unknown(String),
    /// One program at a time.
    #[error("{channel} runs {program} already")]
    Runs {
        /// Where.
        channel: String,
        /// What runs.
        program: String,
    },
    /// Nothing runs that could reach a block or end.
    #[error("{0} runs no program")]
    Idle(String),
    /// What has been taken from it comes first.
    #[error("{0} is interrupted until it has its axis back")]
    Interrupted(String),
    /// A channel stands behind one block at a time.
    #[error("{0} stands behind a block already")]
    Waits(String),
    /// The group is not in a mode for this.
    #[error("the group {group} is in {mode}: {hint}")]
    Mode {
        /// Which.
        group: String,
        /// What it is in.
        mode: &'static str,
        /// What to do.
        hint: &'static str,
    },
    /// A mode is chosen while nothing runs.
    #[error(
        "{running} of the group {group} still run: end their programs first, or choose JOG in AUTO"
    )]
    GroupRuns {
        /// Which.
        group: String,
        /// Who runs.
        running: String,
    },
    /// It was ended in the middle of its work.
    #[error(
        "the cell is stopped since the gateway was ended in the middle of its work: look at the machines, then clear it"
    )]
    Stopped,
    /// A forced axis needs somebody who moves it.
    #[error("{axis} can be given only to a channel that runs a program, and {channel} runs none")]
    NoUse {
        /// Which axis.
        axis: String,
        /// To whom.
        channel: String,
    },
}

impl Mode {
    /// As it stands on a control: `AUTO`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "AUTO",
            Self::JogInAuto => "JOG in AUTO",
            Self::Mda => "MDA",
            Self::Jog => "JOG",
        }
    }
}

impl Change {
    /// One line for a journal.
    pub fn told(&self, setup: &Setup) -> String {
        let name = |channel: &ChannelId| setup.channel_name(*channel);
        match self {
            Self::Began { channel, program, by: None } => {
                format!("{} begins {}", name(channel), program.escape_debug())
            }
            Self::Began { channel, program, by: Some(by) } => {
                format!("{} starts {} in {}", name(by), program.escape_debug(), name(channel))
            }
            Self::Waits { channel, word } => match word {
                Word::Wait { .. } | Word::Release { .. } => {
                    format!("{} {}", name(channel), word.told(*channel, setup))
                }
                Word::Get { axis, .. } => {
                    format!("{} waits for {}", name(channel), setup.axis_name(*axis))
                }
                Word::Load { channel: into, program } => {
                    let (into, program) = (name(into), program.escape_debug());
                    format!("{} waits to load {program} into {into}", name(channel))
                }
                Word::Start { channel: other } => {
                    format!("{} waits to start {}", name(channel), name(other))
                }
            },
            Self::Met { mark, with } => {
                format!("mark {mark}: {} are there and go on", setup.names(*with))
            }
            Self::Loaded { channel, program, by } => {
                format!("{} loads {} into {}", name(by), program.escape_debug(), name(channel))
            }
            Self::Unloaded { channel } => format!("nothing is loaded in {}", name(channel)),
            Self::Owned { axis, channel, from: None } => {
                format!("{} has {}", name(channel), setup.axis_name(*axis))
            }
            Self::Owned { axis, channel, from: Some(from) } => {
                let axis = setup.axis_name(*axis);
                format!("{} takes {axis} from {}, which is interrupted", name(channel), name(from))
            }
            Self::Queued { axis, channel, behind } => {
                let axis = setup.axis_name(*axis);
                format!("{} is in the queue for {axis}, behind {behind} others", name(channel))
            }
            Self::Released { axis, by: Some(by) } => {
                format!("{} releases {}", name(by), setup.axis_name(*axis))
            }
            Self::Released { axis, by: None } => format!("{} is neutral", setup.axis_name(*axis)),
            Self::NotOwned { axis, channel } => {
                format!("{} releases {}, which it has not", name(channel), setup.axis_name(*axis))
            }
            Self::Ended { channel, end: End::Done } => format!("{} has ended", name(channel)),
            Self::Ended { channel, end: End::Failed } => {
                format!("{} ended before its program's end, and keeps its axes", name(channel))
            }
            Self::Goes { channel } => format!("{} goes on", name(channel)),
            Self::Stands { channel } => format!("{} stands", name(channel)),
            Self::Mode { group, mode } => {
                format!("the group {} is in {}", setup.group_name(*group), mode.name())
            }
            Self::Stopped => "the cell is stopped".to_owned(),
            Self::Cleared => "the cell is cleared".to_owned(),
            Self::Deadlock { channels } if channels.len() == 1 => {
                format!("deadlock: {} waits for itself", setup.names(*channels))
            }
            Self::Deadlock { channels } => {
                format!("deadlock: {} wait for each other", setup.names(*channels))
            }
            Self::NobodyComes { channels } => {
                let names: Vec<&str> = channels.iter().map(|one| setup.channel_name(one)).collect();
                let waits = if names.len() == 1 { "waits" } else { "wait" };
                format!("{} {waits} for a channel that runs no program", listed(&names))
            }
            Self::Free { channels } => {
                let is = if channels.len() == 1 { "is" } else { "are" };
                format!("{} {is} stuck no longer", setup.names(*channels))
            }
        }
    }
}
