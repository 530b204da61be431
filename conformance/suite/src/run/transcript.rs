//! What was given and seen, as lines of a trace.

use super::back_to_back::Run;
use super::seen::Seen;
use crate::given::case::Case;
use crate::given::lines::{entry, line_parameters};
use crate::given::timeline::micros;
use softplug_abi::manifest::Manifest;
use softplug_abi::{LineParameters, Micros};
use softplug_link::Observed;
use softplug_trace::{Entry, Expected, Payload, What};
#[cfg(feature = "wasmtime")]
use softplug_trace::{Line, Trace};

/// Characters of a line that are shown.
const WIDTH: usize = 100;
/// Bytes that stand on one shown line.
const BYTES: usize = 16;
/// Bytes that stand on one line of an observed trace.
#[cfg(feature = "wasmtime")]
const OBSERVED_BYTES: usize = 1_024;
/// Lines of what was before.
const BEFORE: usize = 8;

/// An entry as its trace would hold it, cut to a readable length.
pub(crate) fn line(entry: &Entry) -> String {
    let line = entry.to_string();
    match line.char_indices().nth(WIDTH) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

/// What was seen as entries: bytes that follow each other at once stand on one
/// line, of at most `most` bytes, unless `is_cut` cuts before one.
pub(crate) fn entries(
    line: LineParameters,
    manifest: &Manifest,
    seen: &[Seen],
    most: usize,
    is_cut: impl Fn(Micros) -> bool,
) -> Vec<Entry> {
    let mut run = Run::new(line);
    let mut entries = Vec::new();
    let mut open: Option<(Micros, Vec<u8>)> = None;
    let close = |open: &mut Option<(Micros, Vec<u8>)>, entries: &mut Vec<Entry>| {
        if let Some((at, bytes)) = open.take() {
            entries.push(entry(at, What::Expected(Expected::Send(payload(&bytes)))));
        }
    };
    for seen in seen {
        let Observed::Byte(byte) = seen.what else {
            close(&mut open, &mut entries);
            entries.extend(seen.entry(manifest));
            continue;
        };
        let follows = run.add(seen.at);
        let joins = follows
            && open.as_ref().is_some_and(|(_, bytes)| bytes.len() < most)
            && !is_cut(seen.at);
        if !joins {
            close(&mut open, &mut entries);
        }
        open.get_or_insert((seen.at, Vec::new())).1.push(byte);
    }
    close(&mut open, &mut entries);
    entries
}

/// Single bytes are clearer as hex.
fn payload(bytes: &[u8]) -> Payload {
    if bytes.len() < 4 { Payload::hex(bytes) } else { Payload::from_bytes(bytes) }
}

/// The last lines of what was given and seen until `at`.
pub(crate) fn before(case: &Case, manifest: &Manifest, seen: &[Seen], at: Micros) -> Vec<String> {
    let given = case.trace.inputs().cloned();
    let seen = entries(line_of(case), manifest, seen, BYTES, |_| false);
    let mut all: Vec<Entry> =
        given.chain(seen).filter(|entry| micros(entry.when.from) <= at).collect();
    all.sort_by_key(|entry| entry.when.from);
    let first = all.len().saturating_sub(BEFORE);
    all[first..].iter().map(line).collect()
}

/// The case with what was seen in the place of what it demands. Comments are lost.
#[cfg(feature = "wasmtime")]
pub(crate) fn observed(case: &Case, manifest: &Manifest, seen: &[Seen]) -> Trace {
    let seen = entries(line_of(case), manifest, seen, OBSERVED_BYTES, |_| false);
    let stays = |entry: &&Entry| entry.what.is_input() || matches!(entry.what, What::Quiet);
    let mut all: Vec<Entry> = case.trace.entries().filter(stays).cloned().chain(seen).collect();
    all.sort_by_key(|entry| entry.when.from);
    let body = all.into_iter().map(Line::Entry).collect();
    Trace { front: case.trace.front.clone(), body }
}

/// The first line of what follows; without the count of what has left, if it is not counted.
pub(crate) fn next(case: &Case, manifest: &Manifest, seen: &[Seen], is_counted: bool) -> String {
    let ahead = &seen[..seen.len().min(BYTES)];
    let mut entries = entries(line_of(case), manifest, ahead, BYTES, |_| false);
    let Some(first) = entries.first_mut() else { return "nothing".to_owned() };
    if let What::Expected(Expected::Done { sent, .. } | Expected::Fail { sent, .. }) =
        &mut first.what
    {
        *sent = sent.filter(|_| is_counted);
    }
    line(first)
}

fn line_of(case: &Case) -> LineParameters {
    line_parameters(&case.trace.front.line)
}
