//! The front matter: what a case is about and the line it runs on.

use softplug_abi::{LineParameters, Parity};

use super::{Assignment, ModemLevels, Room};

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
    /// What the link is left with at the case's end, so that no other case can stand
    /// behind it on the open link: a hold, half a reception. Empty: nothing.
    pub leaves: String,
    /// The class that a byte of the case stands for.
    pub bytes: Option<ByteClass>,
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

impl From<LineParameters> for LineSettings {
    /// With a port that holds one character and tells of each at once.
    fn from(line: LineParameters) -> Self {
        let LineParameters { baud, data_bits, parity, stop_half_bits } = line;
        Self { baud, data_bits, parity, stop_half_bits, depth: 1, reaction: 0 }
    }
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
    /// The link's clock may stand at any time when it begins.
    pub later: bool,
    /// It may stand behind another case on one open link.
    pub after: bool,
    /// The host's rooms may be others.
    pub rooms: bool,
}

impl Permutations {
    /// Every way.
    pub const ALL: Self =
        Self { cuts: true, swap: true, twice: true, later: true, after: true, rooms: true };
    /// No way.
    pub const NONE: Self =
        Self { cuts: false, swap: false, twice: false, later: false, after: false, rooms: false };

    /// Each by its name in a trace, in canonical order.
    pub const fn named(self) -> [(&'static str, bool); 6] {
        [
            ("cuts", self.cuts),
            ("swap", self.swap),
            ("twice", self.twice),
            ("later", self.later),
            ("after", self.after),
            ("rooms", self.rooms),
        ]
    }
}

impl Default for Permutations {
    fn default() -> Self {
        Self::ALL
    }
}

/// A byte of a case that stands for a class: with each of the others the same must
/// happen, with that byte in place of the one that is written.
///
/// ```
/// use softplug_trace::ByteClass;
///
/// // Any byte but DLE, written as 55.
/// let class = ByteClass::new(0x55, |byte| byte != 0x10);
/// assert!(class.contains(0x55) && !class.contains(0x10));
/// assert_eq!(class.others().count(), 254);
/// assert_eq!(class.ranges(), [(0x00, 0x0F), (0x11, 0xFF)]);
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ByteClass {
    /// The byte as the case has it.
    pub written: u8,
    ranges: Vec<(u8, u8)>,
}

impl ByteClass {
    /// The bytes for which `contains` holds.
    pub fn new(written: u8, contains: impl Fn(u8) -> bool) -> Self {
        let mut ranges: Vec<(u8, u8)> = Vec::new();
        for byte in (0..=u8::MAX).filter(|byte| contains(*byte)) {
            match ranges.last_mut() {
                Some((_, last)) if *last + 1 == byte => *last = byte,
                _ => ranges.push((byte, byte)),
            }
        }
        Self { written, ranges }
    }

    /// Its bytes as ranges, each with its ends.
    pub fn ranges(&self) -> &[(u8, u8)] {
        &self.ranges
    }

    /// Whether the byte is of it.
    pub fn contains(&self, byte: u8) -> bool {
        self.ranges.iter().any(|(first, last)| (*first..=*last).contains(&byte))
    }

    /// All of it but the byte that is written.
    pub fn others(&self) -> impl Iterator<Item = u8> {
        (0..=u8::MAX).filter(|byte| *byte != self.written && self.contains(*byte))
    }
}
