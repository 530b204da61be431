//! What a program says to the other channels, whatever its notation.

use serde::{Deserialize, Serialize};

use crate::setup::{AxisId, ChannelId, ChannelSet, Setup};

/// A word of coordination. It takes effect behind the block in which it stands.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Word {
    /// WAI: goes on when all these channels, itself among them, have reached this mark.
    Wait {
        /// Its number.
        mark: u32,
        /// Who meets there. Each names the same channels; who says it is added.
        with: ChannelSet,
    },
    /// LAD: loads a program into a channel.
    Load {
        /// Into which.
        channel: ChannelId,
        /// The program's name.
        program: String,
    },
    /// EXE: starts what is loaded there.
    Start {
        /// Which channel.
        channel: ChannelId,
    },
    /// Wants an axis.
    Get {
        /// Which.
        axis: AxisId,
        /// Whoever has it loses it.
        forced: bool,
    },
    /// Gives an axis back.
    Release {
        /// Which.
        axis: AxisId,
    },
}

impl Word {
    /// In the words of people: `waits at mark 10 for LATHE-2`, as said by `channel`.
    pub fn told(&self, by: ChannelId, setup: &Setup) -> String {
        match self {
            Self::Wait { mark, with } => {
                format!("waits at mark {mark} for {}", setup.names(with.without(by)))
            }
            Self::Load { channel, program } => {
                format!("loads {} into {}", program.escape_debug(), setup.channel_name(*channel))
            }
            Self::Start { channel } => format!("starts {}", setup.channel_name(*channel)),
            Self::Get { axis, forced: false } => format!("wants {}", setup.axis_name(*axis)),
            Self::Get { axis, forced: true } => format!("takes {}", setup.axis_name(*axis)),
            Self::Release { axis } => format!("releases {}", setup.axis_name(*axis)),
        }
    }
}
