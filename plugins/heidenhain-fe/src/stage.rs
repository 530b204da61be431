//! What the converter is at.

use softplug_plugin::State;

/// One of these at a time; the transfers never overlap.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
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
}
