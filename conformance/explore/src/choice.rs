//! What may happen next.

use softplug_abi::LineErrorKind;
use std::fmt;

/// What may happen next: the usual, or one of the faults and requests that are counted.
///
/// ```
/// use softplug_explore::Choice;
///
/// assert_eq!(Choice::Altered(1, 0x02).to_string(), "the character to 1 arrives as 02");
/// assert!(!Choice::Next.is_fault());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Choice {
    /// What is due next happens as it should.
    Next,
    /// The host of this end begins its next job.
    Begin(usize),
    /// The character on its way to this end is lost.
    Lost(usize),
    /// It arrives twice.
    Doubled(usize),
    /// It arrives as this one.
    Altered(usize, u8),
    /// It arrives damaged, and the port says so.
    Damaged(usize, Damage),
    /// It arrives just as the next timer of this end runs out.
    AtTimer(usize),
    /// It arrives just after that.
    AfterTimer(usize),
    /// It is read as late as the character behind it, and both are given as one.
    Late(usize),
    /// This character arrives that nobody sent.
    Inserted(usize, u8),
    /// The host of this end aborts the job under way.
    Abort(usize),
    /// It aborts the delivery under way.
    AbortDelivery(usize),
    /// It asks for a pause.
    Pause(usize),
    /// It ends the pause.
    Resume(usize),
    /// It goes on although the partner holds the line.
    Force(usize),
    /// The port of this end is gone.
    Down(usize),
    /// It is back.
    Up(usize),
    /// A new instance takes over at this end, with the saved state.
    Swap(usize),
    /// The host of this end lets what is delivered wait.
    Keep(usize),
    /// It puts all of it away.
    PutAway(usize),
}

/// How a character is damaged.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Damage {
    /// Its parity bit is wrong.
    Parity,
    /// The line was held low.
    Break,
}

impl Damage {
    pub(crate) fn kind(self) -> LineErrorKind {
        match self {
            Self::Parity => LineErrorKind::Parity,
            Self::Break => LineErrorKind::Break,
        }
    }
}

impl Choice {
    /// Whether it counts as one of the faults.
    pub fn is_fault(self) -> bool {
        !matches!(
            self,
            Self::Next | Self::Begin(_) | Self::Resume(_) | Self::Up(_) | Self::PutAway(_)
        )
    }

    /// Whether it is about what is due, or something else happens behind that.
    pub(crate) fn of_what_is_due(self) -> bool {
        matches!(
            self,
            Self::Next
                | Self::Lost(_)
                | Self::Doubled(_)
                | Self::Altered(..)
                | Self::Damaged(..)
                | Self::AtTimer(_)
                | Self::AfterTimer(_)
                | Self::Late(_)
        )
    }

    /// The end on whose way something goes wrong.
    pub(crate) fn way(self) -> Option<usize> {
        match self {
            Self::Lost(end)
            | Self::Doubled(end)
            | Self::Altered(end, _)
            | Self::Damaged(end, _)
            | Self::AtTimer(end)
            | Self::AfterTimer(end)
            | Self::Late(end)
            | Self::Inserted(end, _) => Some(end),
            _ => None,
        }
    }

    /// The end whose host or port is not as usual.
    pub(crate) fn asked(self) -> Option<usize> {
        match self {
            Self::Abort(end)
            | Self::AbortDelivery(end)
            | Self::Pause(end)
            | Self::Force(end)
            | Self::Down(end)
            | Self::Keep(end) => Some(end),
            _ => None,
        }
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Next => write!(f, "what is due happens"),
            Self::Begin(end) => write!(f, "the host of {end} begins its job"),
            Self::Lost(end) => write!(f, "the character to {end} is lost"),
            Self::Doubled(end) => write!(f, "the character to {end} arrives twice"),
            Self::Altered(end, byte) => {
                write!(f, "the character to {end} arrives as {byte:02X}")
            }
            Self::Damaged(end, Damage::Parity) => {
                write!(f, "the character to {end} has a wrong parity bit")
            }
            Self::Damaged(end, Damage::Break) => {
                write!(f, "a break instead of the character to {end}")
            }
            Self::AtTimer(end) => {
                write!(f, "the character to {end} arrives just as the timer runs out")
            }
            Self::AfterTimer(end) => {
                write!(f, "the character to {end} arrives just after the timer")
            }
            Self::Late(end) => {
                write!(f, "the character to {end} is read together with the one behind it")
            }
            Self::Inserted(end, byte) => write!(f, "{byte:02X} arrives at {end} out of nothing"),
            Self::Abort(end) => write!(f, "the host of {end} aborts the job"),
            Self::AbortDelivery(end) => write!(f, "the host of {end} aborts the delivery"),
            Self::Pause(end) => write!(f, "the host of {end} pauses the job"),
            Self::Resume(end) => write!(f, "the host of {end} goes on with the job"),
            Self::Force(end) => write!(f, "the host of {end} forces the hold"),
            Self::Down(end) => write!(f, "the port of {end} is gone"),
            Self::Up(end) => write!(f, "the port of {end} is back"),
            Self::Swap(end) => write!(f, "a new instance takes over at {end}"),
            Self::Keep(end) => write!(f, "the host of {end} lets deliveries wait"),
            Self::PutAway(end) => write!(f, "the host of {end} puts deliveries away"),
        }
    }
}
