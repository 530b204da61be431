//! From a timeline to a trace: readable lines that mean the same.

use super::Import;
use super::error::ImportFault;
use super::pace::Pace;
use super::timeline::{Event, Timeline, read};
use crate::limits;
use crate::model::{
    BadKind, Entry, Expected, Given, Item, Line, Payload, SourceLine, Time, Trace, What, When,
};

/// Characters of a line at most: they fit even if each is damaged.
const LONGEST: usize = 12 << 10;

/// The trace, and the time of the file at which it begins.
pub(super) fn trace(timeline: Timeline, import: &Import) -> Result<(Trace, i64), ImportFault> {
    let Timeline { pace, modem, mut events } = timeline;
    events.sort_by_key(|event| event.at);
    let (Some(first), Some(last)) = (events.first(), events.last()) else {
        return Err(ImportFault::Nothing);
    };
    let (first, last) = (first.at, last.at);
    let most = limits::SECONDS as i64 * 1_000_000;
    let zero = if import.from_first || first < 0 || last > most { first } else { 0 };
    if last.checked_sub(zero).is_none_or(|longest| longest > most) {
        return Err(ImportFault::TooFarApart);
    }

    let mut events: Vec<_> =
        runs(events, pace).into_iter().flat_map(|run| run.lines(pace)).collect();
    if events.len() > limits::LINES {
        return Err(ImportFault::TraceTooLong);
    }
    // While a long run goes on, something else may happen.
    events.sort_by_key(|event| event.at);
    let line = |event: Event| {
        let when = When::at(Time((event.at - zero) as u64));
        Line::Entry(Entry { when, what: event.what, line: SourceLine::default() })
    };
    let body = events.into_iter().map(line).collect();
    let mut front = import.front.clone();
    if !modem.0.is_empty() {
        front.modem = modem;
    }
    let trace = Trace { front, body };
    let text = trace.format();
    // Splitting a run may have moved the last character past the last moment.
    if text.len() > limits::FILE_BYTES || text.lines().count() > limits::LINES {
        return Err(ImportFault::TraceTooLong);
    }
    if trace.end().0 > most as u64 {
        return Err(ImportFault::TooFarApart);
    }
    Ok((trace, zero))
}

/// Characters that belong into one line, or another event.
enum Run {
    /// At one moment, or from there on at the line rate.
    Characters {
        at: i64,
        way: Way,
        characters: Vec<(u8, Option<BadKind>)>,
    },
    Other(Event),
}

#[derive(Copy, Clone, PartialEq, Eq)]
enum Way {
    /// `<`
    At,
    /// `<<`
    Burst,
    /// `>`
    Send,
}

/// Events with characters joined to those before them where that changes no time.
fn runs(events: Vec<Event>, pace: Pace) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for event in events {
        let (way, payload) = match &event.what {
            What::Given(Given::Receive(payload)) => (Way::At, payload),
            What::Given(Given::Burst(payload)) => (Way::Burst, payload),
            What::Expected(Expected::Send(payload)) => (Way::Send, payload),
            _ => {
                runs.push(Run::Other(event));
                continue;
            }
        };
        let more: Vec<_> = read(payload).collect();
        if more.is_empty() {
            continue;
        }
        if let Some(Run::Characters { at, way: before, characters }) = runs.last_mut() {
            let count = characters.len();
            let after = event.at - *at;
            let single = |way: Way, count: usize| way == Way::At && count == 1;
            let joined = match (*before, way) {
                (Way::At, Way::At) if after == 0 => Some(Way::At),
                (Way::Send, Way::Send) if pace.goes_on(count, after, more.len()) => Some(Way::Send),
                (Way::Send, _) | (_, Way::Send) => None,
                (before, way)
                    if (before == Way::Burst || single(before, count))
                        && (way == Way::Burst || single(way, more.len()))
                        && pace.goes_on(count, after, more.len()) =>
                {
                    Some(Way::Burst)
                }
                _ => None,
            };
            if let Some(way) = joined {
                *before = way;
                characters.extend(more);
                continue;
            }
        }
        runs.push(Run::Characters { at: event.at, way, characters: more });
    }
    runs
}

impl Run {
    /// The lines that hold it.
    fn lines(self, pace: Pace) -> Vec<Event> {
        let (at, way, characters) = match self {
            Self::Other(event) => return vec![event],
            Self::Characters { at, way, characters } => (at, way, characters),
        };
        let longest = if way == Way::At { LONGEST } else { pace.cut(LONGEST) };
        let line = |(place, characters): (usize, &[(u8, Option<BadKind>)])| {
            let payload = payload(characters);
            let (what, spread) = match way {
                Way::Send => (What::Expected(Expected::Send(payload)), true),
                Way::Burst if characters.len() > 1 => (What::Given(Given::Burst(payload)), true),
                Way::Burst => (What::Given(Given::Receive(payload)), true),
                Way::At => (What::Given(Given::Receive(payload)), false),
            };
            let at = at + if spread { pace.of_characters(place * longest) } else { 0 };
            Event { at, what, place: 0 }
        };
        characters.chunks(longest).enumerate().map(line).collect()
    }
}

/// Text where all of a run of good characters can be read, else hex pairs.
fn payload(characters: &[(u8, Option<BadKind>)]) -> Payload {
    let mut items = Vec::new();
    for run in characters.chunk_by(|(_, before), (_, next)| before.is_none() && next.is_none()) {
        match run {
            [(byte, Some(kind))] => items.push(Item::Bad { kind: *kind, byte: *byte }),
            good => {
                let bytes: Vec<u8> = good.iter().map(|(byte, _)| *byte).collect();
                items.extend_from_slice(Payload::from_bytes(&bytes).items());
            }
        }
    }
    Payload::new(items)
}
