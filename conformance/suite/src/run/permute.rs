//! The ways in which one trace is run, and their names.

use softplug_abi::Micros;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// One way to run a trace. The name stands behind the trace's id: `ID/cut:1`.
///
/// ```
/// use softplug_conformance::Permutation;
///
/// assert_eq!("cut:random-07".parse(), Ok(Permutation::CutRandom(7)));
/// assert_eq!(Permutation::SwapAfter(12).to_string(), "swap:12");
/// let both = Permutation::both(Permutation::CutSingly, Permutation::SwapAll);
/// assert_eq!("cut:1+swap:all".parse(), Ok(both));
/// ```
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Permutation {
    /// `uncut`: as it is written.
    Uncut,
    /// `late`, `late:N`: all inputs with a window, or only the Nth of them, at
    /// the window's end.
    Late(Option<u32>),
    /// `cut:1`: bytes of one time one by one.
    CutSingly,
    /// `cut:whole`: bytes of one time at once.
    CutWhole,
    /// `cut:random-NN`: bytes of one time cut at random places.
    CutRandom(u8),
    /// `twice`: in an instance that has run it before, closed and opened again.
    Twice,
    /// `swap:all`: saved and restored into a fresh instance after every event.
    SwapAll,
    /// `swap:N`: saved and restored only at the Nth place.
    SwapAfter(u32),
    /// `later:2^31us` and the like: the link's clock stands there when it is opened.
    Later(Clock),
    /// `idle:2^31us` and the like: on a link that has been open and idle until then.
    Idle(Clock),
    /// `rooms:small` and the like: the host has other rooms.
    Rooms(Rooms),
    /// `after:ID`: on the same open link behind another case.
    After(Arc<str>),
    /// `again:N`: on the same open link behind itself, N times.
    Again(u32),
    /// `byte:5B`: with another byte of the class that the case names.
    Byte(u8),
    /// `A+B`: in two ways at once.
    Both(Arc<[Self; 2]>),
}

/// Where a link's clock stands when a case begins.
///
/// ```
/// use softplug_conformance::{Clock, Permutation};
///
/// assert_eq!(Permutation::Later(Clock::Month).to_string(), "later:31d");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Clock {
    /// It passes 2³¹ µs (35 minutes) in the middle of the case.
    HalfWord,
    /// It passes 2³² µs (71 minutes) in the middle of the case.
    Word,
    /// It passes 2³² ms (49.7 days) in the middle of the case.
    Millis,
    /// At 31 days.
    Month,
    /// At ten years.
    Years,
}

impl Clock {
    pub(crate) const ALL: [Self; 5] =
        [Self::HalfWord, Self::Word, Self::Millis, Self::Month, Self::Years];

    const fn name(self) -> &'static str {
        match self {
            Self::HalfWord => "2^31us",
            Self::Word => "2^32us",
            Self::Millis => "2^32ms",
            Self::Month => "31d",
            Self::Years => "10y",
        }
    }

    /// The link's time at which a case begins whose middle is at `middle`.
    pub(crate) fn start(self, middle: Micros) -> Micros {
        const DAY: Micros = Micros::from_secs(86_400);
        let passing = |at: i64| Micros(at - middle.0).max(Micros::ZERO);
        match self {
            Self::HalfWord => passing(1 << 31),
            Self::Word => passing(1 << 32),
            Self::Millis => passing(1_000 << 32),
            Self::Month => Micros(31 * DAY.0),
            Self::Years => Micros(3_653 * DAY.0),
        }
    }
}

/// Rooms of a host other than those that a case begins with.
///
/// ```
/// use softplug_conformance::{Permutation, Rooms};
///
/// assert_eq!("rooms:odd".parse(), Ok(Permutation::Rooms(Rooms::Odd)));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Rooms {
    /// A transmit queue of 64 bytes.
    Small,
    /// A transmit queue of 257 bytes, 4,099 bytes for deliveries.
    Odd,
    /// 65,536 bytes for either.
    Large,
    /// What is delivered is put away byte by byte.
    Drips,
    /// A job's data are given seven bytes at a time, however many are wanted.
    Sips,
}

impl Rooms {
    pub(crate) const ALL: [Self; 5] =
        [Self::Small, Self::Odd, Self::Large, Self::Drips, Self::Sips];

    const fn name(self) -> &'static str {
        match self {
            Self::Small => "small",
            Self::Odd => "odd",
            Self::Large => "large",
            Self::Drips => "drips",
            Self::Sips => "sips",
        }
    }

    /// Room to transmit and room for deliveries, where they are others.
    pub(crate) const fn sizes(self) -> (Option<u32>, Option<u32>) {
        match self {
            Self::Small => (Some(64), None),
            Self::Odd => (Some(257), Some(4_099)),
            Self::Large => (Some(65_536), Some(65_536)),
            Self::Drips | Self::Sips => (None, None),
        }
    }
}

impl Permutation {
    /// Two ways at once.
    pub fn both(first: Self, second: Self) -> Self {
        Self::Both(Arc::new([first, second]))
    }

    /// The ways that it is made of.
    pub(crate) fn parts(&self) -> &[Self] {
        match self {
            Self::Both(both) => &both[..],
            single => std::slice::from_ref(single),
        }
    }

    /// Whether it must show the same as the uncut run, to the µs.
    pub(crate) fn equals_uncut(&self) -> bool {
        !self.parts().iter().any(|part| matches!(part, Self::Uncut | Self::Late(_) | Self::Byte(_)))
    }
}

impl fmt::Display for Permutation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uncut => f.write_str("uncut"),
            Self::Late(None) => f.write_str("late"),
            Self::Late(Some(number)) => write!(f, "late:{number}"),
            Self::CutSingly => f.write_str("cut:1"),
            Self::CutWhole => f.write_str("cut:whole"),
            Self::CutRandom(number) => write!(f, "cut:random-{number:02}"),
            Self::Twice => f.write_str("twice"),
            Self::SwapAll => f.write_str("swap:all"),
            Self::SwapAfter(place) => write!(f, "swap:{place}"),
            Self::Later(clock) => write!(f, "later:{}", clock.name()),
            Self::Idle(clock) => write!(f, "idle:{}", clock.name()),
            Self::Rooms(rooms) => write!(f, "rooms:{}", rooms.name()),
            Self::After(id) => write!(f, "after:{id}"),
            Self::Again(count) => write!(f, "again:{count}"),
            Self::Byte(byte) => write!(f, "byte:{byte:02X}"),
            Self::Both(both) => write!(f, "{}+{}", both[0], both[1]),
        }
    }
}

/// A permutation has no such name.
///
/// ```
/// use softplug_conformance::Permutation;
///
/// let error = "cut:2".parse::<Permutation>().unwrap_err();
/// assert!(error.to_string().starts_with("there is no permutation \"cut:2\"; there are uncut,"));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "there is no permutation \"{0}\"; there are uncut, late, late:N, cut:1, cut:whole, \
     cut:random-NN, twice, swap:all, swap:N, later:CLOCK and idle:CLOCK (2^31us, 2^32us, 2^32ms, \
     31d, 10y), rooms:small, rooms:odd, rooms:large, rooms:drips, rooms:sips, after:ID, again:N, byte:HH and A+B"
)]
pub struct UnknownPermutation(String);

impl FromStr for Permutation {
    type Err = UnknownPermutation;

    fn from_str(name: &str) -> Result<Self, UnknownPermutation> {
        let permutation = match name.split_once('+') {
            Some((first, second)) => {
                single(first).zip(single(second)).map(|(first, second)| Self::both(first, second))
            }
            None => single(name),
        };
        // Only the name as it is printed: "swap:012" is another word.
        let known = permutation.filter(|known| known.to_string() == name);
        known.ok_or_else(|| UnknownPermutation(name.to_owned()))
    }
}

fn single(name: &str) -> Option<Permutation> {
    let Some((kind, rest)) = name.split_once(':') else {
        return match name {
            "uncut" => Some(Permutation::Uncut),
            "late" => Some(Permutation::Late(None)),
            "twice" => Some(Permutation::Twice),
            _ => None,
        };
    };
    let number = |text: &str| text.parse::<u32>().ok().filter(|number| *number > 0);
    let clock = || Clock::ALL.into_iter().find(|clock| clock.name() == rest);
    match (kind, rest) {
        ("late", count) => number(count).map(|count| Permutation::Late(Some(count))),
        ("cut", "1") => Some(Permutation::CutSingly),
        ("cut", "whole") => Some(Permutation::CutWhole),
        ("cut", random) => {
            let count = random.strip_prefix("random-").and_then(number)?;
            u8::try_from(count).ok().map(Permutation::CutRandom)
        }
        ("swap", "all") => Some(Permutation::SwapAll),
        ("swap", place) => number(place).map(Permutation::SwapAfter),
        ("later", _) => clock().map(Permutation::Later),
        ("idle", _) => clock().map(Permutation::Idle),
        ("rooms", rooms) => {
            let known = Rooms::ALL.into_iter().find(|known| known.name() == rooms);
            known.map(Permutation::Rooms)
        }
        ("after", id) => Some(Permutation::After(id.into())),
        ("again", count) => number(count).map(Permutation::Again),
        ("byte", byte) => u8::from_str_radix(byte, 16).ok().map(Permutation::Byte),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_again() {
        let all = [
            Permutation::Uncut,
            Permutation::Late(None),
            Permutation::Late(Some(3)),
            Permutation::CutSingly,
            Permutation::CutWhole,
            Permutation::CutRandom(7),
            Permutation::Twice,
            Permutation::SwapAll,
            Permutation::SwapAfter(12),
            Permutation::Later(Clock::Word),
            Permutation::Idle(Clock::Years),
            Permutation::Rooms(Rooms::Drips),
            Permutation::After("xon-xoff.tx.hold".into()),
            Permutation::Again(40),
            Permutation::Byte(0x0A),
            Permutation::both(Permutation::CutWhole, Permutation::SwapAll),
        ];
        for permutation in all {
            assert_eq!(permutation.to_string().parse(), Ok(permutation));
        }
        assert_eq!(Permutation::CutRandom(7).to_string(), "cut:random-07");
        let wrong = [
            "",
            "cut",
            "cut:2",
            "cut:random-7",
            "swap:0",
            "swap:012",
            "late:",
            "Uncut",
            "later:1d",
            "rooms:",
            "byte:5b",
            "byte:5",
            "cut:1+",
            "+cut:1",
            "cut:1+cut:1+cut:1",
        ];
        for wrong in wrong {
            assert!(wrong.parse::<Permutation>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn only_the_run_as_written_and_late_inputs_stand_for_themselves() {
        assert!(!Permutation::Uncut.equals_uncut());
        assert!(!Permutation::Late(None).equals_uncut());
        for other in [Permutation::CutSingly, Permutation::Twice, Permutation::SwapAll] {
            assert!(other.equals_uncut());
        }
    }
}
