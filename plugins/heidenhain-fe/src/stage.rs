//! What the converter is at.

use softplug_plugin::{Failure, StateReader, StateWriter};

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
    /// The control sends.
    Receiving,
    /// A block is good and waits for room.
    Waiting,
}

impl Stage {
    /// Whether a job is on the line.
    pub(crate) fn is_sending(self) -> bool {
        matches!(self, Self::Filling | Self::Answer | Self::Ending)
    }

    pub(crate) fn is_receiving(self) -> bool {
        matches!(self, Self::Receiving | Self::Waiting)
    }

    /// `stopping`: why a job fails of which it is not known yet how much has left.
    pub(crate) fn save(self, state: &mut StateWriter<'_>, stopping: Option<Failure>) {
        state.u8(match self {
            Self::Idle => 0,
            Self::Asking => 1,
            Self::Granted => 2,
            Self::Filling => 3,
            Self::Answer => 4,
            Self::Ending => 5,
            Self::Receiving => 7,
            Self::Waiting => 8,
        });
        state.failure(stopping);
    }

    /// Why a job fails stands behind it.
    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Option<Failure> {
        let (code, stopping) = (state.u8(), state.failure());
        *self = match code {
            0 => Self::Idle,
            1 => Self::Asking,
            2 => Self::Granted,
            3 => Self::Filling,
            4 => Self::Answer,
            5 => Self::Ending,
            // It was a stage of its own.
            6 if state.format() < 3 => Self::Idle,
            7 => Self::Receiving,
            8 => Self::Waiting,
            _ => {
                state.refuse();
                Self::Idle
            }
        };
        stopping
    }
}
