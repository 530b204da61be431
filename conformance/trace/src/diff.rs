//! Two traces held against each other, event by event and byte by byte.

use std::collections::BTreeMap;
use std::fmt;

use crate::exchange::pace::Pace;
use crate::model::{
    Entry, Expected, FrontMatter, Given, Item, LineSettings, Payload, PayloadError, Piece,
    SourceLine, Time, Trace, What, When,
};
use crate::{Files, format};

/// Pairs of items that are looked at to find what both sides have; where it would take
/// more, what lies between the first and the last difference is told as a whole.
const PAIRS: usize = 16 << 20;

/// A difference between a first and a second trace.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Difference {
    /// A key of the front matter that changes what is run: `line`, `config`, `room` or `modem`.
    Front {
        /// The key.
        key: &'static str,
        /// Its value in the first trace.
        first: String,
        /// Its value in the second.
        second: String,
    },
    /// Something that only the first has.
    First(Entry),
    /// Something that only the second has.
    Second(Entry),
    /// Something that both have, at another time.
    Time {
        /// As the first has it.
        first: Entry,
        /// As the second has it.
        second: Entry,
        /// How much later the second is, in µs.
        later: i64,
    },
}

/// All differences, those of the front matter first, then by time. What is more than
/// `tolerance` µs apart is at another time. Events of different kinds have no order among each
/// other but their times; how bytes are spread over lines does not matter. A trace's
/// alternatives are compared as they are written.
///
/// # Errors
/// A trace names a file that is not there.
pub fn diff(
    first: (&Trace, &impl Files),
    second: (&Trace, &impl Files),
    tolerance: u64,
) -> Result<Vec<Difference>, PayloadError> {
    let mut all = front(&first.0.front, &second.0.front);
    let mut courses = (timeline(first.0, first.1)?, timeline(second.0, second.1)?);
    let signs = courses.0.keys().chain(courses.1.keys());
    let mut signs: Vec<_> = signs.copied().collect();
    signs.sort_unstable();
    signs.dedup();
    let mut found = Vec::new();
    for sign in signs {
        let a = courses.0.remove(sign).unwrap_or_default();
        let b = courses.1.remove(sign).unwrap_or_default();
        let lines = (&first.0.front.line, &second.0.front.line);
        found.extend(compare(sign, (&a, &b), lines, tolerance));
    }
    found.sort_by_key(Difference::at);
    all.extend(found);
    Ok(all)
}

impl Difference {
    /// When it begins; `None` in the front matter.
    pub fn at(&self) -> Option<Time> {
        match self {
            Self::Front { .. } => None,
            Self::First(entry) | Self::Second(entry) => Some(entry.when.from),
            Self::Time { first, second, .. } => Some(first.when.from.min(second.when.from)),
        }
    }

    /// The line of the first and of the second trace.
    pub fn lines(&self) -> (Option<u32>, Option<u32>) {
        match self {
            Self::Front { .. } => (None, None),
            Self::First(entry) => (Some(entry.line.0), None),
            Self::Second(entry) => (None, Some(entry.line.0)),
            Self::Time { first, second, .. } => (Some(first.line.0), Some(second.line.0)),
        }
    }
}

impl fmt::Display for Difference {
    /// `-` stands before what only the first has, `+` before what only the second has, `~` before
    /// what both have at another time.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cause = |entry: &Entry| {
            if entry.line.0 == 0 { String::new() } else { format!("   (line {})", entry.line.0) }
        };
        match self {
            Self::Front { key, first, second } => write!(f, "- {key}: {first}\n+ {key}: {second}"),
            Self::First(entry) => write!(f, "- {entry}{}", cause(entry)),
            Self::Second(entry) => write!(f, "+ {entry}{}", cause(entry)),
            Self::Time { first, second, later } => {
                let (span, word) =
                    (later.unsigned_abs(), if *later < 0 { "earlier" } else { "later" });
                write!(
                    f,
                    "~ {first}{}\n    {span} µs {word}, at {}{}",
                    cause(first),
                    second.when,
                    cause(second)
                )
            }
        }
    }
}

fn front(first: &FrontMatter, second: &FrontMatter) -> Vec<Difference> {
    let keys = format::run_keys(first).into_iter().zip(format::run_keys(second));
    let differs = keys.filter(|((_, first), (_, second))| first != second);
    differs.map(|((key, first), (_, second))| Difference::Front { key, first, second }).collect()
}

/// The smallest thing that is compared: a character, or an event without any.
#[derive(Clone)]
struct Unit {
    when: When,
    line: SourceLine,
    what: Thing,
}

#[derive(Clone, PartialEq, Eq)]
enum Thing {
    Character(Item),
    Event(What),
}

/// The units of a trace by the sign of their kind; bursts are single characters.
fn timeline(
    trace: &Trace,
    files: &impl Files,
) -> Result<BTreeMap<&'static str, Vec<Unit>>, PayloadError> {
    let pace = Pace::of(&trace.front.line);
    let inside = trace.alternatives().flat_map(|block| block.branches.iter().flatten());
    let inside = inside.filter_map(crate::Line::entry);
    let mut timeline: BTreeMap<&'static str, Vec<Unit>> = BTreeMap::new();
    for entry in trace.entries().chain(inside) {
        let (payload, is_paced, sign) = match &entry.what {
            What::Given(Given::Receive(payload)) => (payload, false, "<"),
            What::Given(Given::Burst(payload)) => (payload, true, "<"),
            What::Expected(Expected::Send(payload)) => (payload, true, ">"),
            other => {
                let what = Thing::Event(other.clone());
                let unit = Unit { when: entry.when, line: entry.line, what };
                timeline.entry(other.sign()).or_default().push(unit);
                continue;
            }
        };
        let units = timeline.entry(sign).or_default();
        let characters = payload.pieces(files)?.into_iter().flat_map(|piece| match piece {
            Piece::Bytes(bytes) => bytes.into_iter().map(|byte| Item::Hex(vec![byte])).collect(),
            Piece::Bad { kind, byte } => vec![Item::Bad { kind, byte }],
        });
        units.extend(characters.enumerate().map(|(n, item)| {
            let behind = if is_paced { pace.of_characters(n) as u64 } else { 0 };
            let when =
                When { from: Time(entry.when.from.0 + behind), to: Time(entry.when.to.0 + behind) };
            Unit { when, line: entry.line, what: Thing::Character(item) }
        }));
    }
    for units in timeline.values_mut() {
        units.sort_by_key(|unit| unit.when.from);
    }
    Ok(timeline)
}

fn compare(
    sign: &str,
    (first, second): (&[Unit], &[Unit]),
    lines: (&LineSettings, &LineSettings),
    tolerance: u64,
) -> Vec<Difference> {
    let (mut at, mut only_first, mut only_second, mut moved) = ((0, 0), vec![], vec![], vec![]);
    for (a, b) in pairs(first, second) {
        only_first.extend(&first[at.0..a]);
        only_second.extend(&second[at.1..b]);
        at = (a + 1, b + 1);
        let (one, other) = (&first[a], &second[b]);
        let apart = |one: Time, other: Time| one.0.abs_diff(other.0) > tolerance;
        if apart(one.when.from, other.when.from) || apart(one.when.to, other.when.to) {
            moved.push((one, other));
        }
    }
    only_first.extend(&first[at.0..]);
    only_second.extend(&second[at.1..]);
    let paces = (Pace::of(lines.0), Pace::of(lines.1));
    let runs = |units: &[&Unit], pace: Pace| -> Vec<Entry> {
        let runs = units.chunk_by(|before, next| follows(before, next, pace));
        runs.map(|run| entry(sign, run)).collect()
    };
    let only_first = runs(&only_first, paces.0).into_iter().map(Difference::First);
    let only_second = runs(&only_second, paces.1).into_iter().map(Difference::Second);
    let shift = |(one, other): &(&Unit, &Unit)| {
        other.when.from.0.cast_signed() - one.when.from.0.cast_signed()
    };
    // What is moved by about as much is told once: the times of characters are rounded.
    let moved = moved.chunk_by(|before, next| {
        shift(before).abs_diff(shift(next)) <= 1
            && follows(before.0, next.0, paces.0)
            && follows(before.1, next.1, paces.1)
    });
    let moved = moved.map(|run| {
        let (ones, others): (Vec<_>, Vec<_>) = run.iter().copied().unzip();
        let (first, second) = (entry(sign, &ones), entry(sign, &others));
        Difference::Time { first, second, later: shift(&run[0]) }
    });
    only_first.chain(only_second).chain(moved).collect()
}

/// Which units are the same on both sides, in order: what is equal at both ends, and
/// between them as many as there are.
fn pairs(first: &[Unit], second: &[Unit]) -> Vec<(usize, usize)> {
    let is_same = |a: usize, b: usize| first[a].what == second[b].what;
    let least = first.len().min(second.len());
    let head = (0..least).take_while(|n| is_same(*n, *n)).count();
    let ends = |n: &usize| is_same(first.len() - 1 - n, second.len() - 1 - n);
    let tail = (0..least - head).take_while(ends).count();
    let (rows, columns) = (first.len() - head - tail, second.len() - head - tail);
    let mut pairs: Vec<_> = (0..head).map(|n| (n, n)).collect();
    if rows.saturating_mul(columns) <= PAIRS {
        // The most that can be paired from each place on.
        let mut most = vec![0_u32; (rows + 1) * (columns + 1)];
        let place = |row: usize, column: usize| row * (columns + 1) + column;
        for row in (0..rows).rev() {
            for column in (0..columns).rev() {
                most[place(row, column)] = if is_same(head + row, head + column) {
                    most[place(row + 1, column + 1)] + 1
                } else {
                    most[place(row + 1, column)].max(most[place(row, column + 1)])
                };
            }
        }
        let (mut row, mut column) = (0, 0);
        while row < rows && column < columns {
            if is_same(head + row, head + column) {
                pairs.push((head + row, head + column));
                (row, column) = (row + 1, column + 1);
            } else if most[place(row + 1, column)] >= most[place(row, column + 1)] {
                row += 1;
            } else {
                column += 1;
            }
        }
    }
    pairs.extend((0..tail).rev().map(|n| (first.len() - 1 - n, second.len() - 1 - n)));
    pairs
}

/// Whether two units are characters of one line of the file that follow each other.
fn follows(before: &Unit, next: &Unit, pace: Pace) -> bool {
    let apart = next.when.from.0.saturating_sub(before.when.from.0);
    matches!((&before.what, &next.what), (Thing::Character(_), Thing::Character(_)))
        && before.line.0 == next.line.0
        && apart <= pace.of_characters(1) as u64 + 1
}

/// A run of characters, or an event, as a line of a trace.
fn entry(sign: &str, run: &[&Unit]) -> Entry {
    let what = match &run[0].what {
        Thing::Event(what) => what.clone(),
        Thing::Character(_) => {
            let items = run.iter().filter_map(|unit| match &unit.what {
                Thing::Character(item) => Some(item.clone()),
                Thing::Event(_) => None,
            });
            let payload = Payload::new(items);
            let last = run[run.len() - 1].when.from;
            match sign {
                ">" => What::Expected(Expected::Send(payload)),
                _ if last == run[0].when.from => What::Given(Given::Receive(payload)),
                _ => What::Given(Given::Burst(payload)),
            }
        }
    };
    Entry { when: run[0].when, what, line: run[0].line }
}
