//! The states that people are told of.

/// What the converter is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Name {
    Idle,
    Receiving,
    Stopped,
    Checking,
    Sending,
    WaitingForXon,
    Held,
    Paused,
    Stopping,
}

impl Name {
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Receiving => "receiving",
            Self::Stopped => "stopped",
            Self::Checking => "checking",
            Self::Sending => "sending",
            Self::WaitingForXon => "waiting for XON",
            Self::Held => "held",
            Self::Paused => "paused",
            Self::Stopping => "stopping",
        }
    }
}
