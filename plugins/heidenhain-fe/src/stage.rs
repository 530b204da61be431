//! What the converter is at.

use softplug_plugin::{Failure, StateError, StateReader, StateWriter};

/// One of these at a time; the transfers never overlap.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) enum Stage {
    /// Nothing; a job may wait until the control asks.
    #[default]
    Idle,
    /// The control has asked for a program, and we the host.
    Asking,
    /// The host has granted it; its job has not begun.
    Granted,
    /// Gathering the next line of the job.
    Filling,
    /// A block has gone; its answer is awaited.
    Answer,
    /// The end has gone.
    Ending,
    /// The queue is dropped; then the job fails.
    Stopping(Failure),
    /// The control sends.
    Receiving,
    /// A block is good and waits for room.
    Waiting,
}

impl Stage {
    /// Whether a job is on the line.
    pub(crate) fn is_sending(self) -> bool {
        matches!(self, Self::Filling | Self::Answer | Self::Ending | Self::Stopping(_))
    }

    pub(crate) fn is_receiving(self) -> bool {
        matches!(self, Self::Receiving | Self::Waiting)
    }

    pub(crate) fn save(self, state: &mut StateWriter<'_>) {
        let (code, failure) = match self {
            Self::Idle => (0, None),
            Self::Asking => (1, None),
            Self::Granted => (2, None),
            Self::Filling => (3, None),
            Self::Answer => (4, None),
            Self::Ending => (5, None),
            Self::Stopping(failure) => (6, Some(failure)),
            Self::Receiving => (7, None),
            Self::Waiting => (8, None),
        };
        state.u8(code);
        state.failure(failure);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        Ok(match (state.u8(), state.failure()) {
            (0, None) => Self::Idle,
            (1, None) => Self::Asking,
            (2, None) => Self::Granted,
            (3, None) => Self::Filling,
            (4, None) => Self::Answer,
            (5, None) => Self::Ending,
            (6, Some(failure)) => Self::Stopping(failure),
            (7, None) => Self::Receiving,
            (8, None) => Self::Waiting,
            _ => return Err(StateError),
        })
    }
}
