//! The records behind a header: what has become of the slot since.

use crate::crc::crc32;

/// Times that a trial may be run at most.
pub const MOST_ATTEMPTS: u8 = 8;

/// Bytes of a record.
pub(crate) const RECORD: usize = 16;
/// Records behind a header.
pub(crate) const RECORDS: u8 = 32;

const CRC: usize = RECORD - 4;

/// What a slot's header and records say of it.
///
/// The example of [`Slots`](crate::Slots) shows the way of one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum State {
    /// A download began and has not been finished; no module is there.
    Writing,
    /// A whole module is there whose digest and signature were right. It is not run.
    Written,
    /// It is run for a trial, a bounded number of times, until it is confirmed or has failed.
    Trial {
        /// Times that it was run.
        attempts: u8,
        /// Times that it may be run: 1 to [`MOST_ATTEMPTS`].
        of: u8,
    },
    /// The trial went well: this is run.
    Confirmed,
    /// This is not run any more.
    Failed(Failure),
}

/// Why a slot has failed.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Failure {
    /// [`Slots::fail`](crate::Slots::fail) or [`Slots::go_back`](crate::Slots::go_back) said so.
    #[error("the unit was told that it has failed")]
    Told,
    /// It was run as often as a trial may be and never confirmed.
    #[error("its trial was run as often as it may be, and never confirmed")]
    AttemptsUsedUp,
    /// What was downloaded had another digest than was said.
    #[error("what came had another digest than was said")]
    Digest,
    /// On trial, the module did not fit to its digest or its signature any more.
    #[error("its module or signature was no longer right when its trial was to be run")]
    Unfit,
    /// On trial, no room was left to write down how it goes on.
    #[error("no record was left to count its trial with")]
    NoRecordLeft,
    /// A reason that this version does not know.
    #[error("of reason {0}, which this version does not know")]
    Other(u16),
}

impl Failure {
    const fn code(self) -> u16 {
        match self {
            Self::Told => 1,
            Self::AttemptsUsedUp => 2,
            Self::Digest => 3,
            Self::Unfit => 4,
            // Follows from the records and is never written.
            Self::NoRecordLeft => 0,
            Self::Other(code) => code,
        }
    }

    const fn of_code(code: u16) -> Self {
        match code {
            1 => Self::Told,
            2 => Self::AttemptsUsedUp,
            3 => Self::Digest,
            4 => Self::Unfit,
            code => Self::Other(code),
        }
    }
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Record {
    Written,
    Trial {
        of: u8,
    },
    Attempt,
    Confirmed,
    Failed(Failure),
    /// The slot is about to be erased for another module.
    Retired,
}

impl Record {
    pub(crate) fn write(self, generation: u32, number: u8) -> [u8; RECORD] {
        let (kind, value) = match self {
            Self::Written => (1, 0),
            Self::Trial { of } => (2, u16::from(of)),
            Self::Attempt => (3, 0),
            Self::Confirmed => (4, 0),
            Self::Failed(failure) => (5, failure.code()),
            Self::Retired => (6, 0),
        };
        let mut bytes = [0; RECORD];
        bytes[0] = kind;
        bytes[1] = number;
        bytes[2..4].copy_from_slice(&value.to_le_bytes());
        bytes[4..8].copy_from_slice(&generation.to_le_bytes());
        let crc = crc32(&bytes[..CRC]);
        bytes[CRC..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// None for whatever was not written as this record of this header.
    pub(crate) fn read(bytes: &[u8; RECORD], generation: u32, number: u8) -> Option<Self> {
        let value = u16::from_le_bytes([bytes[2], bytes[3]]);
        let record = match bytes[0] {
            1 => Self::Written,
            2 => Self::Trial {
                of: u8::try_from(value).ok().filter(|of| (1..=MOST_ATTEMPTS).contains(of))?,
            },
            3 => Self::Attempt,
            4 => Self::Confirmed,
            5 => Self::Failed(Failure::of_code(value)),
            6 => Self::Retired,
            _ => return None,
        };
        (record.write(generation, number) == *bytes).then_some(record)
    }
}

/// What follows from the records of a header, in their order.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Log {
    state: State,
    /// Erasures that were announced since the header was written.
    pub(crate) retired: u8,
    /// The first record that nothing was written into.
    pub(crate) next: u8,
}

impl Log {
    pub(crate) const fn new() -> Self {
        Self { state: State::Writing, retired: 0, next: 0 }
    }

    /// Confirmed and failed take effect whatever came before: a record that is lost, or read at one time only,
    /// takes nothing from those behind it.
    pub(crate) fn take(&mut self, record: Record) {
        self.retired += u8::from(record == Record::Retired);
        self.state = match (self.state, record) {
            (_, Record::Failed(failure)) => State::Failed(failure),
            (_, Record::Confirmed) => State::Confirmed,
            (State::Writing, Record::Written) => State::Written,
            (State::Writing | State::Written, Record::Trial { of }) => {
                State::Trial { attempts: 0, of }
            }
            (State::Trial { attempts, of }, Record::Attempt) => {
                State::Trial { attempts: attempts.saturating_add(1), of }
            }
            (state, Record::Written | Record::Trial { .. } | Record::Attempt | Record::Retired) => {
                state
            }
        };
    }

    pub(crate) const fn is_full(self) -> bool {
        self.next >= RECORDS
    }

    pub(crate) const fn state(self) -> State {
        match self.state {
            // Neither an attempt nor its end could be written down.
            State::Trial { .. } if self.is_full() => State::Failed(Failure::NoRecordLeft),
            state => state,
        }
    }
}
