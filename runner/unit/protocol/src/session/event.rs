//! Who is at the ends of a session, what becomes of it, and why.

use thiserror::Error;

/// Which end of the uplink.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Role {
    /// The gateway: it calls.
    Server,
    /// The front-end unit: it is called.
    Unit,
}

/// Who is at an end, new at each start of that end: a number that nobody else has, at random.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub struct Identity(pub u64);

/// Why a unit refuses.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum RefuseReason {
    /// Another server has a session.
    Busy,
    /// The frame is of another version of the protocol.
    Version,
    /// There is no session of this number.
    NoSession,
}

impl RefuseReason {
    pub(super) const ALL: [Self; 3] = [Self::Busy, Self::Version, Self::NoSession];

    pub(super) const fn code(self) -> u8 {
        self as u8 + 1
    }
}

/// Why a session has ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum EndReason {
    /// The uplink was lost.
    #[error("the uplink was lost")]
    Uplink,
    /// Nothing came for 3 s.
    #[error("nothing was heard of the other side")]
    Silence,
    /// The unit knows nothing of it: it was started anew.
    #[error("the unit has no such session any more")]
    Unknown,
    /// The other side confirmed what was never sent.
    #[error("the other side confirmed what was never sent to it")]
    Broken,
    /// What was sent was not confirmed for 10 s, however often it was sent.
    #[error("the other side does not confirm what is sent to it")]
    Unconfirmed,
    /// This side ended it: see [`Session::end`](crate::Session::end).
    #[error("it was ended here")]
    Here,
}

/// What became of a session.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum SessionEvent {
    /// It has begun, and whichever there was before has ended. Nothing of that one is sent any
    /// more.
    Began {
        /// Who is at the other end.
        peer: Identity,
    },
    /// It has ended.
    Ended(EndReason),
    /// The unit was called and refuses. It is called again.
    Refused(RefuseReason),
}

/// A message that cannot be sent.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum SessionError {
    /// Too much is under way: again, when some of it is confirmed.
    #[error("too much is under way")]
    Full,
    /// It is longer than a frame that the other side takes.
    #[error("a message is longer than the other side takes")]
    TooLong,
    /// There is no session.
    #[error("there is no session")]
    NoSession,
}
