//! What the converter is at.

use softplug_plugin::State;

/// One of these at a time; the transfers never overlap.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
pub(crate) enum Stage {
    /// Nothing.
    #[default]
    Idle,
    /// Between two files: a name, or the end.
    AwaitFile,
    /// Inside a file: data, or its end.
    AwaitData,
    /// Data is good and waits for room.
    NoRoom,
    /// Making the next packet of the job, or giving it to the link.
    Filling,
    /// A packet has been given; its answer is awaited.
    Answer,
}

impl Stage {
    /// Whether a job is on the line.
    pub(crate) fn is_sending(self) -> bool {
        matches!(self, Self::Filling | Self::Answer)
    }

    /// Whether somebody sends files.
    pub(crate) fn is_receiving(self) -> bool {
        matches!(self, Self::AwaitFile | Self::AwaitData | Self::NoRoom)
    }
}
