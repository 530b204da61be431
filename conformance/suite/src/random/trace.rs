//! A session as a trace: what was given, what the plug-in did, and what is wrong.

use crate::given::lines::{assignments, damaged, entry, line_settings, modem_levels};
use crate::run::seen::Seen;
use crate::run::transcript;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Micros, ModemLines};
use softplug_models::{
    Finding, Given, HostRequest as Asked, LineInput, Profile, Ran, Session, Step,
};
use softplug_trace::{
    self as trace, Drain, Entry, FrontMatter, HostRequest, Level, Line, LineEvent, ModemLevels,
    Origin, Payload, Permutations, Room, Trace, What,
};

/// Bytes that stand on one line.
const BYTES: usize = 64;

/// The session as it ran.
pub(super) fn of_session(
    profile: &Profile,
    session: &Session,
    ran: &Ran,
    manifest: &Manifest,
) -> Trace {
    let conditions = &session.conditions;
    let known = conditions.modem_lines.map_or(ModemLines::default(), |(known, _)| known);
    // The first step opens the link, which a trace does by itself.
    let mut entries: Vec<Entry> = ran
        .steps
        .iter()
        .skip(1)
        .filter_map(|(at, step)| Some(entry(*at, What::Given(given_as(step, known)?))))
        .collect();
    let is_cut = |at: Micros| entries.iter().any(|entry| micros(entry) == at);
    entries.extend(transcript::entries(conditions.line, manifest, &seen(ran), BYTES, is_cut));
    entries.sort_by_key(|entry| entry.when.from);
    let mut body: Vec<Line> = entries.into_iter().map(Line::Entry).collect();
    if conditions.clock > Micros::ZERO {
        body.insert(0, Line::Comment(format!(" The link's clock began at {}.", conditions.clock)));
    }
    let mut clause = profile.clauses.first().copied().unwrap_or(profile.name);
    match &ran.finding {
        Some(Finding::Broken { at, broken }) => {
            clause = broken.clause;
            body.push(Line::Comment(format!(" {at}: {clause}: {}", broken.message)));
        }
        Some(Finding::Fault { at, message }) => {
            body.push(Line::Comment(format!(" {at}: {message}")));
        }
        None => {}
    }
    body.push(Line::Entry(entry(ran.end, What::Quiet)));
    let front = FrontMatter {
        id: format!("{}.random.session-{}-{}", profile.name, session.seed(), session.number()),
        title: format!("Random session {} of seed {}", session.number(), session.seed()),
        profile: profile.name.to_owned(),
        clauses: vec![clause.to_owned()],
        level: Level::Must,
        edge: None,
        line: line_settings(conditions.line, conditions.depth),
        config: assignments(&session.asked),
        room: Room {
            transmit: Some(conditions.transmit_room),
            delivery: Some(conditions.delivery_room),
        },
        modem: conditions
            .modem_lines
            .map_or_else(ModemLevels::default, |(named, on)| modem_levels(named, on)),
        since: 1,
        origin: Origin::Generated { generator: "softplug".to_owned(), seed: session.seed() },
        permute: Permutations::ALL,
        leaves: String::new(),
        bytes: None,
    };
    Trace { front, body }
}

/// All that the plug-in did.
pub(super) fn seen(ran: &Ran) -> Vec<Seen> {
    ran.observed.iter().filter_map(|(at, what)| Seen::of(*at, what.clone())).collect()
}

fn micros(entry: &Entry) -> Micros {
    crate::given::timeline::micros(entry.when.from)
}

/// `None` for what is no line of a trace: time that goes by, and modem lines that the port has not.
pub(crate) fn given_as(step: &Step, known: ModemLines) -> Option<trace::Given> {
    Some(match step {
        Step::Swap => trace::Given::Host(HostRequest::Swap),
        Step::Given(Given::Nothing) => return None,
        Step::Given(Given::Line(LineInput::ModemLines(named, _))) if named.0 & known.0 == 0 => {
            return None;
        }
        Step::Given(Given::Line(input)) => heard(input, known),
        Step::Given(Given::Host(request)) => trace::Given::Host(asked(request)),
    })
}

fn heard(input: &LineInput, known: ModemLines) -> trace::Given {
    match input {
        LineInput::Bytes(bytes) => trace::Given::Receive(Payload::hex(bytes)),
        LineInput::Damaged { kind, byte, span } => damaged(*kind, *byte, *span),
        LineInput::ModemLines(named, on) => {
            let named = ModemLines(named.0 & known.0);
            trace::Given::Line(LineEvent::Modem(modem_levels(named, *on)))
        }
        LineInput::Down(reason) => trace::Given::Line(LineEvent::Down(*reason)),
        LineInput::Up => trace::Given::Line(LineEvent::Up),
    }
}

fn asked(request: &Asked) -> HostRequest {
    match request {
        Asked::Open => HostRequest::Open,
        Asked::Close => HostRequest::Close,
        Asked::Job { id, kind, fields, data } => HostRequest::Job {
            id: *id,
            kind: kind.clone(),
            fields: assignments(fields),
            data: Payload::from_bytes(data),
        },
        Asked::Pause(job) => HostRequest::Pause(*job),
        Asked::Resume(job) => HostRequest::Resume(*job),
        Asked::Abort(job) => HostRequest::Abort(*job),
        Asked::ForceResume => HostRequest::ForceResume,
        Asked::Keep => HostRequest::Drain(Drain::Off),
        Asked::PutAway(bytes) => HostRequest::Room(Room { transmit: None, delivery: Some(*bytes) }),
        Asked::PutAllAway => HostRequest::Drain(Drain::Auto),
        Asked::Answer(id, Ok(data)) => {
            HostRequest::Grant { id: *id, data: Payload::from_bytes(data) }
        }
        Asked::Answer(id, Err(failure)) => HostRequest::Refuse { id: *id, failure: *failure },
    }
}
