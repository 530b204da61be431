//! One session: the plug-in on a line in virtual time, the model beside it.

use crate::model::{Broken, Conditions, Effect, Given, HostRequest, LineInput, Model};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, Instance, JobId, Micros, ModemLines, RequestId};
use softplug_link::{
    Job, LinkFault, LinkHost, LinkOptions, Observed, Recorder, Supply, VirtualLine, WireHost,
};
use std::collections::VecDeque;

/// One step of a session.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Step {
    /// Something is given.
    Given(Given),
    /// The plug-in is swapped for a fresh instance of itself; no model sees that.
    Swap,
}

/// What came of a session.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ran {
    /// What was given, and when.
    pub steps: Vec<(Micros, Step)>,
    /// When the session ended.
    pub end: Micros,
    /// What was wrong; `None`: nothing.
    pub finding: Option<Finding>,
    /// All that the plug-in did of which the model was told.
    pub observed: Vec<(Micros, Observed)>,
}

/// Why a session failed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Finding {
    /// A rule was broken.
    Broken {
        /// When.
        at: Micros,
        /// Which.
        broken: Broken,
    },
    /// The plug-in ended, or broke a rule of the ABI.
    Fault {
        /// When.
        at: Micros,
        /// How, for people.
        message: String,
    },
}

impl Finding {
    /// Whether both are of one kind: the same clause, or both faults.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Broken { broken: a, .. }, Self::Broken { broken: b, .. }) => {
                a.clause == b.clause
            }
            (Self::Fault { .. }, Self::Fault { .. }) => true,
            _ => false,
        }
    }
}

/// Makes instances of the plug-in.
pub(crate) type Make<'a, I> = &'a mut dyn FnMut() -> Result<I, String>;

/// The plug-in on its line, with its model.
pub(crate) struct Drive<'a, I: Instance> {
    manifest: &'a Manifest,
    make: Make<'a, I>,
    line: VirtualLine<I>,
    /// The link's clock where the session's is 0. Only the plug-in sees that one.
    clock: Micros,
    pieces: usize,
    has_sizes: bool,
    job_base: u32,
    pub(crate) model: Box<dyn Model>,
    recorder: Recorder,
    /// When characters in the port will have left.
    ends: VecDeque<(Micros, u8)>,
    /// Characters in the port whose start bits are still to come.
    starts: VecDeque<(Micros, u8)>,
    modem: Option<(ModemLines, ModemLines)>,
    is_open: bool,
    is_down: bool,
    pub(crate) now: Micros,
    steps: Vec<(Micros, Step)>,
    observed: Vec<(Micros, Observed)>,
}

impl<'a, I: Instance> Drive<'a, I> {
    pub(crate) fn new(
        manifest: &'a Manifest,
        make: Make<'a, I>,
        conditions: &Conditions,
        options: LinkOptions,
        model: Box<dyn Model>,
    ) -> Result<Self, Finding> {
        let instance = make().map_err(|message| Finding::Fault { at: Micros::ZERO, message })?;
        Ok(Self {
            manifest,
            make,
            modem: options.modem_lines,
            line: VirtualLine::new(instance, options, conditions.depth),
            clock: conditions.clock,
            pieces: conditions.pieces,
            has_sizes: conditions.has_sizes,
            job_base: conditions.job_base,
            model,
            recorder: Recorder::default(),
            ends: VecDeque::new(),
            starts: VecDeque::new(),
            is_open: false,
            is_down: false,
            now: Micros::ZERO,
            steps: Vec::new(),
            observed: Vec::new(),
        })
    }

    /// Lets time go on to `at`, and does the step there.
    pub(crate) fn step(&mut self, at: Micros, step: Step) -> Result<(), Finding> {
        self.run_until(at)?;
        let step = if self.is_possible(&step) { step } else { Step::Given(Given::Nothing) };
        self.steps.push((at, step.clone()));
        self.instant(at, &step)
    }

    /// Nothing comes out of a port that is closed or gone, and of such a link a host
    /// asks little. Job 0 is the delivery under way: it can be aborted, not paused.
    fn is_possible(&self, step: &Step) -> bool {
        let is_up = self.is_open && !self.is_down;
        match step {
            Step::Given(Given::Line(LineInput::Up)) => self.is_open && self.is_down,
            Step::Given(Given::Host(HostRequest::Open)) => !self.is_open,
            // No job has this id.
            Step::Given(Given::Host(HostRequest::Pause(0) | HostRequest::Resume(0))) => false,
            Step::Given(
                Given::Line(_)
                | Given::Host(
                    HostRequest::Job { .. }
                    | HostRequest::Pause(_)
                    | HostRequest::Resume(_)
                    | HostRequest::Abort(_)
                    | HostRequest::ForceResume
                    | HostRequest::Answer(..),
                ),
            ) => is_up,
            Step::Given(Given::Host(_)) | Step::Swap => self.is_open,
            Step::Given(Given::Nothing) => true,
        }
    }

    /// Lets time go on up to, but not into, `at`.
    pub(crate) fn run_until(&mut self, at: Micros) -> Result<(), Finding> {
        while let Some(next) = self.next().filter(|next| *next < at) {
            self.instant(next, &Step::Given(Given::Nothing))?;
        }
        Ok(())
    }

    pub(crate) fn finish(self, end: Micros, finding: Option<Finding>) -> Ran {
        Ran { steps: self.steps, end, finding, observed: self.observed }
    }

    /// Whether the plug-in can be swapped now.
    pub(crate) fn can_swap(&self) -> bool {
        self.is_open && self.manifest.state.saves.is_some()
    }

    fn next(&self) -> Option<Micros> {
        let ends = self.ends.front().map(|(at, _)| *at);
        let starts = self.starts.front().map(|(at, _)| *at);
        let own = self.line.poll_timeout().map(|next| next - self.clock);
        let all = [own, ends, starts, self.model.next()];
        all.into_iter().flatten().min().map(|next| next.max(self.now + Micros(1)))
    }

    fn instant(&mut self, now: Micros, step: &Step) -> Result<(), Finding> {
        self.now = now;
        if let Step::Given(Given::Line(input)) = step {
            self.model.line(now, input);
            self.hear(input)?;
        }
        self.progress()?;
        self.model.due(now);
        self.call(|line, now, host| line.handle_timeout(now, host))?;
        match step {
            Step::Given(Given::Host(request)) => {
                self.model.host(now, request);
                self.ask(request)?;
            }
            Step::Swap if self.can_swap() => self.swap()?,
            Step::Given(_) | Step::Swap => {}
        }
        if self.is_down || !self.is_open {
            self.call(|line, now, host| line.handle_timeout(now, host))?;
        } else {
            self.call(|line, now, host| line.transmit(now, host))?;
        }
        self.model.settled(now).map_err(|broken| Finding::Broken { at: now, broken })
    }

    /// Characters whose last or first bit is due.
    fn progress(&mut self) -> Result<(), Finding> {
        loop {
            let end = self.ends.front().map(|(at, _)| *at).filter(|at| *at <= self.now);
            let start = self.starts.front().map(|(at, _)| *at).filter(|at| *at <= self.now);
            match (end, start) {
                (Some(end), start) if start.is_none_or(|start| end <= start) => {
                    let (at, byte) = self.ends.pop_front().unwrap_or((end, 0));
                    self.model.left(at, byte);
                }
                (_, Some(start)) => {
                    let (at, byte) = self.starts.pop_front().unwrap_or((start, 0));
                    self.tell(at, Observed::Byte(byte))?;
                }
                _ => return Ok(()),
            }
        }
    }

    fn hear(&mut self, input: &LineInput) -> Result<(), Finding> {
        match input {
            LineInput::Bytes(bytes) => {
                self.call(|line, now, host| line.link.received(now, bytes, host))
            }
            LineInput::Damaged { kind, byte, span } => {
                self.call(|line, now, host| line.link.line_error(now, *kind, *byte, *span, host))
            }
            LineInput::ModemLines(named, on) => {
                let Some((known, before)) = self.modem else { return Ok(()) };
                let on = ModemLines((before.0 & !named.0 | on.0) & known.0);
                self.modem = Some((known, on));
                self.call(|line, now, host| line.link.modem_lines(now, known, on, host))
            }
            LineInput::Down(reason) => {
                self.is_down = true;
                self.call(|line, now, host| line.link.link_down(now, *reason, host))
            }
            LineInput::Up => {
                self.is_down = false;
                self.call(|line, now, host| line.link.link_up(now, host))
            }
        }
    }

    fn ask(&mut self, request: &HostRequest) -> Result<(), Finding> {
        match request {
            HostRequest::Open => {
                (self.is_open, self.is_down) = (true, false);
                self.call(|line, now, host| line.link.open(now, host))
            }
            HostRequest::Close => {
                self.is_open = false;
                self.call(|line, now, host| line.link.close(now, host))
            }
            HostRequest::Job { id, kind, fields, data } => {
                let job = self.job(*id, kind, fields, data.len())?;
                self.recorder.add_source(JobId(self.of_link(*id)), data.clone());
                self.call(|line, now, host| line.link.begin_job(now, job, host))
            }
            HostRequest::Pause(job) => {
                let job = self.of_link(*job);
                self.call(|line, now, host| line.link.pause(now, JobId(job), host))
            }
            HostRequest::Resume(job) => {
                let job = self.of_link(*job);
                self.call(|line, now, host| line.link.resume(now, JobId(job), host))
            }
            HostRequest::Abort(job) => {
                let job = self.of_link(*job);
                self.call(|line, now, host| line.link.abort(now, JobId(job), host))
            }
            HostRequest::ForceResume => {
                self.call(|line, now, host| line.link.force_resume(now, host))
            }
            HostRequest::Keep => {
                self.recorder.drain_by_hand = true;
                Ok(())
            }
            HostRequest::PutAway(bytes) => {
                self.recorder.drain(*bytes);
                self.call(|line, now, host| line.link.handle_timeout(now, host))
            }
            HostRequest::PutAllAway => {
                self.recorder.drain_by_hand = false;
                self.recorder.drain(u32::MAX);
                self.call(|line, now, host| line.link.handle_timeout(now, host))
            }
            HostRequest::Answer(request, answer) => {
                let answer = answer.as_ref().map(Vec::as_slice).map_err(|failure| *failure);
                self.call(|line, now, host| {
                    line.link.answer(now, RequestId(*request), answer, host)
                })
            }
        }
    }

    fn job(
        &self,
        id: u32,
        kind: &str,
        fields: &[(String, String)],
        size: usize,
    ) -> Result<Job, Finding> {
        let fault = |message| Finding::Fault { at: self.now, message };
        let place = self.manifest.job_kind(kind);
        let place = place.ok_or_else(|| fault(format!("the plug-in has no job \"{kind}\"")))?;
        let named = fields.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let fields = self.manifest.jobs[usize::from(place)].records(named);
        let fields = fields.map_err(|error| fault(error.to_string()))?;
        let check = self.manifest.needs.check_pass;
        let size = self.has_sizes.then_some(size as u64);
        Ok(Job { id: JobId(self.of_link(id)), kind: place, size, fields, check })
    }

    /// The link's id of a job; 0 is the delivery.
    fn of_link(&self, job: u32) -> u32 {
        if job == 0 { 0 } else { self.job_base + job }
    }

    fn swap(&mut self) -> Result<(), Finding> {
        let fault = |at, message| Finding::Fault { at, message };
        let fresh = (self.make)().map_err(|message| fault(self.now, message))?;
        let mut host = Watch {
            recorder: &mut self.recorder,
            ends: &mut self.ends,
            clock: self.clock,
            pieces: self.pieces,
        };
        let (now, said) = (self.clock + self.now, &self.manifest.state);
        let swapped = self.line.link.swap_as_said(now, fresh, said, &mut host);
        swapped.map_err(|error| fault(self.now, error.to_string()))?;
        self.tell_all()
    }

    /// Calls the link and tells the model what came of it.
    fn call<F>(&mut self, call: F) -> Result<(), Finding>
    where
        F: FnOnce(
            &mut VirtualLine<I>,
            Micros,
            &mut dyn WireHost,
        ) -> Result<(), LinkFault<I::Fault>>,
    {
        let mut host = Watch {
            recorder: &mut self.recorder,
            ends: &mut self.ends,
            clock: self.clock,
            pieces: self.pieces,
        };
        let called = call(&mut self.line, self.clock + self.now, &mut host);
        // A fault ends deliveries and jobs, which is not what is wrong.
        let told = self.tell_all();
        called.map_err(|fault| Finding::Fault { at: self.now, message: fault.to_string() })?;
        told
    }

    fn tell_all(&mut self) -> Result<(), Finding> {
        for (at, observed) in std::mem::take(&mut self.recorder.observed) {
            let at = at - self.clock;
            match observed {
                Observed::Byte(byte) if at > self.now => self.starts.push_back((at, byte)),
                observed => {
                    let is_byte = matches!(observed, Observed::Byte(_));
                    self.tell(at, observed)?;
                    if is_byte {
                        self.leave_at_once(at);
                    }
                }
            }
        }
        Ok(())
    }

    /// On a line without a rate a character leaves as it begins.
    fn leave_at_once(&mut self, at: Micros) {
        if let Some((_, byte)) = self.ends.pop_front_if(|(end, _)| *end == at) {
            self.model.left(at, byte);
        }
    }

    /// With the session's ids of jobs.
    fn tell(&mut self, at: Micros, mut observed: Observed) -> Result<(), Finding> {
        if let Observed::Done { job, .. }
        | Observed::Failed { job, .. }
        | Observed::Checked { job, .. } = &mut observed
        {
            job.0 = job.0.wrapping_sub(self.job_base);
        }
        let Some(effect) = Effect::of(&observed, self.manifest) else { return Ok(()) };
        let told = self.model.seen(at, &effect);
        self.observed.push((at, observed));
        told.map_err(|broken| Finding::Broken { at, broken })
    }
}

/// Records, and sees when characters will have left.
struct Watch<'a> {
    recorder: &'a mut Recorder,
    ends: &'a mut VecDeque<(Micros, u8)>,
    clock: Micros,
    pieces: usize,
}

impl LinkHost for Watch<'_> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        self.recorder.handle(now, action);
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        let most = buffer.len().min(self.pieces);
        self.recorder.supply(job, &mut buffer[..most])
    }

    fn rewind(&mut self, job: JobId) {
        self.recorder.rewind(job);
    }

    fn drained(&mut self) -> u32 {
        self.recorder.drained()
    }
}

impl WireHost for Watch<'_> {
    fn on_wire(&mut self, start: Micros, byte: u8) {
        self.recorder.on_wire(start, byte);
    }

    fn off_wire(&mut self, end: Micros, byte: u8) {
        self.ends.push_back((end - self.clock, byte));
    }
}
