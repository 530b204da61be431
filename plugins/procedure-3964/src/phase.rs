//! The states of the procedure.

use softplug_plugin::State;

/// What the procedure is at. Sender and receiver share the line, so they share
/// the state.
#[derive(Copy, Clone, PartialEq, Eq, Debug, State)]
pub(crate) enum Phase {
    Idle,
    /// Characters came in idle: waiting for silence.
    Garbage,
    /// STX came and no buffer is free.
    BufferWait,
    Receiving,
    /// A block was refused: its repetition should begin.
    RepetitionWait,
    /// STX was sent.
    DleWait,
    Sending,
    /// The partner spoke into our block: waiting for silence.
    Disturbed,
    /// The block was sent.
    AcknowledgementWait,
}

impl Phase {
    /// Whether a block of ours is under way.
    pub(crate) fn is_sender(self) -> bool {
        matches!(self, Self::DleWait | Self::Sending | Self::Disturbed | Self::AcknowledgementWait)
    }

    /// Whether a block of the partner is under way.
    pub(crate) fn is_receiver(self) -> bool {
        matches!(self, Self::BufferWait | Self::Receiving | Self::RepetitionWait)
    }

    /// For people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Garbage => "waiting for silence",
            Self::BufferWait => "waiting for a buffer",
            Self::Receiving => "receiving",
            Self::RepetitionWait => "waiting for a repetition",
            Self::DleWait => "waiting for DLE",
            Self::Sending => "sending",
            Self::Disturbed => "disturbed",
            Self::AcknowledgementWait => "waiting for acknowledgement",
        }
    }
}
