//! One table for all messages: type, name, fields and text in one place.

use softplug_abi::wire::Reader;
use softplug_abi::{Failure, LinkDownReason, MalformedReason, NoSpace, NoteLevel};

use super::codes::{Outcome, SlotState, SwapOutcome, WhenCode};
use super::field::Field;
use super::{Decode, Digest, Encode, encode};

macro_rules! messages {
    (
        $(#[$doc:meta])*
        pub enum $name:ident<'a> {
            $( $(#[$of:meta])* $kind:literal $variant:ident { $( $(#[$field_doc:meta])* $field:ident: $type:ty, )* } )*
        }
    ) => {
        $(#[$doc])*
        #[derive(Copy, Clone, PartialEq, Eq, Debug)]
        pub enum $name<'a> {
            $( $(#[$of])* $variant { $( $(#[$field_doc])* $field: $type, )* }, )*
        }

        impl $name<'_> {
            /// Type, name and fields of every message, in the order of the types.
            pub const TABLE: &'static [(u8, &'static str, &'static [&'static str])] = &[
                $( ($kind, stringify!($variant), &[$( stringify!($field), )*]), )*
            ];

            /// Its type.
            pub const fn kind(&self) -> u8 {
                match self { $( Self::$variant { .. } => $kind, )* }
            }
        }

        impl Encode for $name<'_> {
            fn encode(&self, buffer: &mut [u8]) -> Result<usize, NoSpace> {
                encode(self.kind(), buffer, |_writer| match self {
                    $( Self::$variant { $( $field, )* } => {
                        $( $field.write(_writer); )*
                    } )*
                })
            }
        }

        impl<'a> Decode<'a> for $name<'a> {
            fn decode(kind: u8, body: &'a [u8]) -> Result<Self, MalformedReason> {
                let mut reader = Reader::new(body);
                let message = match kind {
                    $( $kind => Self::$variant {
                        $( $field: <$type as Field<'a>>::read(&mut reader, stringify!($field)), )*
                    }, )*
                    unknown => return Err(MalformedReason::UnknownKind(u16::from(unknown))),
                };
                reader.end()?;
                Ok(message)
            }
        }
    };
}

messages! {
    /// What a server tells a unit.
    ///
    /// A job's number is the server's, never used twice and never 0. Positions count bytes
    /// of one pass, from 0.
    /// Fields are value records of the ABI.
    pub enum ToUnit<'a> {
        /// Say what you are: answered by [`ToServer::Unit`], and for each link its two
        /// [`ToServer::Slot`]s and [`ToServer::Link`].
        1 Query {}
        /// A plug-in follows, for that slot of the link which does not run.
        2 Download {
            /// The link.
            link: u8,
            /// Its length in bytes.
            length: u32,
            /// SHA-256 of it.
            digest: Digest,
            /// 32 bytes that name the key and 64 of the signature; empty: it is not signed.
            signature: &'a [u8],
        }
        /// A piece of it.
        3 Piece {
            /// The link.
            link: u8,
            /// Where it belongs.
            at: u32,
            /// The piece.
            bytes: &'a [u8],
        }
        /// It is there: verify it and keep it.
        4 Install {
            /// The link.
            link: u8,
        }
        /// Run the plug-in with this digest on a link.
        5 Open {
            /// The link.
            link: u8,
            /// Which plug-in; it is in one of the slots.
            digest: Digest,
            /// Its settings: name and value, each ended by a byte 00; or
            /// [`KEPT_SETTINGS`](crate::KEPT_SETTINGS).
            settings: &'a [u8],
        }
        /// Let what the port has been given leave, then close the link.
        6 Close {
            /// The link.
            link: u8,
        }
        /// A job begins.
        7 Begin {
            /// The link.
            link: u8,
            /// Its number.
            job: u64,
            /// Place of its kind in the manifest.
            kind: u16,
            /// How many bytes it has; `u64::MAX`: not known.
            size: u64,
            /// It is fed once as a check, then from the start.
            check: bool,
            /// Its fields.
            fields: &'a [u8],
        }
        /// Data of the job, as far as [`ToServer::Credit`] allows.
        8 Data {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
            /// 0: the first time; 1: behind a good check.
            pass: u8,
            /// Where it stands in the job.
            at: u64,
            /// The data.
            bytes: &'a [u8],
        }
        /// That was all.
        9 End {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
            /// 0: the first time; 1: behind a good check.
            pass: u8,
            /// How many bytes there were.
            size: u64,
        }
        /// There is no more: its source failed.
        10 Fail {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
            /// Why, in words.
            why: &'a str,
        }
        /// Ask for a pause of the job.
        11 Pause {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
        }
        /// End the pause.
        12 Resume {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
        }
        /// Abort the job; with 0, the delivery under way.
        13 Abort {
            /// The link.
            link: u8,
            /// The job, or 0.
            job: u64,
        }
        /// Go on although the machine holds the line.
        14 ForceResume {
            /// The link.
            link: u8,
        }
        /// The answer to a request.
        15 Answer {
            /// The link.
            link: u8,
            /// Which request.
            request: u32,
            /// Why it is refused; `None`: here is what was asked for.
            refused: Option<Failure>,
            /// These are the last bytes of it; else more of the same answer follows.
            is_last: bool,
            /// What was asked for.
            bytes: &'a [u8],
        }
        /// Bytes of a delivery have been put away; the unit may forget them.
        16 Stored {
            /// The link.
            link: u8,
            /// The delivery.
            delivery: u32,
            /// All before this position.
            until: u64,
            /// Its end has been noted, too.
            is_whole: bool,
        }
        /// The end of a job has been noted; the unit may forget it.
        17 Noted {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
        }
        /// Put another plug-in in the place of the running one.
        18 Swap {
            /// The link.
            link: u8,
            /// Which; it is in the slot that does not run.
            digest: Digest,
            /// When.
            when: WhenCode,
            /// On trial for so many events …
            events: u64,
            /// … and for so many µs, until both have passed.
            span: u64,
            /// Its settings: name and value, each ended by a byte 00; or
            /// [`KEPT_SETTINGS`](crate::KEPT_SETTINGS).
            settings: &'a [u8],
        }
        /// Give up a swap that waits.
        19 CancelSwap {
            /// The link.
            link: u8,
        }
        /// Close the link's port and open it again.
        20 Reopen {
            /// The link.
            link: u8,
        }
        /// End the link's plug-in at once, whatever it is doing: it has ended by a fault then. *Open*
        /// starts it again.
        21 Halt {
            /// The link.
            link: u8,
            /// Why, in words.
            why: &'a str,
        }
    }
}

impl ToUnit<'_> {
    /// The type of [`ToUnit::Open`], as [`ToServer::Refused`] names it.
    pub const OPEN: u8 = Self::Open { link: 0, digest: [0; 32], settings: &[] }.kind();
    /// The type of [`ToUnit::Begin`].
    pub const BEGIN: u8 =
        Self::Begin { link: 0, job: 0, kind: 0, size: 0, check: false, fields: &[] }.kind();
    /// The type of [`ToUnit::Swap`].
    pub const SWAP: u8 = Self::Swap {
        link: 0,
        digest: [0; 32],
        when: WhenCode::Idle,
        events: 0,
        span: 0,
        settings: &[],
    }
    .kind();

    /// The link that it is for; `None`: the unit.
    pub fn link(&self) -> Option<u8> {
        match *self {
            Self::Query {} => None,
            Self::Download { link, .. }
            | Self::Piece { link, .. }
            | Self::Install { link, .. }
            | Self::Open { link, .. }
            | Self::Close { link, .. }
            | Self::Begin { link, .. }
            | Self::Data { link, .. }
            | Self::End { link, .. }
            | Self::Fail { link, .. }
            | Self::Pause { link, .. }
            | Self::Resume { link, .. }
            | Self::Abort { link, .. }
            | Self::ForceResume { link, .. }
            | Self::Answer { link, .. }
            | Self::Stored { link, .. }
            | Self::Noted { link, .. }
            | Self::Swap { link, .. }
            | Self::CancelSwap { link, .. }
            | Self::Reopen { link, .. }
            | Self::Halt { link, .. } => Some(link),
        }
    }
}

impl ToServer<'_> {
    /// The link that it is about; `None`: the unit.
    pub fn link(&self) -> Option<u8> {
        match *self {
            Self::Unit { .. } => None,
            Self::Refused { link, .. } => (link != u8::MAX).then_some(link),
            Self::Slot { link, .. }
            | Self::Downloaded { link, .. }
            | Self::Installed { link, .. }
            | Self::NotInstalled { link, .. }
            | Self::Link { link, .. }
            | Self::Up { link, .. }
            | Self::Down { link, .. }
            | Self::Credit { link, .. }
            | Self::Progress { link, .. }
            | Self::Rewind { link, .. }
            | Self::Ended { link, .. }
            | Self::Delivery { link, .. }
            | Self::Delivered { link, .. }
            | Self::DeliveryEnded { link, .. }
            | Self::Request { link, .. }
            | Self::Withdrawn { link, .. }
            | Self::Note { link, .. }
            | Self::State { link, .. }
            | Self::Fault { link, .. }
            | Self::Swapped { link, .. }
            | Self::Counters { link, .. }
            | Self::Told { link, .. } => Some(link),
        }
    }
}

messages! {
    /// What a unit tells its server.
    pub enum ToServer<'a> {
        /// What it is.
        1 Unit {
            /// How many links it has; they are numbered from 0.
            links: u8,
            /// Its serial number or the like: the same after each start.
            serial: u64,
            /// Its name.
            name: &'a str,
        }
        /// What is in a link's slot; also when what runs on trial has proved itself, or has not.
        2 Slot {
            /// The link.
            link: u8,
            /// 0 is A, 1 is B.
            slot: u8,
            /// What it holds.
            state: SlotState,
            /// The plug-in's length in bytes.
            length: u32,
            /// SHA-256 of it.
            digest: Digest,
            /// How often its memory has been erased.
            erased: u32,
            /// How often it may be.
            erasable: u32,
        }
        /// So much of the plug-in is in the memory: the next piece may come.
        3 Downloaded {
            /// The link.
            link: u8,
            /// Bytes.
            until: u32,
        }
        /// It is there, verified, in this slot.
        4 Installed {
            /// The link.
            link: u8,
            /// Which.
            slot: u8,
        }
        /// It was not taken.
        5 NotInstalled {
            /// The link.
            link: u8,
            /// Why, in words.
            why: &'a str,
        }
        /// What a link is doing: in answer to a query. Jobs and deliveries go on from here.
        6 Link {
            /// The link.
            link: u8,
            /// Its port is open.
            is_up: bool,
            /// The plug-in that runs; all zero without.
            digest: Digest,
            /// The job under way, or one whose end is not noted yet; 0 without.
            job: u64,
            /// 0: the first time; 1: behind a good check.
            pass: u8,
            /// All of this pass's data before this position has come.
            received: u64,
            /// Its end has come, too.
            is_whole: bool,
            /// The link's name.
            name: &'a str,
        }
        /// The link's port is open.
        7 Up {
            /// The link.
            link: u8,
        }
        /// It is not.
        8 Down {
            /// The link.
            link: u8,
            /// Why.
            reason: LinkDownReason,
            /// When it is tried again, in µs from now.
            retry_in: u64,
            /// Why, in words.
            detail: &'a str,
        }
        /// Data of the job may be sent up to here.
        9 Credit {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
            /// 0: the first time; 1: behind a good check.
            pass: u8,
            /// All before this position has come: the server may forget it.
            received: u64,
            /// Up to here it may send.
            until: u64,
        }
        /// How far the job is.
        10 Progress {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
            /// Bytes of its data that the plug-in took.
            taken: u64,
            /// Characters that may have left.
            maybe_left: u64,
            /// Characters that surely have.
            surely_left: u64,
            /// Bytes of its data that surely have left.
            bytes_left: u64,
            /// Bytes in the unit's buffer.
            level: u32,
            /// The machine holds the line.
            is_held: bool,
            /// The job waits for data while the line stands idle.
            is_starved: bool,
        }
        /// The job's check was good: its data is needed again, from the start.
        11 Rewind {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
        }
        /// A job has ended. Said again in each session until it is noted.
        12 Ended {
            /// The link.
            link: u8,
            /// The job.
            job: u64,
            /// How.
            outcome: Outcome,
            /// Why, if it is not done.
            failure: Option<Failure>,
            /// The protocol's own code, 0 without.
            status: u16,
            /// Line and column of the fault, if the check failed.
            line: u32,
            /// In bytes from 1; 0 without.
            column: u32,
            /// Bytes of its data that the plug-in took.
            taken: u64,
            /// Bytes that left for it, as the plug-in counts.
            sent: u64,
            /// Characters that may have left.
            maybe_left: u64,
            /// Characters that surely have.
            surely_left: u64,
            /// Bytes of its data of which some may have left.
            bytes_maybe_left: u64,
            /// Bytes of its data that surely have.
            bytes_surely_left: u64,
            /// Why its source failed, in words.
            why: &'a str,
        }
        /// Something comes from the machine. Said again in each session until all of it is stored.
        13 Delivery {
            /// The link.
            link: u8,
            /// Its number.
            delivery: u32,
            /// The job that it answers, or 0.
            job: u64,
            /// Where its data goes on: what is before has been stored.
            at: u64,
            /// Its name, as the machine gave it; empty where none is known yet.
            name: &'a str,
        }
        /// Its data.
        14 Delivered {
            /// The link.
            link: u8,
            /// The delivery.
            delivery: u32,
            /// Where it stands in it.
            at: u64,
            /// The data.
            bytes: &'a [u8],
        }
        /// It is over.
        15 DeliveryEnded {
            /// The link.
            link: u8,
            /// The delivery.
            delivery: u32,
            /// `None`: complete.
            failure: Option<Failure>,
            /// The protocol's own code, 0 without.
            status: u16,
            /// How many bytes it has.
            size: u64,
        }
        /// The machine asks for something. Said again in each session until it is answered.
        16 Request {
            /// The link.
            link: u8,
            /// Its number.
            request: u32,
            /// Place of its kind in the manifest.
            kind: u16,
            /// Its fields.
            fields: &'a [u8],
        }
        /// It no longer does.
        17 Withdrawn {
            /// The link.
            link: u8,
            /// Which request.
            request: u32,
        }
        /// The plug-in says something; where none runs, the unit says why.
        18 Note {
            /// The link.
            link: u8,
            /// How grave it is.
            level: NoteLevel,
            /// Its code in the manifest.
            code: u16,
            /// Its text.
            text: &'a str,
        }
        /// The state that the plug-in is in.
        19 State {
            /// The link.
            link: u8,
            /// Its name.
            name: &'a str,
        }
        /// The plug-in has ended by a fault. The port stays open, nothing is read or sent.
        20 Fault {
            /// The link.
            link: u8,
            /// What went wrong, in words.
            what: &'a str,
        }
        /// What came of a swap.
        21 Swapped {
            /// The link.
            link: u8,
            /// What.
            outcome: SwapOutcome,
            /// For how many µs the link stood still.
            pause: u64,
            /// Why not, in words.
            why: &'a str,
        }
        /// The link's counters since the unit was started.
        22 Counters {
            /// The link.
            link: u8,
            /// Good bytes received.
            bytes_in: u64,
            /// Bytes that the port took.
            bytes_out: u64,
            /// How often the machine held us.
            holds: u64,
            /// For how many µs in all.
            held: u64,
            /// How often a job waited for data while the line stood idle.
            starved: u64,
            /// For how many µs in all.
            starved_for: u64,
            /// Damaged characters, overruns and breaks.
            line_errors: u64,
        }
        /// A message that could not be carried out.
        23 Refused {
            /// Its type.
            message: u8,
            /// The link, or 255.
            link: u8,
            /// The job, or 0.
            job: u64,
            /// Why, in words.
            why: &'a str,
        }
        /// That was all that a query is answered with, for this link.
        24 Told {
            /// The link.
            link: u8,
        }
    }
}
