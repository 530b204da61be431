//! What a station did and saw.

use softplug_abi::Micros;

use super::faults::Fault;

/// A station's account.
///
/// The example of [`Station`](super::Station) shows one.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// The good blocks, in order.
    pub received: Vec<Received>,
    /// Its own blocks that are done or given up, in order.
    pub sent: Vec<Sent>,
    /// When each character that acknowledges a good block had left, with its
    /// place in `received`.
    pub acknowledged: Vec<(Micros, usize)>,
    /// STXs that have left.
    pub stx: u32,
    /// NAKs that have left.
    pub naks: u32,
    /// NAKs that came.
    pub naks_received: u32,
    /// Blocks that were begun, repetitions included.
    pub blocks_begun: u32,
    /// Own STXs answered by STX.
    pub conflicts: u32,
    /// All that went wrong, in order, mended or not.
    pub errors: Vec<(Micros, Error)>,
    /// The faults that were made on purpose.
    pub faults: Vec<(Micros, Fault)>,
    /// The largest lateness of the station itself: how long after an event was
    /// due it was handled. Zero in virtual time.
    pub late: Micros,
}

/// A good block that came.
///
/// The example of [`Station`](super::Station) shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Received {
    /// When its last character had come.
    pub at: Micros,
    /// Its data.
    pub data: Vec<u8>,
}

/// A block of its own that is done or given up.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::r3964::{Error, Options, Station};
///
/// // Nobody answers: two STXs, 2 s apart, and 2 s later the block is given up.
/// let mut station = Station::new(Options { setup_attempts: 2, ..Options::default() })?;
/// station.send(Micros::from_secs(1), b"123".to_vec());
/// station.advance(Micros::from_secs(9));
/// let sent = &station.report().sent[0];
/// assert_eq!((sent.stx, sent.blocks), (2, 0));
/// assert_eq!(sent.result, Err(Error::SetUpNoAnswer));
/// # Ok::<(), softplug_machines::r3964::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Sent {
    /// Its data.
    pub data: Vec<u8>,
    /// When its first STX was given to the transmitter.
    pub begun: Micros,
    /// When it was acknowledged or given up.
    pub ended: Micros,
    /// STXs for it.
    pub stx: u32,
    /// Whole blocks begun for it.
    pub blocks: u32,
    /// Whether it was acknowledged.
    pub result: Result<(), Error>,
}

/// What goes wrong, by the numbers of Siemens' manuals.
///
/// ```
/// use softplug_machines::r3964::Error;
///
/// assert_eq!(Error::Check.status(), 0x0808);
/// assert_eq!(Error::Check.to_string(), "the block check character is wrong");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Error {
    /// STX was answered by NAK or a wrong character.
    #[error("STX was answered by NAK or a wrong character")]
    SetUpRefused,
    /// STX was not answered.
    #[error("STX was not answered in time")]
    SetUpNoAnswer,
    /// A character came while a block was being sent.
    #[error("a character came while a block was being sent")]
    Disturbed,
    /// NAK came while a block was being sent.
    #[error("NAK came while a block was being sent")]
    Stopped,
    /// A block was answered by NAK or a wrong character.
    #[error("the block was answered by NAK or a wrong character")]
    EndRefused,
    /// A block was not answered.
    #[error("the block was not answered in time")]
    EndNoAnswer,
    /// Both sides have high priority, or no rule.
    #[error("both sides insisted on sending")]
    BothHigh,
    /// Both sides have low priority.
    #[error("both sides gave way")]
    BothLow,
    /// Stray characters while idle.
    #[error("stray characters while idle")]
    IdleGarbage,
    /// A DLE was followed by neither DLE nor ETX.
    #[error("a DLE in the block was followed by neither DLE nor ETX")]
    LoneDle,
    /// A gap in a block was longer than ZVZ.
    #[error("the gap between two characters was too long")]
    CharacterDelay,
    /// The block check character is wrong.
    #[error("the block check character is wrong")]
    Check,
    /// There was no buffer in time.
    #[error("there was no buffer in time")]
    NoBuffer,
    /// A character was damaged on the line.
    #[error("a character was damaged on the line")]
    Line,
    /// The other side sent a break.
    #[error("the other side sent a break")]
    Break,
    /// A block was longer than it may be.
    #[error("the block was longer than it may be")]
    TooLong,
    /// BWZ ran out.
    #[error("the block was not repeated in time")]
    BlockWait,
}

impl Error {
    /// Event class and number, as `0xCCNN`; 0 where there is none.
    pub fn status(self) -> u16 {
        match self {
            Self::SetUpRefused => 0x0702,
            Self::SetUpNoAnswer => 0x0703,
            Self::Disturbed => 0x0704,
            Self::Stopped => 0x0705,
            Self::EndRefused => 0x0706,
            Self::EndNoAnswer => 0x0707,
            Self::BothHigh => 0x070B,
            Self::BothLow => 0x070C,
            Self::IdleGarbage => 0x0802,
            Self::LoneDle => 0x0805,
            Self::CharacterDelay => 0x0806,
            Self::Check => 0x0808,
            Self::NoBuffer => 0x080A,
            Self::Line => 0x080C,
            Self::Break => 0x080D,
            Self::TooLong | Self::BlockWait => 0,
        }
    }
}
