//! One run of a trace: the plug-in on a link in virtual time.

use super::effect::Effect;
use super::fault::{Fault, FaultClass};
use super::outcome::{Outcome, Seen};
use super::permute::Permutation;
use super::rerun::rerun;
use super::subject::{Meter, Subject, Watched};
use crate::given::lines::{line_parameters, modem_lines};
use crate::given::load::Case;
use crate::given::timeline::{Asked, Input, Timeline, Windows};
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Instance, Micros, ModemLines};
use softplug_link::{LinkFault, LinkOptions, Recorder, VirtualLine};
use softplug_trace::Drain;
use std::rc::Rc;

/// Room in bytes where the trace names none.
const ROOM: u32 = 4_096;

/// Runs a trace once, in one permutation. The seed changes where random cuts fall.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Effect, FromFn, Outcome, Permutation, Seen, load, replay};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let Outcome { seen, fault, .. } = replay(&subject, case, Permutation::Uncut, 0);
/// assert_eq!(fault, None);
/// // XOFF came behind the second of four bytes, XON at 2 s.
/// assert!(seen.contains(&Seen { at: Micros(2_000_000), effect: Effect::Byte(b'C') }));
/// let done = Effect::Done { id: 1, sent: Some(4) };
/// assert_eq!(seen.last(), Some(&Seen { at: Micros(2_002_084), effect: done }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn replay<S: Subject>(
    subject: &S,
    case: &Case,
    permutation: Permutation,
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
    permutation: Permutation,
    cut_seed: u64,
) -> Result<Run<'a, S>, Fault> {
    let unfit = |reason: String| Fault::new(FaultClass::NotApplicable, Micros::ZERO, &reason);
    let manifest = subject.manifest();
    let windows = match permutation {
        Permutation::Late(None) => Windows::Late,
        Permutation::Late(Some(number)) => Windows::LateOnly(number),
        _ => Windows::Early,
    };
    let timeline =
        Timeline::new(case, manifest, windows).map_err(|error| unfit(error.to_string()))?;
    let timeline = timeline.cut(&case.trace.front.id, permutation.cuts(cut_seed));

    let front = &case.trace.front;
    let config = case.config_for(manifest);
    let settings = manifest.resolve_settings(config).map_err(|error| unfit(error.to_string()))?;
    let options = options(case, settings);
    let conditions = Conditions { timeline, options, depth: front.line.depth as usize };
    Run::new(subject, conditions, permutation)
}

/// Runs a timeline that stands in no trace.
pub(crate) fn run<S: Subject>(
    subject: &S,
    conditions: Conditions,
    permutation: Permutation,
) -> Outcome {
    let timeline = conditions.timeline.cut("", permutation.cuts(0));
    match Run::new(subject, Conditions { timeline, ..conditions }, permutation) {
        Ok(run) => run.finish(),
        Err(fault) => Outcome::unstarted(fault),
    }
}

/// What a run is made of, beside the plug-in.
pub(crate) struct Conditions {
    pub(crate) timeline: Timeline,
    pub(crate) options: LinkOptions,
    /// Characters that the port holds.
    pub(crate) depth: usize,
}

fn options(case: &Case, settings: SettingValues) -> LinkOptions {
    let front = &case.trace.front;
    let (known, on) = modem_lines(&front.modem);
    LinkOptions {
        line: line_parameters(&front.line),
        transmit_room: front.room.transmit.unwrap_or(ROOM),
        delivery_room: front.room.delivery.unwrap_or(ROOM),
        modem_lines: (known != ModemLines::default()).then_some((known, on)),
        settings,
    }
}

/// A run under way.
struct Run<'a, S: Subject> {
    subject: &'a S,
    timeline: Timeline,
    permutation: Permutation,
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
}

type Stepped<S> = Result<(), LinkFault<<Watched<<S as Subject>::Instance> as Instance>::Fault>>;

impl<'a, S: Subject> Run<'a, S> {
    fn new(
        subject: &'a S,
        conditions: Conditions,
        permutation: Permutation,
    ) -> Result<Self, Fault> {
        let Conditions { timeline, options, depth } = conditions;
        let meter = Rc::new(Meter::default());
        let instance = Watched::start(subject, Rc::clone(&meter))
            .map_err(|error| Fault::new(FaultClass::NotStarted, Micros::ZERO, &error))?;
        let modem = options.modem_lines.unwrap_or_default();
        Ok(Self {
            subject,
            timeline,
            permutation,
            line: VirtualLine::new(instance, options, depth),
            recorder: Recorder::default(),
            meter,
            steps_seen: 0,
            swap_places: 0,
            modem,
            modem_at_start: modem,
            is_open: false,
            is_down: false,
            offset: Micros::ZERO,
        })
    }

    fn finish(mut self) -> Outcome {
        let mut first = 0;
        let mut run = self.run_once();
        if run.is_ok() && self.permutation == Permutation::Twice {
            run = self.start_over();
            first = self.recorder.observed.len();
            run = run.and_then(|()| self.run_once());
        }
        let last = self.timeline.end;
        let since = self.offset;
        let seen = self.recorder.observed.drain(first..);
        let mut seen: Vec<Seen> = seen
            .filter_map(|(at, observed)| {
                Some(Seen { at: at - since, effect: Effect::of(observed)? })
            })
            .filter(|seen| seen.at <= last)
            .collect();
        // What the port was given ahead is observed ahead.
        seen.sort_by_key(|seen| (seen.at, seen.effect.channel()));
        let bytes =
            received(&self.timeline) + seen.iter().map(|seen| moved(&seen.effect)).sum::<u64>();
        // Fuel is counted when instances end.
        drop(self.line);
        let fuel = self.meter.fuel.get();
        let (swap_places, fault) = (self.swap_places, run.err());
        Outcome { seen, fault, began: since, swap_places, fuel, bytes }
    }

    /// From the trace's start to its end.
    fn run_once(&mut self) -> Result<(), Fault> {
        self.open(self.offset)?;
        self.transmit(self.offset)?;
        self.swap_here(self.offset)?;
        let given = std::mem::take(&mut self.timeline.given);
        let end = self.offset + self.timeline.end;
        let mut next = 0;
        loop {
            let at = given.get(next).map(|given| self.offset + given.at);
            let own = self.line.next().map(|own| own.max(self.line.link.now()));
            let Some(now) = [at, own].into_iter().flatten().min().filter(|now| *now <= end) else {
                break;
            };
            let inputs = given[next..].iter().take_while(|given| self.offset + given.at == now);
            let (from_line, from_host): (Vec<_>, Vec<_>) =
                inputs.map(|given| &given.what).partition(|what| what.is_from_line());
            next += from_line.len() + from_host.len();
            self.instant(now, &from_line, &from_host)?;
        }
        self.timeline.given = given;
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
        Ok(())
    }

    fn hear(&mut self, now: Micros, input: &Input) -> Result<(), Fault> {
        let Self { line: VirtualLine { link, .. }, recorder, .. } = self;
        let stepped = match input {
            Input::Bytes(bytes) => link.received(now, bytes, recorder),
            Input::Character(byte) => link.received(now, &[*byte], recorder),
            Input::Damaged { kind, byte, span } => {
                link.line_error(now, *kind, *byte, *span, recorder)
            }
            Input::Modem(named, on) => {
                let (known, before) = self.modem;
                let kept = ModemLines(before.0 & !named.0);
                self.modem = (known.union(*named), kept.union(*on));
                link.modem_lines(now, self.modem.0, self.modem.1, recorder)
            }
            Input::Down(reason) => {
                self.is_down = true;
                link.link_down(now, *reason, recorder)
            }
            Input::Up => {
                self.is_down = false;
                link.link_up(now, recorder)
            }
            Input::Host(_) => Ok(()),
        };
        self.judged(now, stepped)
    }

    fn ask(&mut self, now: Micros, asked: &Asked) -> Result<(), Fault> {
        let Self { line: VirtualLine { link, .. }, recorder, .. } = self;
        let stepped = match asked {
            Asked::Job(job, data) => {
                recorder.add_source(job.id, data.clone());
                link.begin_job(now, job.clone(), recorder)
            }
            Asked::Pause(job) => link.pause(now, *job, recorder),
            Asked::Resume(job) => link.resume(now, *job, recorder),
            Asked::Abort(job) => link.abort(now, *job, recorder),
            Asked::ForceResume => link.force_resume(now, recorder),
            Asked::Room(bytes) => {
                recorder.drain(*bytes);
                link.run(now, recorder)
            }
            Asked::Drain(Drain::Off) => {
                recorder.drain_by_hand = true;
                Ok(())
            }
            Asked::Drain(Drain::Auto) => {
                recorder.drain_by_hand = false;
                recorder.drain(u32::MAX);
                link.run(now, recorder)
            }
            Asked::Answer(request, answer) => {
                let answer = answer.as_ref().map(Vec::as_slice).map_err(|failure| *failure);
                link.answer(now, *request, answer, recorder)
            }
            Asked::Swap => return self.swap(now),
            Asked::Close => return self.close(now),
            Asked::Open => return self.open(now),
        };
        self.judged(now, stepped)
    }

    fn open(&mut self, now: Micros) -> Result<(), Fault> {
        self.is_open = true;
        self.is_down = false;
        let opened = self.line.link.open(now, &mut self.recorder);
        self.judged(now, opened)
    }

    fn close(&mut self, now: Micros) -> Result<(), Fault> {
        self.is_open = false;
        let closed = self.line.link.close(now, &mut self.recorder);
        self.judged(now, closed)
    }

    fn advance(&mut self, now: Micros) -> Result<(), Fault> {
        let advanced = self.line.advance(now, &mut self.recorder);
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
        let is_asked = match self.permutation {
            Permutation::SwapAll => true,
            Permutation::SwapAfter(place) => place == self.swap_places,
            _ => false,
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
        self.line
            .link
            .swap(now, fresh, &mut self.recorder)
            .map(drop)
            .map_err(|error| Fault::of_swap(at, &error))
    }

    /// Closes the link behind the trace's end, and waits until the line is
    /// quiet: the trace begins again one second later.
    fn start_over(&mut self) -> Result<(), Fault> {
        let mut now = self.timeline.end + Micros(1);
        self.recorder.drain(u32::MAX);
        self.close(now)?;
        while let Some(next) = self.line.next() {
            now = now.max(next);
            self.advance(now)?;
        }
        self.recorder.drain_by_hand = false;
        self.offset = now + Micros::from_secs(1);
        if self.modem == self.modem_at_start {
            return Ok(());
        }
        // A closed link keeps the lines for its next opening and tells nobody.
        self.modem = self.modem_at_start;
        let (known, on) = self.modem;
        let set = self.line.link.modem_lines(now, known, on, &mut self.recorder);
        self.judged(now, set)
    }

    fn judged(&self, now: Micros, stepped: Stepped<S>) -> Result<(), Fault> {
        stepped.map_err(|fault| Fault::of_link(now - self.offset, &fault))
    }
}

fn received(timeline: &Timeline) -> u64 {
    let bytes = |what: &Input| match what {
        Input::Bytes(bytes) => bytes.len() as u64,
        Input::Character(_) | Input::Damaged { byte: Some(_), .. } => 1,
        _ => 0,
    };
    timeline.given.iter().map(|given| bytes(&given.what)).sum()
}

fn moved(effect: &Effect) -> u64 {
    match effect {
        Effect::Byte(_) => 1,
        Effect::Deliver(delivered) => delivered.bytes.len() as u64,
        _ => 0,
    }
}
