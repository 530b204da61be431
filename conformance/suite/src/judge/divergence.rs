//! Where a run first leaves its trace, for people and for programs.

use super::compare::Mismatch;
use super::demand::Demand;
use crate::given::case::Case;
use crate::given::lines::line_parameters;
use crate::run::back_to_back::Run;
use crate::run::seen::Seen;
use crate::run::transcript;
use serde::Serialize;
use softplug_abi::manifest::Manifest;
use softplug_abi::{LineParameters, Micros};
use softplug_link::Observed;
use std::fmt;

/// Bytes shown on either side of the difference.
const AROUND: usize = 8;

/// The first difference between what was demanded and what was seen.
///
/// The example of [`Failure`](crate::Failure) shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Divergence {
    /// When, in µs of the trace's time.
    pub at_us: i64,
    /// The line of the trace's file that is not fulfilled.
    pub line: Option<u32>,
    /// What was demanded from there on.
    pub expected: Side,
    /// What was seen from there on.
    pub observed: Side,
}

/// One side of a divergence.
///
/// The example of [`Failure`](crate::Failure) shows both.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Side {
    /// As a line of a trace; `nothing` if there is none.
    pub text: String,
    /// Bytes around the place, those before it included; the two sides begin at
    /// the same place.
    pub bytes: Vec<u8>,
}

impl Divergence {
    /// Between what a trace demands and what was seen.
    pub(crate) fn from_trace(
        case: &Case,
        manifest: &Manifest,
        demands: &[Demand],
        seen: &[Seen],
        mismatch: Mismatch,
    ) -> Self {
        let demanded = mismatch.expected.map(|(number, done)| {
            let demand = &demands[number];
            // Behind its first byte a line is due where that put it.
            let due = if done == 0 { demand.from } else { mismatch.due };
            rest(demand, done, due, line_parameters(&case.trace.front.line))
        });
        let line = mismatch.expected.map(|(number, _)| demands[number].line);
        let is_counted = mismatch.expected.is_none_or(|(number, _)| demands[number].is_counted());
        let demanded = (&demanded.unwrap_or_default()[..], is_counted);
        let place = mismatch.observed.unwrap_or(seen.len());
        Self::new(case, manifest, mismatch.at, line, demanded, seen, place)
    }

    /// Between two runs that should be the same.
    pub(crate) fn between_runs(
        case: &Case,
        manifest: &Manifest,
        base: &[Seen],
        seen: &[Seen],
        place: usize,
    ) -> Self {
        let at = [base.get(place), seen.get(place)].into_iter().flatten().map(|seen| seen.at).min();
        let at = at.unwrap_or_default();
        Self::new(case, manifest, at, None, (&base[place.min(base.len())..], true), seen, place)
    }

    fn new(
        case: &Case,
        manifest: &Manifest,
        at: Micros,
        line: Option<u32>,
        (demanded, is_counted): (&[Seen], bool),
        seen: &[Seen],
        place: usize,
    ) -> Self {
        let (before, observed) = seen.split_at(place.min(seen.len()));
        let text = |ahead: &[Seen], is_counted: bool| {
            let next = transcript::next(case, manifest, ahead, is_counted);
            let is_later = ahead.first().is_some_and(|first| first.at > at);
            if is_later { format!("nothing; then {next}") } else { next }
        };
        // What is due later, or happens later, is not what differs here.
        let line_parameters = line_parameters(&case.trace.front.line);
        let (expected_bytes, observed_bytes) =
            bytes(now(demanded, at), now(observed, at), before, line_parameters);
        Self {
            at_us: at.0,
            line,
            expected: Side { text: text(demanded, is_counted), bytes: expected_bytes },
            observed: Side { text: text(observed, true), bytes: observed_bytes },
        }
    }
}

/// What lies ahead, if it begins at this time.
fn now(ahead: &[Seen], at: Micros) -> &[Seen] {
    if ahead.first().is_some_and(|first| first.at > at) { &[] } else { ahead }
}

/// What is left of a demand from its thing `done` on, which is due at `at`. The times of
/// the bytes behind it are those of a line that begins there.
fn rest(demand: &Demand, done: usize, at: Micros, line: LineParameters) -> Vec<Seen> {
    let last = demand.length().min(done + AROUND);
    let things = (done..last).enumerate();
    things
        .map(|(n, number)| Seen { at: at + line.characters(n as u64), what: demand.thing(number) })
        .collect()
}

/// Bytes of both sides from the same place on; none where bytes are not what
/// differs.
fn bytes(
    demanded: &[Seen],
    observed: &[Seen],
    before: &[Seen],
    line: LineParameters,
) -> (Vec<u8>, Vec<u8>) {
    let first = |seen: &[Seen]| seen.first().map(|seen| seen.what.clone());
    match (first(demanded), first(observed)) {
        (Some(Observed::Delivery(expected)), Some(Observed::Delivery(observed)))
            if expected.bytes != observed.bytes =>
        {
            let same = expected.bytes.iter().zip(&observed.bytes);
            let same = same.take_while(|(expected, observed)| expected == observed).count();
            let around = |bytes: &[u8]| {
                let (from, to) = (same.saturating_sub(AROUND), bytes.len().min(same + AROUND));
                bytes[from..to].to_vec()
            };
            (around(&expected.bytes), around(&observed.bytes))
        }
        (Some(Observed::Byte(_)), _) | (_, Some(Observed::Byte(_))) => {
            let before = sent(before);
            let before = before[before.len().saturating_sub(AROUND)..].to_vec();
            // As far as they follow each other at once.
            let ahead = |seen: &[Seen]| -> Vec<u8> {
                let mut run = Run::new(line);
                let bytes = seen.iter().enumerate().map_while(|(number, seen)| match seen.what {
                    Observed::Byte(byte) if run.add(seen.at) || number == 0 => Some(byte),
                    _ => None,
                });
                before.iter().copied().chain(bytes.take(AROUND)).collect()
            };
            (ahead(demanded), ahead(observed))
        }
        _ => (Vec::new(), Vec::new()),
    }
}

fn sent(seen: &[Seen]) -> Vec<u8> {
    let byte = |seen: &Seen| match seen.what {
        Observed::Byte(byte) => Some(byte),
        _ => None,
    };
    seen.iter().filter_map(byte).collect()
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "  at {}", Micros(self.at_us))?;
        writeln!(f, "    expected  {}", self.expected.text)?;
        writeln!(f, "    observed  {}", self.observed.text)?;
        let (expected, observed) = (&self.expected.bytes, &self.observed.bytes);
        let width = expected.len().max(observed.len());
        if width == 0 {
            return Ok(());
        }
        writeln!(f, "    expected  {}", hex(expected, width))?;
        writeln!(f, "    observed  {}", hex(observed, width))?;
        let differs = |place: &usize| expected.get(*place) != observed.get(*place);
        match (0..width).find(differs) {
            Some(place) => writeln!(f, "              {}^^", " ".repeat(3 * place)),
            None => writeln!(f, "              the same bytes at another time"),
        }
    }
}

/// `41 42 -- --  |AB  |`
fn hex(bytes: &[u8], width: usize) -> String {
    let pairs = (0..width).map(|place| match bytes.get(place) {
        Some(byte) => format!("{byte:02X} "),
        None => "-- ".to_owned(),
    });
    let text = (0..width).map(|place| match bytes.get(place) {
        Some(byte @ b' '..=b'~') => char::from(*byte),
        Some(_) => '.',
        None => ' ',
    });
    format!("{} |{}|", pairs.collect::<String>(), text.collect::<String>())
}
