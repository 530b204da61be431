//! The front matter: what a case is about and the line it runs on.

use super::{Assignment, ModemLevels};

/// A case's properties.
///
/// ```
/// use softplug_trace::{FrontMatter, Level};
///
/// let front = FrontMatter::parse("\
/// id: echo.tx.first
/// title: The first byte leaves at once
/// profile: echo
/// clauses: echo.tx.at-once
/// level: must
/// line: 9600 8N1 depth=1 reaction=0
/// since: 1
/// origin: hand-written
/// ")?;
/// assert_eq!((front.level, front.clauses), (Level::Must, vec!["echo.tx.at-once".to_owned()]));
/// # Ok::<(), softplug_trace::ParseError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FrontMatter {
    /// Stable readable name: the profile, a dot, and at least one more part.
    pub id: String,
    /// One sentence for people.
    pub title: String,
    /// The profile that the case belongs to.
    pub profile: String,
    /// The clauses that the case shows, at least one.
    pub clauses: Vec<String>,
    /// How much the clauses bind.
    pub level: Level,
    /// Which side of a limit the case stands on, if it is one of a pair.
    pub edge: Option<Edge>,
    /// The serial line.
    pub line: LineSettings,
    /// Settings of the plug-in, as text; names and units are the profile's.
    pub config: Vec<Assignment>,
    /// Rooms that the host gives at the start.
    pub room: Room,
    /// Modem lines at the start, inputs only. Empty: the link has none.
    pub modem: ModemLevels,
    /// The revision of the profile that brought the case, from 1.
    pub since: u32,
    /// Where the case comes from.
    pub origin: Origin,
    /// How the case may be varied.
    pub permute: Permutations,
}

impl FrontMatter {
    /// Reads front matter that stands alone, with or without the line `---` that
    /// ends it. What follows that line is not looked at.
    ///
    /// # Errors
    /// The first fault, with its line and column.
    pub fn parse(text: &str) -> Result<Self, crate::ParseError> {
        crate::parse::front_matter_alone(text)
    }
}

/// How much a clause binds.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Level {
    /// Failing it fails the run.
    Must,
    /// Failing it warns.
    Should,
    /// Failing it informs.
    May,
}

impl Level {
    /// The name in a trace.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Must => "must",
            Self::Should => "should",
            Self::May => "may",
        }
    }
}

/// Which side of a limit a case stands on.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Edge {
    /// The last tick before the limit.
    Before,
    /// The first tick after the limit.
    After,
}

impl Edge {
    /// The name in a trace.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::After => "after",
        }
    }
}

/// The serial line and the port that the plug-in's bytes go through.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct LineSettings {
    /// Bits per second. 0: the rate is unknown and characters take no time.
    pub baud: u32,
    /// 5 to 8.
    pub data_bits: u8,
    /// The parity bit.
    pub parity: Parity,
    /// Stop bits in halves: 2, 3 or 4.
    pub stop_half_bits: u8,
    /// Pacing depth: characters that the port may hold, at least 1.
    pub depth: u32,
    /// µs from the end of a received character to the event.
    pub reaction: u32,
}

/// The parity bit.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Parity {
    /// No parity bit.
    None,
    /// The number of ones is even.
    Even,
    /// The number of ones is odd.
    Odd,
    /// The parity bit is 1.
    Mark,
    /// The parity bit is 0.
    Space,
}

impl Parity {
    /// The letter in `8N1`.
    pub const fn letter(self) -> char {
        match self {
            Self::None => 'N',
            Self::Even => 'E',
            Self::Odd => 'O',
            Self::Mark => 'M',
            Self::Space => 'S',
        }
    }
}

/// Room in bytes; `None` leaves it to whoever runs the case.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Room {
    /// Room to transmit.
    pub transmit: Option<u32>,
    /// Room to deliver.
    pub delivery: Option<u32>,
}

/// Where a case comes from.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Origin {
    /// Written by a person from the protocol's text.
    HandWritten,
    /// Recorded on a real line.
    Recorded {
        /// The device on the other end.
        device: String,
        /// `YYYY-MM-DD`.
        date: String,
        /// What recorded it.
        tool: String,
    },
    /// Written by a program.
    Generated {
        /// The program.
        generator: String,
        /// What it was started with.
        seed: u64,
    },
}

/// How a case may be varied without a change of its result.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Permutations {
    /// Bytes of one time may be cut differently.
    pub cuts: bool,
    /// The instance may be saved and restored after any event.
    pub swap: bool,
    /// The case may run twice in one instance.
    pub twice: bool,
}

impl Permutations {
    /// Every way.
    pub const ALL: Self = Self { cuts: true, swap: true, twice: true };
    /// No way.
    pub const NONE: Self = Self { cuts: false, swap: false, twice: false };
}

impl Default for Permutations {
    fn default() -> Self {
        Self::ALL
    }
}
