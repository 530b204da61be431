//! The states of the page's diagrams, and what a station knows in them.

use super::Fault;
use super::frame::Incoming;
use super::rules::Rule;
use softplug_abi::Micros;

/// Where a station is. Deadlines are set when the mark that they count from has left.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum State {
    Idle,
    /// Our STX waits for its answer.
    WaitingForDle {
        mark: u64,
        qvz: Option<Micros>,
        stx_seen: bool,
    },
    /// The block goes out.
    Sending {
        mark: u64,
    },
    /// The block was stopped: ZVZ of silence.
    Disturbed {
        silence: Micros,
    },
    WaitingForAcknowledgement {
        qvz: Micros,
    },
    /// An STX has come and there is no room for a block.
    WaitingForBuffer {
        until: Micros,
        look: Micros,
    },
    /// Other characters came while it waited: ZVZ of silence.
    TurnedAway {
        silence: Micros,
    },
    /// Our DLE has not left.
    Granting {
        mark: u64,
    },
    Receiving {
        zvz: Micros,
    },
    WaitingForRepetition {
        mark: u64,
        bwz: Option<Micros>,
    },
    /// Other characters in idle: ZVZ of silence.
    Garbage {
        silence: Micros,
    },
}

impl State {
    /// When the state's timer runs out.
    pub(super) fn deadline(&self) -> Option<Micros> {
        match *self {
            Self::Idle | Self::Sending { .. } | Self::Granting { .. } => None,
            Self::WaitingForDle { qvz, .. } => qvz,
            Self::Disturbed { silence }
            | Self::TurnedAway { silence }
            | Self::Garbage { silence } => Some(silence),
            Self::WaitingForAcknowledgement { qvz } => Some(qvz),
            Self::WaitingForBuffer { until, look } => Some(until.min(look)),
            Self::Receiving { zvz } => Some(zvz),
            Self::WaitingForRepetition { bwz, .. } => bwz,
        }
    }

    /// A job is on the line.
    pub(super) fn is_of_sender(&self) -> bool {
        matches!(
            self,
            Self::WaitingForDle { .. }
                | Self::Sending { .. }
                | Self::Disturbed { .. }
                | Self::WaitingForAcknowledgement { .. }
        )
    }
}

/// The job under way.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    /// Data of the blocks that are not acknowledged; the first is next.
    pub(super) blocks: Vec<Vec<u8>>,
    /// Blocks before them were acknowledged.
    pub(super) is_split: bool,
    /// Why the next STX is sent.
    pub(super) why: Rule,
    /// The first of them was searched for what cannot be sent.
    pub(super) is_looked_through: bool,
    /// It gave way in a conflict and begins again.
    pub(super) gave_way: bool,
    pub(super) is_paused: bool,
    /// STX of this transmission attempt.
    pub(super) setups: i64,
    /// Transmission attempts that have failed.
    pub(super) failures: i64,
}

/// A reception, with all its repetitions.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Reception {
    /// The last block.
    pub(super) incoming: Incoming,
    /// The first error of all blocks.
    pub(super) error: Option<Fault>,
    /// The last block is damaged.
    pub(super) is_damaged: bool,
    /// Bad blocks so far.
    pub(super) bad: i64,
    /// Our own job gave way for it.
    pub(super) in_conflict: bool,
}

impl Reception {
    pub(super) fn new(incoming: Incoming) -> Self {
        Self { incoming, error: None, is_damaged: false, bad: 0, in_conflict: false }
    }

    /// The last block is damaged; the first error counts.
    pub(super) fn damage(&mut self, fault: Fault) {
        self.is_damaged = true;
        self.error.get_or_insert(fault);
    }
}
