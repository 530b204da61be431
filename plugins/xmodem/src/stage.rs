//! What the converter is at.

use softplug_plugin::State;

/// One of these at a time; the transfers never overlap.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
pub(crate) enum Stage {
    /// Nothing; a job may wait for a call.
    #[default]
    Idle,
    /// We have called for a file.
    Calling,
    /// The next block is awaited.
    Between,
    /// Inside a block.
    Block,
    /// Until the line is clear.
    Purging,
    /// One CAN has come.
    CanHeard,
    /// EOT has come, and nothing else.
    EndHeard,
    /// A block is good and waits for room.
    NoRoom,
    /// Gathering the next block of the job, or giving it to the link.
    Filling,
    /// A block has been given; its answer is awaited.
    Answer,
    /// A block that was repeated is acknowledged; the line has to be clear.
    Settling,
    /// EOT has been given; its answer is awaited.
    Ending,
}

impl Stage {
    /// Whether a job is on the line.
    pub(crate) fn is_sending(self) -> bool {
        matches!(self, Self::Filling | Self::Answer | Self::Settling | Self::Ending)
    }

    /// Whether something has come that may be a file.
    pub(crate) fn is_receiving(self) -> bool {
        !self.is_sending() && !matches!(self, Self::Idle | Self::Calling)
    }
}
