//! Why something is not done, by who is to blame.

use crate::device::Geometry;
use crate::record::{Failure, MOST_ATTEMPTS};
use crate::signature::Signature;
use crate::slot::{LEAST_ROOM, Slot};

/// Why something is not done, by who is to blame. `E` is the device's own error.
///
/// ```
/// use softplug_unit_slots::{Error, Misuse, Refusal};
///
/// let error: Error<Misuse> = Refusal::OutOfOrder { expected: 512, offset: 1_024 }.into();
/// assert_eq!(error.to_string(), "the next byte is number 512, and the piece begins at 1024: send from there");
/// ```
#[derive(Debug, thiserror::Error)]
pub enum Error<E: core::error::Error + 'static> {
    /// Whoever downloads or drives the unit: it can do otherwise.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// Whoever set the unit up: options, or a device that holds something else.
    #[error(transparent)]
    SetUp(#[from] SetUpError),
    /// The device.
    #[error(transparent)]
    Device(#[from] Fault<E>),
}

/// What a sender did wrong, or did at the wrong time. Numbers are bytes.
///
/// The example of [`Error`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Refusal {
    /// The module is empty or longer than a slot has room for.
    #[error("a module has 1 to {room} bytes here, and this one {length}")]
    Length {
        /// What was said.
        length: u32,
        /// What fits.
        room: u32,
    },
    /// A signature is demanded and there is none.
    #[error("this unit takes no plug-in without a signature")]
    Unsigned,
    /// The unit does not know the key that the signature names.
    #[error("the plug-in is signed with a key that this unit does not trust")]
    UnknownKey,
    /// What was sent as a signature has another length.
    #[error("a signature has {bytes} bytes, and this {length}", bytes = Signature::BYTES)]
    SignatureLength {
        /// What was sent.
        length: usize,
    },
    /// The signature is not that of length and digest by this key.
    #[error("the signature does not fit to length and digest of the plug-in")]
    Signature,
    /// A trial must end first.
    #[error("slot {slot} is on trial: confirm it or fail it first")]
    TrialUnderWay {
        /// It.
        slot: Slot,
    },
    /// No download is under way, or no longer.
    #[error("no download is under way: begin it, again if the unit was reset or its memory failed")]
    NoDownload,
    /// Bytes before this piece are missing.
    #[error(
        "the next byte is number {expected}, and the piece begins at {offset}: send from there"
    )]
    OutOfOrder {
        /// Where the next piece begins.
        expected: u32,
        /// Where this one does.
        offset: u32,
    },
    /// The piece goes past the module's end.
    #[error("the module has {length} bytes, and the piece goes past that")]
    TooMuch {
        /// The module's length.
        length: u32,
    },
    /// The piece came before, with other bytes.
    #[error("byte {offset} came before, and was another one: begin the download again")]
    Different {
        /// The first byte that differs.
        offset: u32,
    },
    /// Bytes are missing at the end.
    #[error("{received} of {length} bytes have come: send the rest")]
    Incomplete {
        /// Bytes that have come.
        received: u32,
        /// The module's length.
        length: u32,
    },
    /// The whole module has another digest than was said when it began.
    #[error("the module that came has another digest than was said: begin the download again")]
    Digest,
    /// No slot holds a module that was downloaded and not tried yet.
    #[error("there is no module to try: download one first")]
    NothingToTry,
    /// What runs is not on trial.
    #[error("no slot is on trial, or it was not run since the unit started")]
    NotOnTrial,
    /// There is nothing that would run instead.
    #[error("the other slot holds no module that has been confirmed and is sound")]
    NoOther,
    /// No slot holds the module that is to run.
    #[error("no slot holds this plug-in: download it first")]
    NotHeld,
    /// The module that is to run is not whole.
    #[error("its download is not finished")]
    Unfinished,
    /// The module that is to run has failed.
    #[error("it has failed before ({0}): download it anew")]
    FailedBefore(Failure),
    /// The module that was to run is not the one that the memory gives.
    #[error("the memory gives another plug-in, or none: this one is not sound")]
    NotSound,
    /// The slot is the one that runs, or would.
    #[error("slot {slot} holds what runs, or is on trial")]
    InUse {
        /// It.
        slot: Slot,
    },
    /// The slot holds no module, or fewer bytes.
    #[error("slot {slot} holds no such bytes")]
    NoSuchBytes {
        /// It.
        slot: Slot,
    },
}

/// What is wrong with the set-up of a unit. Numbers are bytes.
///
/// The example of [`Error`] shows a message.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SetUpError {
    /// The device's sizes do not fit together, see [`Geometry`].
    #[error("a device with {0:?} cannot be: see what its fields must be")]
    Geometry(Geometry),
    /// Two slots of [`LEAST_ROOM`] do not fit.
    #[error(
        "two slots with {LEAST_ROOM} bytes for a module need {needed} bytes, and the device has {size}"
    )]
    TooSmall {
        /// What it has.
        size: u32,
        /// What it would need.
        needed: u64,
    },
    /// Trials with no or too many attempts.
    #[error("a trial is run 1 to {MOST_ATTEMPTS} times, and not {attempts}")]
    Attempts {
        /// What was asked for.
        attempts: u8,
    },
    /// Signatures are demanded and no key is there.
    #[error("the unit has no key, and takes nothing unsigned: it could never take a plug-in")]
    NoKeys,
    /// A key is none, or a weak one.
    #[error("key {number} of the unit, counted from 0, is no Ed25519 public key, or a weak one")]
    Key {
        /// Its place in the list.
        number: usize,
    },
    /// The slot was written in another format.
    #[error(
        "slot {slot} was written in format {found}, and this is format 1: clear it if it is not needed"
    )]
    OtherVersion {
        /// The slot.
        slot: Slot,
        /// The format.
        found: u16,
    },
    /// The slot was written with other sizes of the device.
    #[error("slot {slot} was written for other sizes of the device: clear it if it is not needed")]
    OtherGeometry {
        /// The slot.
        slot: Slot,
    },
}

/// What is wrong with a device.
///
/// The example of [`Error`] shows a message.
#[derive(Debug, thiserror::Error)]
pub enum Fault<E: core::error::Error + 'static> {
    /// It did not do what it was asked for.
    #[error("{doing} the memory at {at:#x} failed")]
    Failed {
        /// What it was asked for.
        doing: Doing,
        /// Where.
        at: u32,
        /// What its driver says.
        source: E,
    },
    /// It holds something else than was programmed.
    #[error("the memory at {at:#x} does not keep what is programmed: it is worn or protected")]
    NotKept {
        /// Where the bytes begin.
        at: u32,
    },
    /// The slot was erased as often as it may be.
    #[error(
        "slot {slot} was erased {erases} times, and {most} is the limit: exchange the unit's memory"
    )]
    Worn {
        /// The slot.
        slot: Slot,
        /// How often.
        erases: u32,
        /// The limit.
        most: u32,
    },
    /// The slot's records are used up; a new download has new ones.
    #[error("slot {slot} has no record left to write that down: download anew")]
    NoRecordLeft {
        /// The slot.
        slot: Slot,
    },
    /// There is no generation after this one.
    #[error("a slot has the highest generation that there is: clear it if it is not needed")]
    LastGeneration,
}

/// What a device was asked for.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Doing {
    /// Reading.
    #[error("reading")]
    Reading,
    /// Erasing.
    #[error("erasing")]
    Erasing,
    /// Programming.
    #[error("programming")]
    Programming,
}
