//! What stood in a trace as sent, held against what a plug-in sends: the characters and breaks
//! alone, in their order. When they leave is the trace's matter, not whether.

use crate::given::case::Case;
use crate::given::lines::line_parameters;
use crate::given::timeline::micros;
use crate::run::seen::Seen;
use softplug_abi::Micros;
use softplug_link::Observed;
use softplug_trace::{Entry, Expected, What};
use std::fmt;

/// Characters that are told of one place at the most.
const SHOWN: usize = 16;
/// Pairs that are compared to find what still agrees behind a difference; beyond, all of the rest
/// counts as different.
const PAIRS: usize = 4_000_000;

/// Something on the wire.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Sign {
    Byte(u8),
    /// Whatever its length: a recorder does not know it.
    Break,
}

/// Something that stood on a `>` line.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Recorded {
    pub(crate) at: Micros,
    pub(crate) line: u32,
    pub(crate) sign: Sign,
}

/// Bytes of `>` lines that a plug-in does not send, at one place of a trace.
///
/// The example of [`blessing`](crate::blessing) shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Lost {
    /// The trace's line with the first of them.
    pub line: u32,
    /// When it left.
    pub at: Micros,
    /// What stood there.
    pub recorded: Vec<u8>,
    /// Breaks among it.
    pub breaks: usize,
    /// What is sent in its place, and when; empty if nothing is.
    pub sent: Vec<u8>,
    /// When the first of that leaves.
    pub sent_at: Option<Micros>,
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, {}: recorded ", self.line, seconds(self.at))?;
        match (&self.recorded[..], self.breaks) {
            ([], _) => f.write_str("a break")?,
            (recorded, 0) => f.write_str(&shown(recorded))?,
            (recorded, _) => write!(f, "{} and a break", shown(recorded))?,
        }
        match self.sent_at {
            Some(at) if !self.sent.is_empty() => {
                write!(f, ", sent {} at {}", shown(&self.sent), seconds(at))
            }
            _ => f.write_str(", sent nothing"),
        }
    }
}

/// How the two stand to each other.
#[derive(Debug, Default)]
pub(crate) struct Held {
    /// Characters and breaks that stood there.
    pub(crate) stood: usize,
    pub(crate) lost: Vec<Lost>,
    /// Bytes that are lost.
    pub(crate) lost_bytes: usize,
    /// Characters and breaks that are sent and did not stand there.
    pub(crate) more: usize,
    /// When the first of them leaves.
    pub(crate) more_at: Option<Micros>,
}

/// What stands on the `>` lines of these entries, in the order of the lines.
pub(crate) fn recorded<'a>(
    case: &Case,
    entries: impl IntoIterator<Item = &'a Entry>,
) -> Vec<Recorded> {
    let line = line_parameters(&case.trace.front.line);
    let mut all = Vec::new();
    for entry in entries {
        let begin = micros(entry.when.from);
        match &entry.what {
            // What cannot be had was not sent either.
            What::Expected(Expected::Send(payload)) => {
                for (n, byte) in payload.bytes(&case.files()).unwrap_or_default().iter().enumerate()
                {
                    let at = begin + line.characters(n as u64);
                    all.push(Recorded { at, line: entry.line.0, sign: Sign::Byte(*byte) });
                }
            }
            What::Expected(Expected::SendBreak(_)) => {
                all.push(Recorded { at: begin, line: entry.line.0, sign: Sign::Break });
            }
            _ => {}
        }
    }
    // In the order of the lines: a recorder that has read two characters at once writes the second
    // later than it was, which does not put it behind what followed.
    all
}

/// What was sent, in the order of time.
pub(crate) fn sent(seen: &[Seen]) -> Vec<(Micros, Sign)> {
    let sign = |seen: &Seen| match seen.what {
        Observed::Byte(byte) => Some((seen.at, Sign::Byte(byte))),
        Observed::Break(_) => Some((seen.at, Sign::Break)),
        _ => None,
    };
    seen.iter().filter_map(sign).collect()
}

/// How many of the first are the same.
pub(crate) fn same(recorded: &[Recorded], sent: &[(Micros, Sign)]) -> usize {
    recorded.iter().zip(sent).take_while(|(recorded, (_, sign))| recorded.sign == *sign).count()
}

/// Which of what stood there is no longer sent. Of alternatives that course counts of which the
/// least is lost.
pub(crate) fn held(case: &Case, seen: &[Seen]) -> Held {
    let sent = sent(seen);
    let courses = case.trace.variants();
    let held = courses.into_iter().map(|course| {
        let stood = recorded(case, course);
        compare(&stood, &sent)
    });
    held.min_by_key(|held| (held.lost_bytes, held.lost.len(), held.more)).unwrap_or_default()
}

pub(crate) fn compare(stood: &[Recorded], sent: &[(Micros, Sign)]) -> Held {
    let mut held = Held { stood: stood.len(), ..Held::default() };
    let mut lose = |stood: &[Recorded], sent: &[(Micros, Sign)]| {
        let byte = |sign: Sign| match sign {
            Sign::Byte(byte) => Some(byte),
            Sign::Break => None,
        };
        let Some(first) = stood.first() else {
            held.more += sent.len();
            held.more_at = held.more_at.or(sent.first().map(|(at, _)| *at));
            return;
        };
        let recorded: Vec<u8> = stood.iter().filter_map(|stood| byte(stood.sign)).collect();
        held.lost_bytes += stood.len();
        held.lost.push(Lost {
            line: first.line,
            at: first.at,
            breaks: stood.len() - recorded.len(),
            recorded,
            sent: sent.iter().filter_map(|(_, sign)| byte(*sign)).collect(),
            sent_at: sent.first().map(|(at, _)| *at),
        });
    };
    let begin = same(stood, sent);
    let (stood, sent) = (&stood[begin..], &sent[begin..]);
    let end = stood.iter().rev().zip(sent.iter().rev());
    let end = end.take_while(|(stood, (_, sign))| stood.sign == *sign).count();
    let (stood, sent) = (&stood[..stood.len() - end], &sent[..sent.len() - end]);
    if stood.is_empty() || sent.is_empty() || stood.len().saturating_mul(sent.len()) > PAIRS {
        if !stood.is_empty() || !sent.is_empty() {
            lose(stood, sent);
        }
        return held;
    }
    // The longest common part, from the ends.
    let width = sent.len() + 1;
    let mut common = vec![0_u32; (stood.len() + 1) * width];
    for i in (0..stood.len()).rev() {
        for j in (0..sent.len()).rev() {
            common[i * width + j] = if stood[i].sign == sent[j].1 {
                common[(i + 1) * width + j + 1] + 1
            } else {
                common[(i + 1) * width + j].max(common[i * width + j + 1])
            };
        }
    }
    let (mut i, mut j, mut from) = (0, 0, (0, 0));
    while i < stood.len() && j < sent.len() {
        if stood[i].sign == sent[j].1 {
            if from != (i, j) {
                lose(&stood[from.0..i], &sent[from.1..j]);
            }
            (i, j) = (i + 1, j + 1);
            from = (i, j);
        } else if common[(i + 1) * width + j] >= common[i * width + j + 1] {
            i += 1;
        } else {
            j += 1;
        }
    }
    if from != (stood.len(), sent.len()) {
        lose(&stood[from.0..], &sent[from.1..]);
    }
    held
}

/// Bytes as hex, with their number where there are too many.
pub(crate) fn shown(bytes: &[u8]) -> String {
    let hex: Vec<String> = bytes.iter().take(SHOWN).map(|byte| format!("{byte:02X}")).collect();
    let hex = hex.join(" ");
    if bytes.len() > SHOWN { format!("{hex} … ({} bytes)", bytes.len()) } else { hex }
}

pub(crate) fn seconds(at: Micros) -> String {
    format!("{} s", softplug_trace::Time(at.0.max(0) as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held_of(stood: &[u8], now: &[u8]) -> Held {
        let stood: Vec<_> = (1..)
            .zip(stood)
            .map(|(n, byte)| Recorded { at: Micros(n), line: n as u32, sign: Sign::Byte(*byte) })
            .collect();
        let now: Vec<_> = (1..).zip(now).map(|(n, b)| (Micros(10 * n), Sign::Byte(*b))).collect();
        compare(&stood, &now)
    }

    #[test]
    fn what_is_added_is_not_lost() {
        let held = held_of(b"AC", b"ABCD");
        assert!(held.lost.is_empty());
        assert_eq!((held.more, held.more_at), (2, Some(Micros(20))));
        let held = held_of(b"ABCD", b"ABCD");
        assert!(held.lost.is_empty() && held.more == 0);
        assert!(held_of(b"", b"").lost.is_empty());
        assert_eq!(held_of(b"", b"AB").more, 2);
    }

    #[test]
    fn each_place_is_told_with_what_is_sent_there() {
        let held = held_of(b"ABCDEFG", b"AxCDFG");
        assert_eq!(held.lost_bytes, 2);
        let told: Vec<String> = held.lost.iter().map(ToString::to_string).collect();
        assert_eq!(
            told,
            [
                "line 2, 0.000002 s: recorded 42, sent 78 at 0.000020 s",
                "line 5, 0.000005 s: recorded 45, sent nothing"
            ]
        );
        assert_eq!(held_of(b"AB", b"").lost_bytes, 2);
    }

    #[test]
    fn of_what_is_long_the_number_is_told() {
        let (stood, now) = ([b'A'; 3_000], [b'B'; 3_000]);
        let held = held_of(&stood, &now);
        assert_eq!((held.lost.len(), held.lost_bytes), (1, 3_000));
        assert!(held.lost[0].to_string().contains("41 … (3000 bytes), sent 42"));
    }

    #[test]
    fn a_break_has_no_length_and_no_byte() {
        let stood = [Recorded { at: Micros(5), line: 9, sign: Sign::Break }];
        assert!(compare(&stood, &[(Micros(7), Sign::Break)]).lost.is_empty());
        let held = compare(&stood, &[]);
        assert_eq!(held.lost[0].to_string(), "line 9, 0.000005 s: recorded a break, sent nothing");
        assert_eq!((held.lost_bytes, held.lost[0].breaks), (1, 1));
    }
}
