//! A record of a live session becomes a case: what the partner sent stays, the plug-in is asked
//! for what it was asked for, and what it does is taken over where it sends what was recorded.

use crate::given::case::Case;
use crate::given::lines::line_parameters;
use crate::given::timeline::micros;
use crate::judge::run::Judge;
use crate::run::fault::Fault;
use crate::run::permute::Permutation;
use crate::run::seen::Seen;
use crate::show::bless::with_seen;
use crate::show::sent::{self, Recorded, Sign, seconds, shown};
use softplug_abi::{LineParameters, Micros};
use softplug_link::Observed;
use softplug_trace::{
    BlessError, Entry, Expected, Given, HostRequest, Item, Line, Payload, SourceLine, Time, Trace,
    What, When,
};
use std::fmt;

/// How long the host asked before the first event, where the partner began.
const LEAD: Micros = Micros::from_millis(500);
/// How long an end is waited for that comes of itself: a delivery that a pause ends.
const WAIT: Micros = Micros::from_secs(60);
/// Places at which a request is tried.
const PLACES: usize = 32;

/// What became of a record.
///
/// The example of [`case_of_record`] shows one.
#[derive(Clone, Debug)]
pub struct Made {
    /// The trace: a case, or what could be made of it.
    pub trace: Trace,
    /// Which of the two.
    pub standing: Standing,
}

/// Whether a record is a case of a plug-in.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Standing {
    /// The plug-in sends every byte that was recorded, and no other.
    Case {
        /// Where the case ends before the record does, as nobody answered any more.
        cut: Option<Micros>,
    },
    /// It sends something else: its lines stay as they were recorded.
    Differs {
        /// How many bytes agree until there.
        agreed: usize,
        /// When the first other byte was recorded, and which came then.
        recorded: Option<(Micros, Vec<u8>)>,
        /// When the plug-in sends another, and which.
        sent: Option<(Micros, Vec<u8>)>,
    },
    /// It could not be run to the end.
    Fault(Fault),
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = |place: &Option<(Micros, Vec<u8>)>| match place {
            Some((at, bytes)) if bytes.is_empty() => format!("a break at {}", seconds(*at)),
            Some((at, bytes)) => format!("{} at {}", shown(bytes), seconds(*at)),
            None => "nothing".to_owned(),
        };
        match self {
            Self::Case { cut: None } => f.write_str("the plug-in sends what was recorded"),
            Self::Case { cut: Some(at) } => write!(
                f,
                "the plug-in sends what was recorded until {}; what came later is left out, as it \
                 would have answered and nobody did",
                seconds(*at)
            ),
            Self::Differs { agreed, recorded, sent } => {
                write!(f, "recorded was {}, the plug-in sends {}", place(recorded), place(sent))?;
                match agreed {
                    0 => Ok(()),
                    1 => f.write_str("; the byte before agrees"),
                    agreed => write!(f, "; the {agreed} bytes before agree"),
                }
            }
            Self::Fault(fault) => {
                write!(f, "the plug-in {}: {}", fault.class.text(), fault.message)
            }
        }
    }
}

/// Makes a case of a record: `<`, `<<`, `>` and `!` lines as a recorder writes them, with the
/// settings of the plug-in in its front matter. Each request, in their order, is asked for when the
/// bytes begin that the plug-in sends for it, or half a second before the first event. Where the
/// plug-in then sends the bytes that were recorded, all it does is taken over, at its own times.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, RecordStanding, case_of_record, load};
/// use softplug_native::NativePlugin;
/// use softplug_trace::HostRequest;
///
/// let plugin = NativePlugin::R3964;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/r3964/r3964.tx.recorded-goryachev.spt"])?[0];
/// // Without requests and expectations it is what was recorded.
/// let is_request = |what: &softplug_trace::What| matches!(what, softplug_trace::What::Given(softplug_trace::Given::Host(_)));
/// let mut record = case.trace.clone();
/// record.body.retain(|line| !line.entry().is_some_and(|entry| is_request(&entry.what)));
/// let request = case.trace.inputs().find_map(|entry| match &entry.what {
///     softplug_trace::What::Given(softplug_trace::Given::Host(request @ HostRequest::Job { .. })) => Some(request.clone()),
///     _ => None,
/// });
/// let made = case_of_record(&subject, &case.with_trace(record), &[request.unwrap()])?;
/// assert_eq!(made.standing, RecordStanding::Case { cut: None });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The trace cannot hold what the plug-in does.
pub fn case_of_record(
    subject: &dyn Judge,
    record: &Case,
    requests: &[HostRequest],
) -> Result<Made, BlessError> {
    let mut best: Option<Attempt> = None;
    let joined = record.with_trace(record.trace.at_line_rate());
    // A character that stands at another time may have another answer: then they stay as they came.
    'found: for base in [&joined, record] {
        let leads = [None, Some(LEAD)];
        for lead in leads.into_iter().take(if requests.is_empty() { 1 } else { 2 }) {
            let attempt = Attempt::place(subject, base, requests, lead);
            let is_case = attempt.ends_at().is_some();
            if best.as_ref().is_none_or(|best| is_case || attempt.score() > best.score()) {
                best = Some(attempt);
            }
            if is_case {
                break 'found;
            }
        }
    }
    best.unwrap_or_else(|| Attempt::new(subject, joined)).made(subject)
}

/// A record with requests at some places, and what the plug-in does then.
struct Attempt {
    case: Case,
    /// What the record holds as sent.
    stood: Vec<Recorded>,
    /// What is seen until [`WAIT`] behind the record's end.
    seen: Vec<Seen>,
    sent: Vec<(Micros, Sign)>,
    fault: Option<Fault>,
    agreed: usize,
}

impl Attempt {
    fn new(subject: &dyn Judge, case: Case) -> Self {
        let mut longer = case.trace.clone();
        let end = micros(longer.end()) + WAIT;
        longer.body.push(quiet(end));
        let outcome = subject.run(&case.with_trace(longer), &Permutation::Uncut, 0);
        let stood = sent::recorded(&case, case.trace.entries());
        let sent = sent::sent(&outcome.seen);
        let agreed = sent::same(&stood, &sent);
        Self { case, stood, seen: outcome.seen, sent, fault: outcome.fault, agreed }
    }

    /// Each request where the most agrees, the earliest of such places.
    fn place(
        subject: &dyn Judge,
        base: &Case,
        requests: &[HostRequest],
        lead: Option<Micros>,
    ) -> Self {
        let mut first = base.trace.clone();
        if let Some(lead) = lead {
            first.body.iter_mut().for_each(|line| put_off(line, lead));
        }
        let mut best = Self::new(subject, base.with_trace(first));
        let mut from = Micros::ZERO;
        for (number, request) in requests.iter().enumerate() {
            let places = match lead {
                Some(_) if number == 0 => vec![Micros::ZERO],
                _ => places(&best.case, from),
            };
            let mut found: Option<(Micros, Self)> = None;
            for place in places {
                let case = best.case.with_trace(asked(&best.case.trace, place, request));
                let attempt = Self::new(subject, case);
                let is_case = attempt.ends_at().is_some();
                if found
                    .as_ref()
                    .is_none_or(|(_, found)| is_case || attempt.score() > found.score())
                {
                    found = Some((place, attempt));
                }
                if is_case {
                    break;
                }
            }
            let Some((place, attempt)) = found else { break };
            (from, best) = (place, attempt);
        }
        best
    }

    fn score(&self) -> (bool, usize) {
        (self.fault.is_none(), self.agreed)
    }

    /// Where the case ends; `None` if it is none.
    fn ends_at(&self) -> Option<Micros> {
        if self.fault.is_some() || self.agreed < self.stood.len() {
            return None;
        }
        let end = micros(self.case.trace.end());
        let next = self.sent.get(self.agreed).map(|(at, _)| *at);
        match next.filter(|next| *next <= end) {
            None => Some(self.waited(end, next)),
            // From here on it would have spoken, and nobody did: the session was over.
            Some(next) => (self.has_ended(next) && next > Micros::ZERO).then(|| next - Micros(1)),
        }
    }

    /// The record's end, or the end of a job or delivery that comes of itself, without a byte.
    fn waited(&self, end: Micros, next: Option<Micros>) -> Micros {
        let is_good = |seen: &&Seen| match &seen.what {
            Observed::Done { .. } => true,
            Observed::Delivery(delivery) => delivery.failure.is_none(),
            _ => false,
        };
        let before = |seen: &&Seen| next.is_none_or(|next| seen.at < next);
        let last = self.seen.iter().filter(before).filter(is_good).map(|seen| seen.at).max();
        last.map_or(end, |last| last.max(end))
    }

    /// Whether something came of the session before then, and nothing of it is open.
    fn has_ended(&self, by: Micros) -> bool {
        let asked = self.case.trace.inputs().filter_map(|entry| match &entry.what {
            What::Given(Given::Host(HostRequest::Job { id, .. })) => Some(*id),
            _ => None,
        });
        let asked: Vec<u32> = asked.collect();
        let before = || self.seen.iter().filter(|seen| seen.at < by);
        let is_over = |id: &u32| {
            before().any(|seen| match &seen.what {
                Observed::Done { job, .. } | Observed::Failed { job, .. } => job.0 == *id,
                _ => false,
            })
        };
        let is_something = |seen: &Seen| {
            matches!(
                seen.what,
                Observed::Done { .. } | Observed::Failed { .. } | Observed::Delivery(_)
            )
        };
        asked.iter().all(is_over) && before().any(is_something)
    }

    fn made(self, subject: &dyn Judge) -> Result<Made, BlessError> {
        let Some(end) = self.ends_at() else {
            let standing = match self.fault {
                Some(fault) => Standing::Fault(fault),
                None => self.difference(),
            };
            return Ok(Made { trace: self.case.trace, standing });
        };
        let last = micros(self.case.trace.end());
        let mut trace = self.case.trace.clone();
        let cut = (end < last).then_some(end);
        if let Some(end) = cut {
            trace = until(&trace, end);
            trace.body.push(comment(&format!(
                "What came after {} is left out: nobody answered it any more.",
                seconds(end)
            )));
        } else if end > last {
            let text = format!("Nothing came any more; recorded until {}.", seconds(last));
            trace.body.retain(|line| !is_quiet(line));
            trace.body.push(comment(&text));
        }
        trace.body.retain(|line| !is_quiet(line));
        trace.body.push(quiet(end));
        let seen: Vec<Seen> = self.seen.into_iter().filter(|seen| seen.at <= end).collect();
        let trace = with_seen(subject, &self.case.with_trace(trace), &seen)?;
        Ok(Made { trace, standing: Standing::Case { cut } })
    }

    fn difference(&self) -> Standing {
        let bytes = |signs: &mut dyn Iterator<Item = Sign>| -> Vec<u8> {
            let byte = |sign| match sign {
                Sign::Byte(byte) => Some(byte),
                Sign::Break => None,
            };
            signs.map_while(byte).take(16).collect()
        };
        let stood = &self.stood[self.agreed..];
        let sent = &self.sent[self.agreed..];
        Standing::Differs {
            agreed: self.agreed,
            recorded: stood
                .first()
                .map(|first| (first.at, bytes(&mut stood.iter().map(|stood| stood.sign)))),
            sent: sent.first().map(|(at, _)| (*at, bytes(&mut sent.iter().map(|(_, sign)| *sign)))),
        }
    }
}

/// When bytes of ours begin that do not follow others at once.
fn places(case: &Case, from: Micros) -> Vec<Micros> {
    let line = line_parameters(&case.trace.front.line);
    let mut places = Vec::new();
    let mut over = None;
    for entry in case.trace.entries() {
        let at = micros(entry.when.from);
        let length = match &entry.what {
            What::Expected(Expected::Send(payload)) => payload.length().unwrap_or(0),
            What::Expected(Expected::SendBreak(_)) => 1,
            _ => continue,
        };
        // As a recorder's times go, less than a character is no pause.
        let follows = over.is_some_and(|over: Micros| at <= over + line.characters(1));
        if !follows && at >= from && places.len() < PLACES {
            places.push(at);
        }
        over = Some(at + line.characters(length));
    }
    // Nothing was sent any more: it is asked all the same, and says itself what it would have done.
    if places.is_empty() {
        places.push(from);
    }
    places
}

/// The trace with a request before all else of its time.
fn asked(trace: &Trace, at: Micros, request: &HostRequest) -> Trace {
    let mut trace = trace.clone();
    let is_later = |line: &Line| line.entry().is_some_and(|entry| micros(entry.when.from) >= at);
    let is_comment = |line: &Line| matches!(line, Line::Comment(_));
    let mut place = trace.body.iter().position(is_later).unwrap_or(trace.body.len());
    while place > 0 && is_comment(&trace.body[place - 1]) {
        place -= 1;
    }
    // What stands above all lines is about all of them.
    if place == 0 {
        place = trace.body.iter().take_while(|line| is_comment(line)).count();
    }
    trace.body.insert(place, entry(at, What::Given(Given::Host(request.clone()))));
    trace
}

fn put_off(line: &mut Line, lead: Micros) {
    if let Line::Entry(entry) = line {
        let lead = lead.0.max(0) as u64;
        entry.when.from.0 += lead;
        entry.when.to.0 += lead;
    }
}

/// The trace without what comes after that.
fn until(trace: &Trace, end: Micros) -> Trace {
    let line = line_parameters(&trace.front.line);
    let mut shorter = trace.clone();
    shorter.body.retain_mut(|kept| {
        let Line::Entry(entry) = kept else { return true };
        if micros(entry.when.from) > end {
            return false;
        }
        if let What::Given(Given::Burst(payload)) = &entry.what {
            entry.what =
                What::Given(Given::Burst(first(payload, line, end - micros(entry.when.from))));
        }
        true
    });
    // Comments at the end were about what is gone.
    while matches!(shorter.body.last(), Some(Line::Comment(_) | Line::Blank)) {
        shorter.body.pop();
    }
    shorter
}

/// The characters of a `<<` line that have come by then.
fn first(payload: &Payload, line: LineParameters, within: Micros) -> Payload {
    let mut number = 0;
    let mut came = || {
        number += 1;
        line.characters(number - 1) <= within
    };
    let mut items = Vec::new();
    for item in payload.items() {
        match item {
            Item::Hex(bytes) => {
                items.push(Item::Hex(bytes.iter().copied().take_while(|_| came()).collect()));
            }
            Item::Text(bytes) => {
                let bytes: Vec<u8> = bytes.iter().copied().take_while(|_| came()).collect();
                items.extend(Payload::from_bytes(&bytes).items().iter().cloned());
            }
            Item::Bad { .. } if came() => items.push(item.clone()),
            Item::Bad { .. } => {}
            // A recorder writes neither files nor generated bytes.
            Item::File(_) | Item::Generated(_) => items.push(item.clone()),
        }
    }
    Payload::new(items)
}

fn is_quiet(line: &Line) -> bool {
    line.entry().is_some_and(|entry| entry.what == What::Quiet)
}

fn quiet(at: Micros) -> Line {
    entry(at, What::Quiet)
}

fn entry(at: Micros, what: What) -> Line {
    let when = When::at(Time(at.0.max(0) as u64));
    Line::Entry(Entry { when, what, line: SourceLine::default() })
}

fn comment(text: &str) -> Line {
    Line::Comment(format!(" {text}"))
}
