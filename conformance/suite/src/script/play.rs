//! A plug-in, a simulated machine and a host on one line, as a scenario drives them.

use super::failure::{Outcome, diverged, not_applicable};
use super::setup::Setup;
use crate::run::erased::{Anything, Boxed, Erased};
use crate::run::fault::WatchedFault;
use crate::run::fault::{Fault, FaultClass};
use crate::run::seen::Seen;
use crate::run::subject::{Fuel, SubjectError};
use crate::run::watched::{Meter, Watched};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, JobId, Micros, RequestId};
use softplug_link::{Delivery, Job, LinkFault, Observed, Recorder};
use softplug_machines::Partner;
use softplug_trial::ClosedLoop;
use std::fmt::Debug;
use std::rc::Rc;

const DAY: Micros = Micros::from_secs(86_400);

/// Events of one scenario that a plug-in may be given: one that keeps setting timers
/// would else be waited for without end.
const MOST_EVENTS: u64 = 200_000;

/// The plug-in's end of the line, the machine's, and the host.
pub(super) struct Play<'a, P> {
    subject: Anything<'a>,
    pub(super) line: ClosedLoop<Watched<Erased<'a>>, P>,
    pub(super) host: Recorder,
    meter: Rc<Meter>,
    jobs: u32,
}

/// How a job ended: with so many bytes sent, or why not and with which status.
pub(super) type End = Result<u64, (Failure, u16)>;

impl<'a, P: Partner> Play<'a, P> {
    pub(super) fn new(subject: Anything<'a>, setup: &Setup, partner: P) -> Outcome<Self> {
        let options = setup.options(subject.0.manifest())?;
        let meter = Rc::default();
        let instance = instance(subject, &meter)?;
        let mut line = ClosedLoop::new(instance, options, setup.depth, partner);
        line.reaction = setup.reaction;
        Ok(Self { subject, line, host: Recorder::default(), meter, jobs: 0 })
    }

    pub(super) fn open(&mut self) -> Outcome {
        let opened = self.line.line.link.open(Micros::ZERO, &mut self.host);
        self.judged(opened)?;
        self.settle()
    }

    /// What was seen, what it cost, and the bytes that left and were delivered.
    pub(super) fn finish(self) -> (Vec<Seen>, Fuel, u64) {
        let Self { line, host, meter, .. } = self;
        // The instance counts its fuel when it goes.
        drop(line);
        let observed = host.observed.into_iter();
        let mut seen: Vec<Seen> = observed.filter_map(|(at, what)| Seen::of(at, what)).collect();
        seen.sort_by_key(|seen| (seen.at, seen.channel()));
        let bytes = seen.iter().map(Seen::bytes).sum();
        (seen, meter.fuel.get(), bytes)
    }

    pub(super) fn manifest(&self) -> &'a Manifest {
        self.subject.0.manifest()
    }

    pub(super) fn now(&self) -> Micros {
        self.line.now()
    }

    /// The machine.
    pub(super) fn partner(&mut self) -> &mut P {
        &mut self.line.partner
    }

    /// Begins a job of the kind `send`; its id.
    pub(super) fn send(&mut self, data: &[u8]) -> Outcome<u32> {
        self.job("send", &[], data)
    }

    /// Begins a job; its id.
    pub(super) fn job(&mut self, kind: &str, fields: &[(&str, &str)], data: &[u8]) -> Outcome<u32> {
        let manifest = self.manifest();
        let Some(place) = manifest.jobs.iter().position(|known| known.name == kind) else {
            return Err(not_applicable(&format!("there is no job of the kind \"{kind}\"")));
        };
        let fields = manifest.jobs[place]
            .records(fields.iter().copied())
            .map_err(|error| not_applicable(&error))?;
        self.jobs += 1;
        let id = self.jobs;
        self.host.add_source(JobId(id), data.to_vec());
        let size = Some(data.len() as u64);
        let check = manifest.needs.check_pass;
        let job = Job { id: JobId(id), kind: place as u16, size, fields, check };
        let begun = self.line.line.link.begin_job(self.line.now(), job, &mut self.host);
        self.judged(begun)?;
        self.settle()?;
        Ok(id)
    }

    /// The host pauses a job.
    pub(super) fn pause(&mut self, job: u32) -> Outcome {
        let now = self.line.now();
        let paused = self.line.line.link.pause(now, JobId(job), &mut self.host);
        self.judged(paused)?;
        self.settle()
    }

    /// The host gives a job up.
    pub(super) fn abort(&mut self, job: u32) -> Outcome {
        let now = self.line.now();
        let aborted = self.line.line.link.abort(now, JobId(job), &mut self.host);
        self.judged(aborted)?;
        self.settle()
    }

    /// Answers a request of the plug-in.
    pub(super) fn answer(&mut self, request: u32, answer: Result<&[u8], Failure>) -> Outcome {
        let now = self.line.now();
        let answered = self.line.line.link.answer(now, RequestId(request), answer, &mut self.host);
        self.judged(answered)?;
        self.settle()
    }

    /// Goes on to the next instant at which something happens; `false` if nothing
    /// happens up to `until`.
    pub(super) fn step(&mut self, until: Micros) -> Outcome<bool> {
        if self.meter.steps.get() > MOST_EVENTS {
            let message = format!("it does not come to rest within {MOST_EVENTS} events");
            return Err(diverged(self.now(), message, "", ""));
        }
        let stepped = self.line.step(until, &mut self.host);
        self.judged(stepped)
    }

    /// Lets time come to `until`.
    pub(super) fn run_until(&mut self, until: Micros) -> Outcome {
        while self.step(until)? {}
        let waited = self.line.wait_until(until, &mut self.host);
        self.judged(waited)
    }

    /// Lets time pass.
    pub(super) fn run(&mut self, span: Micros) -> Outcome {
        self.run_until(self.now() + span)
    }

    /// Lets the plug-in go on after the host did something by hand.
    pub(super) fn settle(&mut self) -> Outcome {
        let settled = self.line.settle(&mut self.host);
        self.judged(settled)
    }

    /// Runs until the job has ended; it must within `span`.
    pub(super) fn end_of(&mut self, job: u32, span: Micros) -> Outcome<End> {
        let until = self.now() + span;
        // A plug-in may say much and never end: what was looked at is not looked at again.
        let mut looked_at = 0;
        loop {
            if let Some(end) = self.ended_behind(job, looked_at) {
                return Ok(end);
            }
            looked_at = self.host.observed.len();
            if !self.step(until)? {
                return Err(diverged(
                    self.now(),
                    format!("job {job} does not end within {span} s"),
                    "done or failed",
                    "neither",
                ));
            }
        }
    }

    /// As [`job`](Self::job), but nothing of its data is there yet.
    pub(super) fn late_job(
        &mut self,
        kind: &str,
        fields: &[(&str, &str)],
        data: &[u8],
    ) -> Outcome<u32> {
        self.host.source_has = Some(0);
        self.job(kind, fields, data)
    }

    /// Lets data of a [late job](Self::late_job) come, so many bytes each so often, until the job has ended; a
    /// check pass reads it once more.
    pub(super) fn end_of_late(&mut self, job: u32, piece: usize, every: Micros) -> Outcome<End> {
        let until = self.now() + DAY;
        while self.now() < until {
            self.run(every)?;
            if let Some(end) = self.ended(job) {
                self.host.source_has = None;
                return Ok(end);
            }
            self.host.source_has = self.host.source_has.map(|has| has + piece);
            self.settle()?;
        }
        Err(diverged(self.now(), format!("job {job} does not end within a day"), "an end", "none"))
    }

    /// How the job ended, if it has.
    pub(super) fn ended(&self, wanted: u32) -> Option<End> {
        self.ended_behind(wanted, 0)
    }

    fn ended_behind(&self, wanted: u32, looked_at: usize) -> Option<End> {
        self.host.observed.iter().skip(looked_at).rev().find_map(|(_, observed)| match observed {
            Observed::Done { job, sent } if *job == JobId(wanted) => Some(Ok(*sent)),
            Observed::Failed { job, failure, status, .. } if *job == JobId(wanted) => {
                Some(Err((*failure, *status)))
            }
            Observed::Checked { job, failure: Some(failure), status, .. }
                if *job == JobId(wanted) =>
            {
                Some(Err((*failure, *status)))
            }
            _ => None,
        })
    }

    /// Deliveries that have ended, each with its end's time.
    pub(super) fn deliveries(&self) -> Vec<(Micros, Delivery)> {
        let ended = self.host.observed.iter().filter_map(|(at, observed)| match observed {
            Observed::Delivery(delivery) => Some((*at, delivery.clone())),
            _ => None,
        });
        ended.collect()
    }

    /// What was seen so far is no part of the log, and what was done does not count.
    pub(super) fn forget(&mut self) {
        self.host.observed.clear();
        self.meter.steps.set(0);
    }

    /// The plug-in is saved, and a fresh instance takes over.
    pub(super) fn swap(&mut self) -> Outcome {
        let now = self.now();
        let fresh = instance(self.subject, &self.meter)?;
        let said = &self.manifest().state;
        let swapped = self.line.line.link.swap_as_said(now, fresh, said, &mut self.host);
        swapped.map_err(|error| Fault::of_swap(now, &error))?;
        self.settle()
    }

    /// A thing that must be as the scenario says.
    #[expect(clippy::needless_pass_by_value, reason = "what is compared is often made in place")]
    pub(super) fn equal<T: PartialEq + Debug>(
        &self,
        what: &str,
        expected: T,
        observed: T,
    ) -> Outcome {
        if expected == observed {
            return Ok(());
        }
        Err(diverged(self.now(), what, short(&expected), short(&observed)))
    }

    /// A thing that must hold.
    pub(super) fn demand(&self, what: &str, holds: bool, observed: impl Debug) -> Outcome {
        if holds { Ok(()) } else { Err(diverged(self.now(), what, "", short(&observed))) }
    }

    /// Bytes that must be the same: the failure shows where they begin to differ.
    pub(super) fn same_bytes(&self, what: &str, expected: &[u8], observed: &[u8]) -> Outcome {
        if expected == observed {
            return Ok(());
        }
        let both = expected.iter().zip(observed);
        let place = both.take_while(|(expected, observed)| expected == observed).count();
        let around = |bytes: &[u8]| {
            let from = place.saturating_sub(8);
            let shown = &bytes[from..bytes.len().min(place + 8)];
            format!("{} bytes, from byte {from} \"{}\"", bytes.len(), shown.escape_ascii())
        };
        Err(diverged(self.now(), what, around(expected), around(observed)))
    }

    fn judged<T>(&self, stepped: Result<T, LinkFault<WatchedFault<Boxed>>>) -> Outcome<T> {
        stepped.map_err(|fault| Fault::of_link(self.line.now(), &fault).into())
    }
}

fn instance<'a>(subject: Anything<'a>, meter: &Rc<Meter>) -> Outcome<Watched<Erased<'a>>> {
    let not_started =
        |error: SubjectError| Fault::new(FaultClass::NotStarted, Micros::ZERO, &error);
    Ok(Watched::start(&subject, Rc::clone(meter)).map_err(not_started)?)
}

/// What fits on a line.
fn short(value: &impl Debug) -> String {
    const MOST: usize = 300;
    let text = format!("{value:?}");
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
