//! Which cases may stand behind each other on one open link.

use super::case::Case;
use sha2::{Digest as _, Sha256};
use softplug_trace::{Expected, FrontMatter, Given, HostRequest, LineEvent, Trace, What};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Cases before each, at most.
const BEFORE: usize = 4;

/// Long use: a case behind itself until it has run so many times, was given so many inputs, or
/// has moved so many bytes. The shortest ones go on for longer than 16 bits count.
const LONG_ROUNDS: u64 = 20_000;
const LONG_INPUTS: u64 = 150_000;
const LONG_BYTES: u64 = 6 << 20;
const SHORT_ROUNDS: u64 = 66_000;
const SHORT_INPUTS: u64 = 500_000;

/// Tells each case which ones may stand before it: some of those that are run on the
/// same line with the same settings and leave nothing.
pub(crate) fn find_neighbours(cases: &mut [Case]) {
    let mut alike: BTreeMap<String, Vec<Arc<Case>>> = BTreeMap::new();
    for case in cases.iter().filter(|case| case.leaves_nothing()) {
        alike.entry(conditions(&case.trace.front)).or_default().push(Arc::new(case.clone()));
    }
    for case in cases {
        let front = &case.trace.front;
        let others = alike.get(&conditions(front)).into_iter().flatten();
        let mut others: Vec<_> =
            others.filter(|other| other.trace.front.id != front.id).cloned().collect();
        // Others for each, and the same ones each time.
        others.sort_by_cached_key(|other| {
            Sha256::digest(format!("{} {}", front.id, other.trace.front.id))
        });
        others.truncate(BEFORE);
        case.before = others;
    }
}

/// Picks the cases that are repeated until they are long use: of each part of a profile the one
/// with the fewest inputs, and the one that moves the most bytes.
pub(crate) fn find_long(cases: &mut [Case]) {
    let mut picked: BTreeMap<(String, bool), (u64, usize)> = BTreeMap::new();
    for (place, case) in cases.iter().enumerate() {
        let front = &case.trace.front;
        let has_fixed_rooms = front.room.transmit.is_some() || front.room.delivery.is_some();
        if !case.leaves_nothing() || !comes_to_an_end(&case.trace) || has_fixed_rooms {
            continue;
        }
        let part: Vec<&str> = front.id.split('.').take(2).collect();
        let mut pick = |is_bulk: bool, rank: u64| {
            let best = picked.entry((part.join("."), is_bulk)).or_insert((rank, place));
            *best = (*best).min((rank, place));
        };
        pick(false, inputs(&case.trace));
        pick(true, u64::MAX - bytes(&case.trace));
    }
    for ((_, is_bulk), (_, place)) in picked {
        let trace = &cases[place].trace;
        let most = LONG_ROUNDS.min(LONG_INPUTS / inputs(trace).max(1));
        // A case that is both is short.
        let is_short = !is_bulk && SHORT_ROUNDS * inputs(trace) <= SHORT_INPUTS;
        let most = if is_short { SHORT_ROUNDS } else { most };
        let most = most.max(cases[place].long.unwrap_or_default().into());
        cases[place].long = Some(most.min(LONG_BYTES / bytes(trace).max(1)).max(1) as u32);
    }
}

/// Inputs: bytes that can be cut are as many as there are.
fn inputs(trace: &Trace) -> u64 {
    trace.inputs().count() as u64
}

/// Bytes that are sent and received, as far as it is known.
fn bytes(trace: &Trace) -> u64 {
    let payloads = trace.inputs().filter_map(|entry| entry.what.payload());
    payloads.filter_map(softplug_trace::Payload::length).sum()
}

/// Whether a job or a delivery is done.
fn comes_to_an_end(trace: &Trace) -> bool {
    let mut entries = trace.variants().into_iter().next().unwrap_or_default().into_iter();
    entries.any(|entry| {
        matches!(entry.what, What::Expected(Expected::Done { .. } | Expected::Deliver { .. }))
    })
}

impl Case {
    /// Whether the link is at its end as it was at the start: open, nothing under way,
    /// nobody held.
    pub(crate) fn leaves_nothing(&self) -> bool {
        let front = &self.trace.front;
        if !(front.leaves.is_empty() && front.permute.after) || self.trace.is_recording() {
            return false;
        }
        let (mut is_open, mut is_up) = (true, true);
        let mut modem = front.modem.0.clone();
        for entry in self.trace.inputs() {
            match &entry.what {
                What::Given(Given::Host(HostRequest::Close)) => is_open = false,
                What::Given(Given::Host(HostRequest::Open)) => (is_open, is_up) = (true, true),
                What::Given(Given::Line(LineEvent::Down(_))) => is_up = false,
                What::Given(Given::Line(LineEvent::Up)) => is_up = true,
                What::Given(Given::Line(LineEvent::Modem(levels))) => {
                    modem.extend(levels.0.iter().map(|(line, on)| (*line, *on)));
                }
                _ => {}
            }
        }
        is_open && is_up && modem == front.modem.0 && !has_open_ends(&self.trace)
    }
}

/// Whether a job has begun that does not end, or a request stands that is not answered.
fn has_open_ends(trace: &Trace) -> bool {
    let (mut jobs, mut requests) = (BTreeSet::new(), BTreeSet::new());
    for entry in trace.variants().into_iter().next().unwrap_or_default() {
        match &entry.what {
            What::Given(Given::Host(HostRequest::Job { id, .. })) => drop(jobs.insert(*id)),
            What::Expected(
                Expected::Done { id, .. }
                | Expected::Fail { id, .. }
                | Expected::Check { id, failure: Some(_), .. },
            ) => drop(jobs.remove(id)),
            What::Expected(Expected::Request { id, .. }) => drop(requests.insert(*id)),
            What::Expected(Expected::Withdraw(id))
            | What::Given(Given::Host(
                HostRequest::Grant { id, .. } | HostRequest::Refuse { id, .. },
            )) => {
                requests.remove(id);
            }
            _ => {}
        }
    }
    !(jobs.is_empty() && requests.is_empty())
}

/// What a link is opened with.
fn conditions(front: &FrontMatter) -> String {
    let mut config: Vec<_> =
        front.config.iter().map(|pair| format!("{}={}", pair.name, pair.value)).collect();
    config.sort();
    let FrontMatter { profile, line, room, modem, .. } = front;
    format!("{profile} {line:?} {config:?} {room:?} {modem:?}")
}
