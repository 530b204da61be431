//! A run of a trace taken apart, to be walked through forward and back: what the
//! plug-in was given and did, one moment after the other.

use super::phrase::{Other, Phrase};
use crate::given::case::Case;
use crate::given::lines::line_parameters;
use crate::given::timeline::micros;
use crate::judge::run::{Judge, Start};
use crate::judge::verdict::Failure;
use crate::run::overhear::{Call, Most, Overheard};
use crate::run::permute::Permutation;
use crate::run::replay::replay;
use crate::run::seen::{Channel, Seen};
use crate::run::subject::Subject;
use serde::Serialize;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, Actions, Event, Micros};
use softplug_link::Observed;
use softplug_trace::What;

/// What of a run is kept: whoever looks at more than this looks for something else.
const MOST: Most = Most { calls: 20_000, bytes: 8 << 20 };
/// Bytes that stand in one moment of the wire.
const BYTES: usize = 64;

/// A run, and what it came to.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{
///     FromFn, Happening, Moment, Other, Permutation, Phrase, Stepper, load,
/// };
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let stepper = Stepper::new(&subject, case, &Permutation::Uncut);
/// assert_eq!((stepper.failure, stepper.end_us), (None, 5_000_000));
/// // XOFF comes: line 14 of the trace, and the plug-in holds its queue.
/// let held = stepper.moments.iter().find(|moment| moment.after.is_held);
/// let Some(Moment { line: 14, what: Happening::Step(step), .. }) = held else { panic!("{held:?}") };
/// let Phrase { other, bytes, .. } = &step.given;
/// assert_eq!((*other, &bytes[..]), (Other::Line, &[0x13][..]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Stepper {
    /// In the order of time.
    pub moments: Vec<Moment>,
    /// Why the run did not pass; none: it passed.
    pub failure: Option<Failure>,
    /// The moment at which it did something else than it must.
    pub differs_at: Option<usize>,
    /// The end of the trace, in µs.
    pub end_us: i64,
    /// There was more than is kept.
    pub is_cut: bool,
}

/// One moment of a run.
///
/// The example of [`Stepper`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Moment {
    /// In µs of the trace's time; negative in the first of two runs.
    pub at_us: i64,
    /// The line of the trace that was reached.
    pub line: u32,
    /// What happened.
    pub what: Happening,
    /// How the plug-in stands after it.
    pub after: Standing,
}

/// What happened.
///
/// The example of [`Stepper`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Happening {
    /// The plug-in was given an event.
    Step(Step),
    /// The plug-in's bytes began to leave, back to back.
    Wire(Vec<u8>),
    /// A break began to leave, of so many µs.
    Break(u32),
}

/// A plug-in's answer to an event.
///
/// The example of [`Stepper`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Step {
    /// The instance, from 1: a swap makes a new one.
    pub instance: u32,
    /// The event's name.
    pub event: &'static str,
    /// What it was given.
    pub given: Phrase,
    /// What it did.
    pub actions: Vec<Phrase>,
    /// Units of fuel; 0 where nobody counts.
    pub fuel: u64,
    /// Why it did not take the event.
    pub fault: Option<String>,
    /// Functions that were running when it trapped, the innermost first.
    pub frames: Vec<String>,
    /// Panic text and place that it left.
    pub last_words: Option<String>,
}

/// How a plug-in stands.
///
/// The example of [`Timer`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Standing {
    /// The name that it gave its state.
    pub state: Option<String>,
    /// Timers that are set.
    pub timers: Vec<Timer>,
    /// Its transmit queue is held.
    pub is_held: bool,
    /// Units of fuel so far.
    pub fuel: u64,
}

/// A timer that is set.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, Permutation, Standing, Stepper, Timer, load};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::R3964;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/r3964/r3964.conflict.abort.spt"])?[0];
/// let stepper = Stepper::new(&subject, case, &Permutation::Uncut);
/// // STX has left at 1,146 µs, and its answer may take 2 s.
/// let moment = stepper.moments.iter().rfind(|moment| moment.at_us < 2_000).expect("it began");
/// let Standing { timers, is_held, .. } = &moment.after;
/// assert_eq!((&timers[..], *is_held), (&[Timer { id: 0, until_us: 2_001_146 }][..], false));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Timer {
    /// 0 to 15.
    pub id: u8,
    /// In µs of the trace's time.
    pub until_us: i64,
}

impl Stepper {
    /// Runs a trace in one permutation and keeps what happened.
    pub fn new<S: Subject + Sync>(subject: &S, case: &Case, permutation: &Permutation) -> Self {
        let overheard = Overheard::new(subject, MOST);
        let outcome = replay(&overheard, case, permutation, 0);
        let calls = overheard.take();
        let failure = Start::new(subject as &dyn Judge, case).assess(permutation, &outcome);
        let manifest = subject.manifest();
        let mut follower =
            Follower { manifest, since: outcome.began, standing: Standing::default() };
        let mut moments: Vec<Moment> =
            calls.list.iter().map(|call| follower.moment(call)).collect();
        let last = moments.last().map(|moment| moment.at_us);
        let is_kept = |moment: &Moment| !calls.is_cut || Some(moment.at_us) <= last;
        let wire: Vec<_> =
            wire(case, &outcome.seen, &moments).into_iter().filter(is_kept).collect();
        insert(&mut moments, wire);
        number_lines(case, &mut moments);
        let differs_at = failure.as_ref().and_then(|failure| place_of(failure, &moments));
        let end_us = micros(case.trace.end()).0;
        Self { moments, failure, differs_at, end_us, is_cut: calls.is_cut }
    }
}

/// The moment at which a run first did something else: of those of that time the one that is
/// about the same.
fn place_of(failure: &Failure, moments: &[Moment]) -> Option<usize> {
    let Some(divergence) = &failure.divergence else {
        let is_faulty = |moment: &Moment| match &moment.what {
            Happening::Step(step) => step.fault.is_some(),
            Happening::Wire(_) | Happening::Break(_) => false,
        };
        let at = failure.fault.as_ref()?.at_us;
        return moments.iter().position(is_faulty).or_else(|| first_from(moments, at));
    };
    let at = divergence.at_us;
    let is_wire = |moment: &Moment| !matches!(moment.what, Happening::Step(_));
    let does = |moment: &Moment| match &moment.what {
        Happening::Step(step) => step.actions.iter().any(|action| action.other == Other::Host),
        Happening::Wire(_) | Happening::Break(_) => false,
    };
    let found = if divergence.observed.text.starts_with("> ") {
        // It may be in the middle of a run of bytes.
        moments.iter().rposition(|moment| is_wire(moment) && moment.at_us <= at)
    } else {
        moments.iter().position(|moment| does(moment) && moment.at_us == at)
    };
    found.or_else(|| first_from(moments, at))
}

/// The first moment that is not before this time, or the last one.
fn first_from(moments: &[Moment], at: i64) -> Option<usize> {
    let found = moments.iter().position(|moment| moment.at_us >= at);
    found.or(moments.len().checked_sub(1))
}

/// Keeps what a plug-in's answers say of how it stands.
struct Follower<'a> {
    manifest: &'a Manifest,
    /// Where the trace's clock begins on the link's.
    since: Micros,
    standing: Standing,
}

impl Follower<'_> {
    fn moment(&mut self, call: &Call) -> Moment {
        let event = Event::decode(call.event, &call.payload);
        if let Ok(event) = &event {
            self.given(event);
        }
        let given = match &event {
            Ok(event) => Phrase::of_event(event, self.manifest),
            Err(_) => {
                Phrase { other: Other::Link, text: call.event.name().to_owned(), bytes: Vec::new() }
            }
        };
        let mut actions = Vec::new();
        for action in Actions::new(&call.actions).map_while(Result::ok) {
            self.done(&action);
            actions.push(Phrase::of_action(&action, self.manifest, self.since));
        }
        self.standing.fuel = self.standing.fuel.saturating_add(call.fuel);
        let step = Step {
            instance: call.instance,
            event: call.event.name(),
            given,
            actions,
            fuel: call.fuel,
            fault: call.fault.clone(),
            frames: call.frames.clone(),
            last_words: call.last_words.clone(),
        };
        let at_us = (call.now - self.since).0;
        Moment { at_us, line: 0, what: Happening::Step(step), after: self.standing.clone() }
    }

    fn given(&mut self, event: &Event<'_>) {
        let timers = &mut self.standing.timers;
        match event {
            Event::Timer { id, .. } => timers.retain(|timer| timer.id != *id),
            Event::Open { resumed, .. } => {
                timers.clear();
                // A hold is the link's, and stays over a swap.
                self.standing.is_held &= *resumed;
            }
            Event::Close => {
                timers.clear();
                self.standing.is_held = false;
            }
            Event::Settings { .. }
            | Event::Received(..)
            | Event::LineError { .. }
            | Event::ModemLines { .. }
            | Event::LinkDown(..)
            | Event::LinkUp
            | Event::Mark { .. }
            | Event::TransmitRoom { .. }
            | Event::Discarded { .. }
            | Event::DeliveryRoom { .. }
            | Event::JobBegin { .. }
            | Event::JobData { .. }
            | Event::JobEnd { .. }
            | Event::Pause { .. }
            | Event::Resume { .. }
            | Event::Abort { .. }
            | Event::ForceResume
            | Event::Answer { .. }
            | Event::Save
            | Event::Restore { .. }
            | Event::Continue => {}
        }
    }

    fn done(&mut self, action: &Action<'_>) {
        let Standing { state, timers, is_held, .. } = &mut self.standing;
        match action {
            Action::SetTimer { id, deadline } => {
                timers.retain(|timer| timer.id != *id);
                timers.push(Timer { id: *id, until_us: (*deadline - self.since).0 });
                timers.sort_by_key(|timer| timer.until_us);
            }
            Action::CancelTimer { id } => timers.retain(|timer| timer.id != *id),
            Action::Hold => *is_held = true,
            Action::Release => *is_held = false,
            Action::State { name } => *state = Some(name.escape_debug().to_string()),
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Discard
            | Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::DeliveryBegin { .. }
            | Action::Deliver { .. }
            | Action::DeliveryName { .. }
            | Action::DeliveryEnd { .. }
            | Action::JobDone { .. }
            | Action::JobFailed { .. }
            | Action::CheckResult { .. }
            | Action::Request { .. }
            | Action::Withdraw { .. }
            | Action::Note { .. }
            | Action::Saved { .. } => {}
        }
    }
}

/// What left on the wire. A run of bytes is cut where the machine said something.
fn wire(case: &Case, seen: &[Seen], moments: &[Moment]) -> Vec<Moment> {
    let is_heard = |moment: &&Moment| matches!(&moment.what, Happening::Step(step) if step.given.other == Other::Line);
    let heard: Vec<i64> = moments.iter().filter(is_heard).map(|moment| moment.at_us).collect();
    let (mut next, mut last) = (0, 0);
    let cuts = |from: i64, to: i64| heard.iter().any(|at| from < *at && *at <= to);
    let line = line_parameters(&case.trace.front.line);
    let mut runs: Vec<(i64, Happening)> = Vec::new();
    for seen in seen.iter().filter(|seen| seen.channel() == Some(Channel::Wire)) {
        let at = seen.at.0;
        match &seen.what {
            Observed::Byte(byte) => match runs.last_mut() {
                Some((_, Happening::Wire(bytes)))
                    if at <= next + 1 && bytes.len() < BYTES && !cuts(last, at) =>
                {
                    bytes.push(*byte);
                }
                _ => runs.push((at, Happening::Wire(vec![*byte]))),
            },
            Observed::Break(micros) => runs.push((at, Happening::Break(*micros))),
            _ => {}
        }
        (last, next) = (at, at + line.characters(1).0);
    }
    let moment = |(at_us, what)| Moment { at_us, line: 0, what, after: Standing::default() };
    runs.into_iter().map(moment).collect()
}

/// Puts what left behind the calls of the same time, which caused it.
fn insert(moments: &mut Vec<Moment>, wire: Vec<Moment>) {
    moments.extend(wire);
    let is_wire = |moment: &Moment| !matches!(moment.what, Happening::Step(_));
    moments.sort_by_key(|moment| (moment.at_us, is_wire(moment)));
    let mut standing = Standing::default();
    for moment in moments {
        if is_wire(moment) {
            moment.after = standing.clone();
        } else {
            standing = moment.after.clone();
        }
    }
}

/// Each moment has reached the last line of the trace that is due by then.
fn number_lines(case: &Case, moments: &mut [Moment]) {
    let entries = case.trace.entries().filter(|entry| entry.what != What::Quiet);
    let mut lines: Vec<_> =
        entries.map(|entry| (micros(entry.when.from).0, entry.line.0)).collect();
    lines.sort_unstable();
    for moment in moments {
        let reached = lines.partition_point(|(at, _)| *at <= moment.at_us);
        moment.line = reached.checked_sub(1).map_or(0, |last| lines[last].1);
    }
}
