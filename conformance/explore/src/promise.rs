//! What must never be, and what a protocol cannot keep from happening.

use softplug_abi::Failure;
use softplug_models::Broken;
use std::fmt;

/// Something that a plug-in must never do, or let happen.
///
/// ```
/// use softplug_explore::Breach;
///
/// let breach = Breach::Altered { delivered: b"G2".to_vec() };
/// assert_eq!(breach.to_string(), "a delivery is not what was sent: 47 32");
/// ```
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Breach {
    /// A delivery is not what was sent.
    Altered {
        /// What was delivered.
        delivered: Vec<u8>,
    },
    /// A delivery where nothing was sent.
    Invented {
        /// What was delivered.
        delivered: Vec<u8>,
    },
    /// What was sent once was delivered twice.
    Doubled,
    /// A job is done and nothing was delivered.
    NotDelivered,
    /// A job failed though nothing went wrong.
    FailedForNothing {
        /// Why, as the plug-in says.
        failure: Failure,
    },
    /// What left the plug-in is not what it was to send.
    WrongOnLine {
        /// What is wrong, for people.
        what: String,
    },
    /// What arrived was never delivered.
    Lost {
        /// What arrived.
        bytes: Vec<u8>,
    },
    /// A character began to leave though the partner held it.
    SentWhileHeld,
    /// Bytes of one time are taken otherwise where they come one by one.
    Cut,
    /// Nothing will happen any more, and something is still under way.
    StandsStill {
        /// The line is held.
        is_held: bool,
    },
    /// It goes on for ever without coming to an end.
    NeverEnds,
    /// It breaks a rule of the profile, as its model has it.
    Rule {
        /// The clause.
        clause: String,
        /// What is wrong, for people.
        message: String,
    },
    /// The plug-in ended by a fault, or broke a rule of the ABI.
    Fault {
        /// How, for people.
        message: String,
    },
}

impl Breach {
    /// The names of all promises.
    ///
    /// ```
    /// assert!(softplug_explore::Breach::NAMES.contains(&"doubled"));
    /// ```
    pub const NAMES: [&str; 13] = [
        "altered",
        "invented",
        "lost",
        "doubled",
        "not-delivered",
        "failed-for-nothing",
        "wrong-on-line",
        "sent-while-held",
        "cut",
        "stands-still",
        "never-ends",
        "rule",
        "fault",
    ];

    /// Which promise it breaks, in one word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Altered { .. } => "altered",
            Self::Invented { .. } => "invented",
            Self::Doubled => "doubled",
            Self::NotDelivered => "not-delivered",
            Self::FailedForNothing { .. } => "failed-for-nothing",
            Self::WrongOnLine { .. } => "wrong-on-line",
            Self::Lost { .. } => "lost",
            Self::SentWhileHeld => "sent-while-held",
            Self::Cut => "cut",
            Self::StandsStill { .. } => "stands-still",
            Self::NeverEnds => "never-ends",
            Self::Rule { .. } => "rule",
            Self::Fault { .. } => "fault",
        }
    }
}

impl From<Broken> for Breach {
    fn from(Broken { clause, message }: Broken) -> Self {
        Self::Rule { clause: clause.to_owned(), message }
    }
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Altered { delivered } => {
                write!(f, "a delivery is not what was sent:{}", Hex(delivered))
            }
            Self::Invented { delivered } => {
                write!(f, "a delivery where nothing was sent:{}", Hex(delivered))
            }
            Self::Doubled => write!(f, "what was sent once was delivered twice"),
            Self::NotDelivered => write!(f, "a job is done and was not delivered"),
            Self::FailedForNothing { failure } => {
                write!(f, "a job failed ({}) though nothing went wrong", failure.name())
            }
            Self::WrongOnLine { what } => write!(f, "what left the plug-in is wrong: {what}"),
            Self::Lost { bytes } => write!(f, "what arrived was never delivered:{}", Hex(bytes)),
            Self::SentWhileHeld => write!(f, "a character left though the partner held it"),
            Self::Cut => {
                write!(f, "it does something else where bytes of one time come one by one")
            }
            Self::StandsStill { is_held: false } => {
                write!(f, "something is under way and nothing will happen")
            }
            Self::StandsStill { is_held: true } => {
                write!(f, "something is under way, the line is held, and nothing will happen")
            }
            Self::NeverEnds => write!(f, "it goes on for ever and comes to no end"),
            Self::Rule { clause, message } => write!(f, "{clause}: {message}"),
            Self::Fault { message } => write!(f, "{message}"),
        }
    }
}

struct Hex<'a>(&'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return write!(f, " nothing");
        }
        self.0.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

/// Begins a block, in protocols that have it.
pub(crate) const STX: u8 = 0x02;

/// What went wrong so far, as far as it can excuse a breach.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) struct Wrong {
    /// Faults and requests.
    pub(crate) count: u8,
    /// On the way to each end.
    pub(crate) towards: [Way; 2],
    /// The host of each end asked for something out of turn.
    pub(crate) asked: [bool; 2],
    /// It asked to go on although the partner holds the line.
    pub(crate) forced: [bool; 2],
}

/// What went wrong on the way to one end.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) struct Way {
    /// Something did.
    pub(crate) any: bool,
    /// A sound character came that was not sent so: altered, or put in.
    pub(crate) forged: bool,
    /// One of these begins a block.
    pub(crate) begun_anew: bool,
    /// A break came.
    pub(crate) broken: bool,
}

/// What in the data of an end can be taken for something else, as far as it can excuse a breach.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Ambiguous {
    /// A character that begins a block.
    has_stx: bool,
    /// The first characters of a line cancel each other out in a check.
    cancels: bool,
    /// A line has no character.
    has_empty_line: bool,
}

impl Ambiguous {
    pub(crate) fn of<'a>(jobs: impl Iterator<Item = &'a [u8]>) -> Self {
        let mut all = Self::default();
        for data in jobs {
            all.has_stx |= data.contains(&STX);
            for line in data.split(|byte| *byte == b'\n') {
                let mut check = 0;
                all.cancels |= line.iter().any(|byte| {
                    check ^= byte;
                    check == 0
                });
            }
            all.has_empty_line |=
                data.starts_with(b"\n") || data.windows(2).any(|two| two == b"\n\n");
        }
        all
    }
}

/// How a protocol guards what it carries.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Guard {
    /// Each block is acknowledged, and has a check character.
    Checked,
    /// Each block is acknowledged, and has none.
    Unchecked,
    /// Each block is acknowledged and has a check character, but no number: one that is sent
    /// again is one more. What leaves the plug-in is held against the line besides.
    Unnumbered,
    /// Nothing is acknowledged: what the plug-in gets and sends is held against the line.
    Open,
}

impl Guard {
    /// The promises that the protocol cannot always keep.
    pub(crate) fn unavoidable(self) -> &'static [&'static str] {
        match self {
            Self::Checked => &["altered", "doubled", "not-delivered"],
            Self::Unchecked => &["altered", "invented", "doubled", "not-delivered"],
            Self::Unnumbered => {
                &["altered", "doubled", "not-delivered", "sent-while-held", "stands-still"]
            }
            Self::Open => &["sent-while-held", "stands-still"],
        }
    }

    /// Whether the protocol cannot keep this from happening after what went wrong. `sender` is
    /// the end whose data it is.
    pub(crate) fn is_unavoidable(
        self,
        breach: &Breach,
        wrong: &Wrong,
        sender: usize,
        data: Ambiguous,
    ) -> bool {
        let (to, back) = (wrong.towards[1 - sender], wrong.towards[sender]);
        let asked_there = wrong.asked[1 - sender];
        match (self, breach) {
            // Two faults can leave a check character right; one never does.
            (Self::Checked, Breach::Altered { .. }) => wrong.count >= 2,
            // Nor does anybody notice an STX that was sent twice, because of a forged answer, or of
            // what is older and comes late, behind an abort, where the answer is awaited.
            (Self::Unchecked, Breach::Altered { .. }) => {
                to.any || back.forged || (back.any && asked_there)
            }
            // The acknowledgement did not come back, or came while the block was still sent because
            // a character that was put in ended it early: the block is sent again.
            (Self::Checked | Self::Unchecked, Breach::Doubled) => {
                back.any || wrong.asked[sender] || to.forged
            }
            (Self::Unchecked, Breach::Invented { .. }) => to.forged,
            // An acknowledgement has no check. Where the receiver is idle in the middle of a block,
            // behind a break, an abort or a port that was gone, what follows of the block can be
            // an STX, and the answer to that looks like one. So it is behind a silence of which the
            // sender hears nothing, if its data have an STX. And so does the answer to an STX that
            // nobody sent.
            (Self::Checked | Self::Unchecked, Breach::NotDelivered) => {
                back.forged
                    || to.broken
                    || asked_there
                    || (to.any && back.any && (data.has_stx || to.begun_anew))
            }
            // Two characters put in, or altered, can leave a check character right. So can one STX,
            // which begins the block anew, where the characters before it cancel each other out.
            (Self::Unnumbered, Breach::Altered { .. }) => {
                (wrong.count >= 2 && to.forged) || (to.begun_anew && data.cancels)
            }
            // It waits for an XON that is lost.
            (Self::Open, Breach::StandsStill { .. }) => back.any,
            // It was held by a forged DC3, and the DC1 after it was lost.
            (Self::Unnumbered, Breach::StandsStill { is_held: true }) => {
                wrong.count >= 3 && back.forged
            }
            // The answer to a good block was lost, altered, late or held, so that the block is
            // sent again; it cannot be told from the next one.
            (Self::Unnumbered, Breach::Doubled) => to.any || back.any,
            // An acknowledgement has no check: a forged one lets the next block go. And a block that
            // two faults make another one can be an empty line.
            (Self::Unnumbered, Breach::NotDelivered) => {
                back.forged || (wrong.count >= 2 && to.forged && data.has_empty_line)
            }
            // The host forced it.
            (Self::Open | Self::Unnumbered, Breach::SentWhileHeld) => wrong.forced[sender],
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn breaches() -> Vec<Breach> {
        vec![
            Breach::Altered { delivered: Vec::new() },
            Breach::Invented { delivered: Vec::new() },
            Breach::Lost { bytes: Vec::new() },
            Breach::Doubled,
            Breach::NotDelivered,
            Breach::FailedForNothing { failure: Failure::NoAnswer },
            Breach::WrongOnLine { what: String::new() },
            Breach::SentWhileHeld,
            Breach::Cut,
            Breach::StandsStill { is_held: true },
            Breach::NeverEnds,
            Breach::Rule { clause: String::new(), message: String::new() },
            Breach::Fault { message: String::new() },
        ]
    }

    #[test]
    fn every_promise_has_its_name() {
        let names: Vec<_> = breaches().iter().map(Breach::name).collect();
        assert_eq!(names, Breach::NAMES);
    }

    #[test]
    fn a_protocol_is_excused_from_what_stands_there_and_only_after_faults() {
        let way = Way { any: true, forged: true, begun_anew: true, broken: true };
        let (asked, forced) = ([true; 2], [true; 2]);
        let everything = Wrong { count: 3, towards: [way; 2], asked, forced };
        let data = Ambiguous { has_stx: true, cancels: true, has_empty_line: true };
        for guard in [Guard::Checked, Guard::Unchecked, Guard::Unnumbered, Guard::Open] {
            let excused = |wrong: &Wrong| -> Vec<&str> {
                let all = breaches().into_iter();
                let excused = all.filter(|breach| guard.is_unavoidable(breach, wrong, 0, data));
                excused.map(|breach| breach.name()).collect()
            };
            assert_eq!(excused(&everything), guard.unavoidable(), "{guard:?}");
            assert!(excused(&Wrong::default()).is_empty(), "{guard:?}");
        }
    }

    #[test]
    fn data_that_can_be_taken_for_something_else_are_known() {
        let of = |data: &[u8]| Ambiguous::of([data].into_iter());
        assert_eq!(of(b"G1\nX2\n"), Ambiguous::default());
        assert!(of(b"G\x02").has_stx);
        assert!(of(b"1\n223\n").cancels && !of(b"3\n232\n").cancels);
        assert!(of(b"1\n\n2").has_empty_line && of(b"\n1").has_empty_line);
    }
}
