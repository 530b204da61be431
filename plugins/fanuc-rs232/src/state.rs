//! The states that people are told of.

/// What the converter is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum State {
    Idle,
    Capturing,
    Holding,
    Answering,
    Checking,
    WaitingForDc1,
    Sending,
    Held,
    Paused,
    Ending,
    Stopping,
}

impl State {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Capturing => "capturing",
            Self::Holding => "holding",
            Self::Answering => "feeding packets",
            Self::Checking => "checking",
            Self::WaitingForDc1 => "waiting for DC1",
            Self::Sending => "sending",
            Self::Held => "held",
            Self::Paused => "paused",
            Self::Ending => "waiting for DC3",
            Self::Stopping => "stopping",
        }
    }
}
