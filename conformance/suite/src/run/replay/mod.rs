//! One run of a trace: the plug-in on a link in virtual time.

mod give;
mod numbers;

use self::numbers::Numbers;
use crate::given::case::Case;
use crate::given::lines::{line_parameters, modem_lines};
use crate::given::timeline::{Input, Timeline, Windows};
use crate::run::fault::{Fault, FaultClass};
use crate::run::outcome::Outcome;
use crate::run::permute::{Permutation, Rooms};
use crate::run::rerun::rerun;
use crate::run::seen::Seen;
use crate::run::subject::Subject;
use crate::run::watched::{Meter, Watched};
use crate::run::way::{Before, Swaps, Way};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Instance, Micros, ModemLines};
use softplug_link::{LinkFault, LinkOptions, Recorder, VirtualLine};
use std::fmt::Display;
use std::num::NonZeroUsize;
use std::rc::Rc;

/// Room in bytes where the trace names none.
const ROOM: u32 = 4_096;

/// Bytes of a job's data at a time where they are given in sips.
const SIP: Option<NonZeroUsize> = NonZeroUsize::new(7);

/// Between two cases on one link.
pub(crate) const REST: Micros = Micros::from_secs(1);

/// More than the ids of jobs in a trace.
const JOBS: u32 = 10_000;

/// In the second round the first job's id is the least one whose lower three bytes are 0.
const SECOND_ROUND: u32 = (1 << 24) - 1;

/// Runs a trace once, in one permutation. The seed changes where random cuts fall.
///
/// ```
/// use softplug_abi::{JobId, Micros};
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, Outcome, Permutation, Seen, load, replay};
/// use softplug_link::Observed;
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let Outcome { seen, fault, .. } = replay(&subject, case, &Permutation::Uncut, 0);
/// assert_eq!(fault, None);
/// // XOFF came behind the second of four bytes, XON at 2 s.
/// assert!(seen.contains(&Seen { at: Micros(2_000_000), what: Observed::Byte(b'C') }));
/// let what = Observed::Done { job: JobId(1), sent: 4 };
/// assert_eq!(seen.last(), Some(&Seen { at: Micros(2_002_084), what }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn replay<S: Subject>(
    subject: &S,
    case: &Case,
    permutation: &Permutation,
    cut_seed: u64,
) -> Outcome {
    if case.trace.is_recording() {
        return rerun(subject, case);
    }
    match start(subject, case, permutation, cut_seed) {
        Ok(run) => run.finish(),
        Err(fault) => Outcome::unstarted(fault),
    }
}

fn start<'a, S: Subject>(
    subject: &'a S,
    case: &Case,
    permutation: &Permutation,
    cut_seed: u64,
) -> Result<Run<'a, S>, Fault> {
    let manifest = subject.manifest();
    let way = Way::new(permutation, cut_seed);
    let other = way.byte.map(|byte| case.with_trace(case.trace.with_byte(byte)));
    let case = other.as_ref().unwrap_or(case);
    let mut own = conditions(case, manifest, way.windows, way.rooms)?;
    own.timeline = own.timeline.cut(&case.trace.front.id, way.cuts);
    let before = match &way.before {
        Before::Nothing | Before::Clock(_) | Before::Idle(_) => None,
        Before::Itself | Before::Again(_) => Some(own.timeline.clone()),
        Before::Case(id) => {
            let before = case.before.iter().find(|before| *before.trace.front.id == **id);
            let reason = || format!("{id} is not among the cases that may stand before it");
            let before = before.ok_or_else(|| unfit(reason()))?;
            Some(timeline(before, manifest, Windows::Early)?)
        }
    };
    Run::new(subject, own, before, way)
}

fn unfit(reason: impl Display) -> Fault {
    Fault::new(FaultClass::NotApplicable, Micros::ZERO, &reason)
}

fn timeline(case: &Case, manifest: &Manifest, windows: Windows) -> Result<Timeline, Fault> {
    Timeline::new(case, manifest, windows).map_err(unfit)
}

/// Runs a timeline that stands in no trace.
pub(crate) fn run<S: Subject>(
    subject: &S,
    conditions: Conditions,
    permutation: &Permutation,
) -> Outcome {
    let way = Way::new(permutation, 0);
    let timeline = conditions.timeline.cut("", way.cuts);
    let before = matches!(way.before, Before::Itself).then(|| timeline.clone());
    match Run::new(subject, Conditions { timeline, ..conditions }, before, way) {
        Ok(run) => run.finish(),
        Err(fault) => Outcome::unstarted(fault),
    }
}

/// What a run is made of, beside the plug-in.
#[derive(Clone)]
pub(crate) struct Conditions {
    pub(crate) timeline: Timeline,
    pub(crate) options: LinkOptions,
    /// Characters that the port holds.
    pub(crate) depth: usize,
}

/// What a case is run with.
pub(crate) fn conditions(
    case: &Case,
    manifest: &Manifest,
    windows: Windows,
    rooms: Option<Rooms>,
) -> Result<Conditions, Fault> {
    let timeline = timeline(case, manifest, windows)?;
    let settings = manifest.resolve_settings(case.config_for(manifest)).map_err(unfit)?;
    let front = &case.trace.front;
    let (known, on) = modem_lines(&front.modem);
    let (transmit, delivery) = rooms.map(Rooms::sizes).unwrap_or_default();
    let options = LinkOptions {
        line: line_parameters(&front.line),
        transmit_room: front.room.transmit.or(transmit).unwrap_or(ROOM),
        delivery_room: front.room.delivery.or(delivery).unwrap_or(ROOM),
        modem_lines: (known != ModemLines::default()).then_some((known, on)),
        settings,
    };
    Ok(Conditions { timeline, options, depth: front.line.depth as usize })
}

/// A run under way.
struct Run<'a, S: Subject> {
    subject: &'a S,
    timeline: Timeline,
    /// What is run before it.
    before: Option<Timeline>,
    way: Way,
    line: VirtualLine<Watched<S::Instance>>,
    recorder: Recorder,
    meter: Rc<Meter>,
    /// Steps that the last look saw.
    steps_seen: u64,
    swap_places: u32,
    modem: (ModemLines, ModemLines),
    modem_at_start: (ModemLines, ModemLines),
    is_open: bool,
    is_down: bool,
    /// The link's time at which the trace begins.
    offset: Micros,
    /// The host puts nothing of what is delivered away by itself.
    keeps_deliveries: bool,
    /// Added to the ids of jobs: none may come twice on an open link.
    job_base: u32,
    /// Where what this round showed begins in the recorder.
    first: usize,
    /// What a round showed that was not as the first.
    odd: Option<Vec<Seen>>,
}

type Stepped<S> = Result<(), LinkFault<<Watched<<S as Subject>::Instance> as Instance>::Fault>>;

impl<'a, S: Subject> Run<'a, S> {
    fn new(
        subject: &'a S,
        conditions: Conditions,
        before: Option<Timeline>,
        way: Way,
    ) -> Result<Self, Fault> {
        let Conditions { timeline, options, depth } = conditions;
        let meter = Rc::new(Meter::default());
        let instance = Watched::start(subject, Rc::clone(&meter))
            .map_err(|error| Fault::new(FaultClass::NotStarted, Micros::ZERO, &error))?;
        let modem = options.modem_lines.unwrap_or_default();
        let mut recorder = Recorder::default();
        recorder.drain_by_hand = way.rooms == Some(Rooms::Drips);
        recorder.source_piece = SIP.filter(|_| way.rooms == Some(Rooms::Sips));
        Ok(Self {
            subject,
            timeline,
            before,
            way,
            line: VirtualLine::new(instance, options, depth),
            recorder,
            meter,
            steps_seen: 0,
            swap_places: 0,
            modem,
            modem_at_start: modem,
            is_open: false,
            is_down: false,
            offset: Micros::ZERO,
            keeps_deliveries: false,
            job_base: 0,
            first: 0,
            odd: None,
        })
    }

    fn finish(mut self) -> Outcome {
        let run = self.run_all();
        let since = self.offset;
        let seen = self.odd.take().unwrap_or_else(|| self.seen());
        let bytes = received(&self.timeline) + seen.iter().map(Seen::bytes).sum::<u64>();
        // Fuel is counted when instances end.
        drop(self.line);
        let fuel = self.meter.fuel.get();
        let (swap_places, fault) = (self.swap_places, run.err());
        let is_delivering = self.recorder.open_delivery.is_some();
        Outcome { seen, fault, began: since, swap_places, is_delivering, fuel, bytes }
    }

    /// What this round showed.
    fn seen(&mut self) -> Vec<Seen> {
        let last = self.timeline.end;
        let since = self.offset;
        let mut numbers = Numbers::behind(self.job_base);
        let seen = self.recorder.observed.drain(self.first..);
        let mut seen: Vec<Seen> = seen
            .filter_map(|(at, observed)| Seen::of(at - since, observed))
            .filter(|seen| seen.at <= last)
            .map(|seen| match self.way.before {
                Before::Again(_) | Before::Case(_) => numbers.of_this_case(seen),
                _ => seen,
            })
            .collect();
        // What the port was given ahead is observed ahead.
        seen.sort_by_key(|seen| (seen.at, seen.channel()));
        seen
    }

    /// What is before the case, then the case.
    fn run_all(&mut self) -> Result<(), Fault> {
        let middle = middle(&self.timeline);
        match self.way.before {
            Before::Clock(clock) => self.offset = clock.start(middle),
            Before::Idle(clock) => {
                self.begin()?;
                self.wait_until(clock.start(middle))?;
                self.offset = clock.start(middle);
            }
            _ => {}
        }
        if let Some(before) = self.before.take() {
            match self.way.before {
                Before::Again(rounds) => {
                    if !self.is_same_each_time(&before, rounds)? {
                        return Ok(());
                    }
                }
                Before::Itself => {
                    self.run_once(&before)?;
                    self.start_over(before.end)?;
                }
                _ => {
                    self.run_once(&before)?;
                    self.go_on(before.end)?;
                }
            }
        }
        self.first = self.recorder.observed.len();
        self.swap_places = 0;
        let timeline = std::mem::take(&mut self.timeline);
        let run = self.run_once(&timeline);
        self.timeline = timeline;
        run
    }

    /// Runs the case so many times. A round that shows something else than the first is the last,
    /// and what the run has shown.
    fn is_same_each_time(&mut self, timeline: &Timeline, rounds: u32) -> Result<bool, Fault> {
        let mut first = None;
        for _ in 0..rounds {
            self.run_once(timeline)?;
            let seen = self.seen();
            if *first.get_or_insert_with(|| seen.clone()) != seen {
                self.odd = Some(seen);
                return Ok(false);
            }
            self.go_on(timeline.end)?;
        }
        Ok(true)
    }

    fn begin(&mut self) -> Result<(), Fault> {
        self.open(self.offset)?;
        self.transmit(self.offset)?;
        self.swap_here(self.offset)?;
        Ok(())
    }

    /// From a trace's start to its end.
    fn run_once(&mut self, timeline: &Timeline) -> Result<(), Fault> {
        if !self.is_open {
            self.begin()?;
        }
        let given = &timeline.given;
        let end = self.offset + timeline.end;
        let mut next = 0;
        loop {
            let at = given.get(next).map(|given| self.offset + given.at);
            let own = self.line.poll_timeout().map(|own| own.max(self.line.link.now()));
            let Some(now) = [at, own].into_iter().flatten().min().filter(|now| *now <= end) else {
                return Ok(());
            };
            let inputs = given[next..].iter().take_while(|given| self.offset + given.at == now);
            let (from_line, from_host): (Vec<_>, Vec<_>) =
                inputs.map(|given| &given.what).partition(|what| what.is_from_line());
            next += from_line.len() + from_host.len();
            self.instant(now, &from_line, &from_host)?;
        }
    }

    /// Nothing comes until then.
    fn wait_until(&mut self, until: Micros) -> Result<(), Fault> {
        while let Some(next) = self.line.poll_timeout().filter(|next| *next < until) {
            self.instant(next.max(self.line.link.now()), &[], &[])?;
        }
        Ok(())
    }

    /// Line input, transmit progress and timers, host requests, the transmitter.
    fn instant(
        &mut self,
        now: Micros,
        from_line: &[&Input],
        from_host: &[&Input],
    ) -> Result<(), Fault> {
        for input in from_line {
            self.hear(now, input)?;
        }
        self.advance(now)?;
        self.swap_here(now)?;
        for input in from_host {
            let Input::Host(asked) = input else { continue };
            self.ask(now, asked)?;
            self.swap_here(now)?;
        }
        self.transmit(now)?;
        if self.swap_here(now)? {
            self.transmit(now)?;
        }
        self.drip(now)
    }

    /// Puts what was delivered away byte by byte, if that is asked for.
    fn drip(&mut self, now: Micros) -> Result<(), Fault> {
        while self.drips() && !self.keeps_deliveries && self.recorder.waiting() > 0 {
            self.recorder.drain(1);
            self.transmit(now)?;
        }
        Ok(())
    }

    fn drips(&self) -> bool {
        self.way.rooms == Some(Rooms::Drips)
    }

    fn advance(&mut self, now: Micros) -> Result<(), Fault> {
        let advanced = self.line.handle_timeout(now, &mut self.recorder);
        self.judged(now, advanced)
    }

    /// Nothing leaves a port that is gone.
    fn transmit(&mut self, now: Micros) -> Result<(), Fault> {
        if self.is_down {
            return self.advance(now);
        }
        let sent = self.line.transmit(now, &mut self.recorder);
        self.judged(now, sent)
    }

    /// Swaps if the plug-in has stepped since the last place and the
    /// permutation asks for it.
    fn swap_here(&mut self, now: Micros) -> Result<bool, Fault> {
        if !self.is_open || self.meter.steps.get() == self.steps_seen {
            return Ok(false);
        }
        self.swap_places += 1;
        let is_asked = match self.way.swaps {
            Swaps::Everywhere => true,
            Swaps::At(place) => place == self.swap_places,
            Swaps::Nowhere => false,
        };
        if is_asked {
            self.swap(now)?;
        }
        self.steps_seen = self.meter.steps.get();
        Ok(is_asked)
    }

    fn swap(&mut self, now: Micros) -> Result<(), Fault> {
        let at = now - self.offset;
        let fresh = Watched::start(self.subject, Rc::clone(&self.meter))
            .map_err(|error| Fault::new(FaultClass::NotStarted, at, &error))?;
        let said = &self.subject.manifest().state;
        self.line
            .link
            .swap_as_said(now, fresh, said, &mut self.recorder)
            .map(drop)
            .map_err(|error| Fault::of_swap(at, &error))
    }

    /// Closes the link behind the trace's end, and waits until the line is
    /// quiet: the trace begins again one second later.
    fn start_over(&mut self, end: Micros) -> Result<(), Fault> {
        let mut now = self.offset + end + Micros(1);
        self.recorder.drain(u32::MAX);
        self.close(now)?;
        while let Some(next) = self.line.poll_timeout() {
            now = now.max(next);
            self.advance(now)?;
        }
        self.keeps_deliveries = false;
        self.recorder.drain_by_hand = self.drips();
        self.offset = now + REST;
        if self.modem == self.modem_at_start {
            return Ok(());
        }
        // A closed link keeps the lines for its next opening and tells nobody.
        self.modem = self.modem_at_start;
        let (known, on) = self.modem;
        let set = self.line.link.modem_lines(now, known, on, &mut self.recorder);
        self.judged(now, set)
    }

    /// Lets the link come to rest behind a trace: the next one begins a second later.
    fn go_on(&mut self, end: Micros) -> Result<(), Fault> {
        let now = self.offset + end + Micros(1);
        self.keeps_deliveries = false;
        self.recorder.drain_by_hand = self.drips();
        self.recorder.drain(u32::MAX);
        self.instant(now, &[], &[])?;
        self.offset = now + REST;
        self.wait_until(self.offset)?;
        self.job_base = self.job_base.saturating_add(JOBS).max(SECOND_ROUND);
        self.first = self.recorder.observed.len();
        Ok(())
    }

    fn judged(&self, now: Micros, stepped: Stepped<S>) -> Result<(), Fault> {
        stepped.map_err(|fault| Fault::of_link(now - self.offset, &fault))
    }
}

/// When half of what is given has been given.
fn middle(timeline: &Timeline) -> Micros {
    timeline.given.get(timeline.given.len() / 2).map_or(Micros::ZERO, |given| given.at)
}

fn received(timeline: &Timeline) -> u64 {
    let bytes = |what: &Input| match what {
        Input::Bytes(bytes) => bytes.len() as u64,
        Input::Character(_) | Input::Damaged { byte: Some(_), .. } => 1,
        _ => 0,
    };
    timeline.given.iter().map(|given| bytes(&given.what)).sum()
}
