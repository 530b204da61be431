//! What the plug-in is at.

use softplug_plugin::{Failure, StateReader, StateWriter};

/// What it is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) enum Stage {
    /// No job.
    #[default]
    Idle,
    /// Looking at a program, sending nothing.
    Checking,
    /// Reading a program as a whole.
    Loading,
    /// Going through the blocks before the first one.
    Rebuilding,
    /// Queueing pulses.
    Running,
    /// A command has been queued; its echo counts when it may have left.
    Echo { code: u8, may_have_left: bool },
    /// A block is over; a start counts when all of it has left.
    Single { has_left: bool },
    /// A thread waits for the index mark, which counts when all before it has left.
    Index { has_left: bool },
    /// z follows the spindle.
    Thread,
    /// All is queued; waiting until the last byte has left.
    Ending,
    /// The queue is being dropped; the job then fails for this reason.
    Stopping(Failure, u16),
}

impl Stage {
    /// Its name for people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Checking => "checking",
            Self::Loading => "loading",
            Self::Rebuilding => "rebuilding",
            Self::Running => "running",
            Self::Echo { .. } => "waiting for S, T or M",
            Self::Single { .. } => "waiting for start",
            Self::Index { .. } => "waiting for the index mark",
            Self::Thread => "thread",
            Self::Ending => "ending",
            Self::Stopping(..) => "stopping",
        }
    }

    /// Whether pulses of a job may be in the queue, or come there.
    pub(crate) fn is_under_way(self) -> bool {
        !matches!(self, Self::Idle | Self::Checking | Self::Loading | Self::Stopping(..))
    }

    pub(crate) fn save(self, state: &mut StateWriter<'_>) {
        let (number, more, flag) = match self {
            Self::Idle => (0, 0, false),
            Self::Checking => (1, 0, false),
            Self::Loading => (2, 0, false),
            Self::Rebuilding => (3, 0, false),
            Self::Running => (4, 0, false),
            Self::Echo { code, may_have_left } => (5, u16::from(code), may_have_left),
            Self::Single { has_left } => (6, 0, has_left),
            Self::Index { has_left } => (7, 0, has_left),
            Self::Thread => (8, 0, false),
            Self::Ending => (9, 0, false),
            Self::Stopping(_, status) => (10, status, false),
        };
        state.u8(number);
        state.u16(more);
        state.bool(flag);
        let failure = if let Self::Stopping(failure, _) = self { Some(failure) } else { None };
        state.failure(failure);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        let (number, more, flag) = (state.u8(), state.u16(), state.bool());
        match (number, state.failure()) {
            (0, None) => Self::Idle,
            (1, None) => Self::Checking,
            (2, None) => Self::Loading,
            (3, None) => Self::Rebuilding,
            (4, None) => Self::Running,
            (5, None) => Self::Echo { code: more as u8, may_have_left: flag },
            (6, None) => Self::Single { has_left: flag },
            (7, None) => Self::Index { has_left: flag },
            (8, None) => Self::Thread,
            (9, None) => Self::Ending,
            (10, Some(failure)) => Self::Stopping(failure, more),
            _ => {
                state.refuse();
                Self::Idle
            }
        }
    }
}
