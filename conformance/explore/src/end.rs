//! One end of the line: a plug-in with its host.

use crate::hash::Hash128;
use crate::held::Held;
use crate::instance::{Explored, Shared};
use crate::log::Log;
use crate::sandbox::StepFault;
use softplug_abi::{Action, Failure, JobId, Micros, RequestId};
use softplug_link::{
    HoldState, Job, LinkFault, LinkHost, LinkOptions, Recorder, Supply, SwapError, VirtualLine,
    WireHost,
};
use softplug_models::{Broken, Given, HostRequest, LineInput, Step};
use std::hash::Hash;
use std::sync::Arc;

/// A job that the host gives.
#[derive(Clone, Debug)]
pub(crate) struct JobGiven {
    /// The name of its kind, and its place in the manifest.
    pub(crate) kind: String,
    pub(crate) place: u16,
    /// The data is checked first.
    pub(crate) check: bool,
    pub(crate) data: Arc<[u8]>,
}

/// A plug-in on its line, and what its host does.
pub(crate) struct PlugIn {
    line: VirtualLine<Explored>,
    host: Host,
    /// The profile's model, which is told everything.
    held: Option<Held>,
    /// The same for all states.
    jobs: Arc<[JobGiven]>,
    /// Jobs that have begun.
    begun: usize,
    is_down: bool,
    /// The job under way is to pause.
    is_paused: bool,
    hears_single_bytes: bool,
    log: Option<Box<Log>>,
}

/// What a host is told, and what has left.
#[derive(Debug, Default)]
struct Host {
    /// Of the job under way, and how much of it was given.
    source: Option<(Arc<[u8]>, usize)>,
    /// Of the delivery under way.
    delivered: Vec<u8>,
    /// Bytes of deliveries that were put away, and that wait.
    put_away: u32,
    waiting: u32,
    /// It lets them wait.
    keeps: bool,
    left: Vec<(Micros, u8)>,
    told: Vec<Told>,
    /// What the model and the log are told, if there is one of them.
    recorder: Option<Recorder>,
}

/// What a plug-in says that concerns the promises.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Told {
    /// A delivery, at its end.
    Delivered { bytes: Vec<u8>, failure: Option<Failure> },
    /// The job under way is done.
    Done,
    /// The job under way has failed.
    Failed(Failure),
    /// It asks the host for something.
    Requested(u32),
}

/// What a plug-in did at one instant.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Did {
    /// Each character with the time at which its stop bit ends.
    pub(crate) left: Vec<(Micros, u8)>,
    pub(crate) told: Vec<Told>,
    /// What the model says against it.
    pub(crate) broken: Option<Broken>,
}

/// The plug-in goes no further, and why, for people.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Ended {
    /// By a fault of its own.
    Fault(String),
    /// It cannot be explored.
    Unexplorable(String),
}

impl From<LinkFault<StepFault>> for Ended {
    fn from(fault: LinkFault<StepFault>) -> Self {
        match fault {
            LinkFault::Instance { source, .. } if !source.is_its_own() => source.into(),
            fault => Self::Fault(fault.to_string()),
        }
    }
}

impl From<StepFault> for Ended {
    fn from(fault: StepFault) -> Self {
        let text = fault.to_string();
        if fault.is_its_own() { Self::Fault(text) } else { Self::Unexplorable(text) }
    }
}

impl From<SwapError<StepFault>> for Ended {
    fn from(error: SwapError<StepFault>) -> Self {
        match error {
            SwapError::Save(fault) | SwapError::Failed(fault) => fault.into(),
            SwapError::Refused { source, .. } if !source.is_its_own() => source.into(),
            error => Self::Fault(error.to_string()),
        }
    }
}

impl PlugIn {
    /// A new instance on a line that is not open yet.
    pub(crate) fn new(
        sandbox: &Shared,
        options: LinkOptions,
        jobs: Vec<JobGiven>,
        held: Option<Held>,
        is_logged: bool,
    ) -> Self {
        let recorder = (held.is_some() || is_logged).then(Recorder::default);
        Self {
            line: VirtualLine::new(Explored::new(sandbox), options, 1),
            host: Host { recorder, ..Host::default() },
            held,
            jobs: jobs.into(),
            begun: 0,
            is_down: false,
            is_paused: false,
            hears_single_bytes: false,
            log: is_logged.then(Box::default),
        }
    }

    /// A second one in the same state, of which nothing is written down. The first must have
    /// settled.
    pub(crate) fn fork(&self) -> Self {
        Self {
            line: self.line.fork(),
            host: self.host.fork(),
            held: self.held.as_ref().map(Held::fork),
            jobs: Arc::clone(&self.jobs),
            begun: self.begun,
            is_down: self.is_down,
            is_paused: self.is_paused,
            hears_single_bytes: false,
            log: None,
        }
    }

    /// Leaves the sandbox to others.
    pub(crate) fn settle(&mut self, now: Micros) -> Result<(), Ended> {
        Ok(self.line.link.instance_mut().settle(now)?)
    }

    pub(crate) fn move_to(&mut self, sandbox: &Shared) {
        self.line.link.instance_mut().move_to(sandbox);
    }

    /// All that decides what it does from `now` on.
    pub(crate) fn hash(&self, now: Micros, state: &mut Hash128) {
        self.line.link.instance().hash(now, state);
        self.line.hash_ahead(now, state);
        let Host { source, delivered, put_away, waiting, keeps, .. } = &self.host;
        (source, delivered, put_away, waiting, keeps).hash(state);
        (self.begun, self.is_down, self.is_paused).hash(state);
    }

    /// When it does something by itself.
    pub(crate) fn next(&self) -> Option<Micros> {
        self.line.poll_timeout()
    }

    /// When the next timer runs out.
    pub(crate) fn next_timer(&self) -> Option<Micros> {
        self.line.link.poll_timeout()
    }

    /// The job under way.
    pub(crate) fn job(&self) -> Option<u32> {
        self.line.link.job().map(|job| job.0)
    }

    pub(crate) fn is_down(&self) -> bool {
        self.is_down
    }

    /// Whether the host lets deliveries wait.
    pub(crate) fn keeps(&self) -> bool {
        self.host.keeps
    }

    pub(crate) fn is_paused(&self) -> bool {
        self.is_paused
    }

    /// Whether a delivery is under way.
    pub(crate) fn has_delivery(&self) -> bool {
        self.line.link.has_delivery()
    }

    /// Whether the plug-in holds what is to be sent.
    pub(crate) fn is_held(&self) -> bool {
        self.line.link.hold() == HoldState::Held
    }

    /// The job that comes next.
    pub(crate) fn next_job(&self) -> Option<&JobGiven> {
        self.jobs.get(self.begun)
    }

    /// The request that begins the next job.
    pub(crate) fn begin_job(&self) -> Option<HostRequest> {
        let JobGiven { kind, data, .. } = self.next_job()?;
        let (id, data) = (self.begun as u32 + 1, data.to_vec());
        Some(HostRequest::Job { id, kind: kind.clone(), fields: Vec::new(), data })
    }

    pub(crate) fn into_log(self) -> Option<Log> {
        self.log.map(|log| *log)
    }

    /// What another one in the same state does where bytes of one time come one by one.
    pub(crate) fn in_single_bytes(&self, now: Micros, step: &Step) -> Result<Did, Ended> {
        let mut other = self.fork();
        other.hears_single_bytes = true;
        let did = other.instant(now, step)?;
        other.settle(now)?;
        Ok(did)
    }

    /// What happens at `now`, with what is due then. A line input comes before all else, what the
    /// host does behind what is due.
    pub(crate) fn instant(&mut self, now: Micros, step: &Step) -> Result<Did, Ended> {
        let mut broken = Ok(());
        if let Some(log) = &mut self.log {
            log.end = now;
            if *step != Step::Given(Given::Nothing) {
                log.inputs.push((now, step.clone()));
            }
        }
        if let Some(held) = &mut self.held {
            broken = held.catch_up(now);
            if let Step::Given(Given::Line(input)) = step {
                held.model.line(now, input);
            }
        }
        if let Step::Given(Given::Line(input)) = step {
            self.hear(now, input)?;
            broken = broken.and(self.tell(now));
        }
        if let Some(held) = &mut self.held {
            broken = broken.and(held.due(now));
        }
        self.line.handle_timeout(now, &mut self.host)?;
        broken = broken.and(self.tell(now));
        match step {
            Step::Given(Given::Host(request)) => {
                if let Some(held) = &mut self.held {
                    held.model.host(now, request);
                }
                self.ask(now, request)?;
            }
            Step::Swap => self.swap(now)?,
            Step::Given(_) => {}
        }
        if !self.is_down {
            self.line.transmit(now, &mut self.host)?;
        }
        broken = broken.and(self.tell(now));
        if let Some(held) = &mut self.held {
            broken = broken.and(held.model.settled(now));
        }
        if self.line.link.job().is_none() {
            self.host.source = None;
            self.is_paused = false;
        }
        let Host { left, told, .. } = &mut self.host;
        let (left, told) = (std::mem::take(left), std::mem::take(told));
        Ok(Did { left, told, broken: broken.err() })
    }

    /// Nothing will happen any more: what the model still waits for.
    pub(crate) fn at_rest(&mut self) -> Option<Broken> {
        self.held.as_mut().and_then(|held| held.at_rest().err())
    }

    fn hear(&mut self, now: Micros, input: &LineInput) -> Result<(), Ended> {
        let Self { line: VirtualLine { link, .. }, host, .. } = self;
        match input {
            LineInput::Bytes(bytes) => {
                let most = if self.hears_single_bytes { 1 } else { bytes.len() };
                for bytes in bytes.chunks(most.max(1)) {
                    link.received(now, bytes, host)?;
                }
            }
            LineInput::Damaged { kind, byte, span } => {
                link.line_error(now, *kind, *byte, *span, host)?;
            }
            LineInput::ModemLines(known, on) => link.modem_lines(now, *known, *on, host)?,
            LineInput::Down(reason) => {
                self.is_down = true;
                link.link_down(now, *reason, host)?;
            }
            LineInput::Up => {
                self.is_down = false;
                link.link_up(now, host)?;
            }
        }
        Ok(())
    }

    fn ask(&mut self, now: Micros, request: &HostRequest) -> Result<(), Ended> {
        let Self { line: VirtualLine { link, .. }, host, .. } = self;
        match request {
            HostRequest::Open => link.open(now, host)?,
            HostRequest::Close => link.close(now, host)?,
            HostRequest::Job { id, .. } => {
                let Some(JobGiven { place, check, data, .. }) = self.jobs.get(self.begun) else {
                    return Ok(());
                };
                self.begun += 1;
                host.source = Some((Arc::clone(data), 0));
                let (kind, check, size) = (*place, *check, Some(data.len() as u64));
                let job = Job { id: JobId(*id), kind, size, fields: Vec::new(), check };
                link.begin_job(now, job, host)?;
            }
            HostRequest::Pause(job) => {
                self.is_paused = true;
                link.pause(now, JobId(*job), host)?;
            }
            HostRequest::Resume(job) => {
                self.is_paused = false;
                link.resume(now, JobId(*job), host)?;
            }
            HostRequest::Abort(job) => link.abort(now, JobId(*job), host)?,
            HostRequest::ForceResume => link.force_resume(now, host)?,
            HostRequest::Answer(request, answer) => {
                let answer = answer.as_ref().map(Vec::as_slice).map_err(|failure| *failure);
                link.answer(now, RequestId(*request), answer, host)?;
            }
            HostRequest::Keep => host.keeps = true,
            HostRequest::PutAway(_) => {}
            HostRequest::PutAllAway => {
                host.keeps = false;
                host.put_away += std::mem::take(&mut host.waiting);
                link.handle_timeout(now, host)?;
            }
        }
        Ok(())
    }

    /// A new instance takes over, with the saved state of this one.
    fn swap(&mut self, now: Micros) -> Result<(), Ended> {
        let successor = Explored::new(self.line.link.instance().sandbox());
        self.line.link.swap(now, successor, &mut self.host)?;
        Ok(())
    }

    /// Tells model and log what the plug-in did.
    fn tell(&mut self, now: Micros) -> Result<(), Broken> {
        let Some(recorder) = &mut self.host.recorder else { return Ok(()) };
        let observed = std::mem::take(&mut recorder.observed);
        if let Some(log) = &mut self.log {
            log.observed.extend(observed.iter().cloned());
        }
        match &mut self.held {
            Some(held) => held.tell(now, observed, &self.host.left),
            None => Ok(()),
        }
    }
}

impl Host {
    /// The same for a second plug-in.
    fn fork(&self) -> Self {
        let Self { source, delivered, put_away, waiting, keeps, left, told, recorder } = self;
        debug_assert!(left.is_empty() && told.is_empty(), "they were taken");
        Self {
            source: source.clone(),
            delivered: delivered.clone(),
            put_away: *put_away,
            waiting: *waiting,
            keeps: *keeps,
            recorder: recorder.clone(),
            ..Self::default()
        }
    }
}

impl LinkHost for Host {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.handle(now, action);
        }
        match action {
            Action::DeliveryBegin { .. } => self.delivered.clear(),
            Action::Deliver { bytes, .. } => {
                self.delivered.extend_from_slice(bytes);
                let place = if self.keeps { &mut self.waiting } else { &mut self.put_away };
                *place += bytes.len() as u32;
            }
            Action::DeliveryEnd { failure, .. } => {
                let bytes = std::mem::take(&mut self.delivered);
                self.told.push(Told::Delivered { bytes, failure: *failure });
            }
            Action::JobDone { .. } => self.told.push(Told::Done),
            Action::JobFailed { failure, .. } => self.told.push(Told::Failed(*failure)),
            Action::Request { request, .. } => self.told.push(Told::Requested(request.0)),
            _ => {}
        }
    }

    fn supply(&mut self, _: JobId, buffer: &mut [u8]) -> Supply {
        let Some((data, given)) = &mut self.source else { return Supply::End };
        let rest = &data[*given..];
        let count = rest.len().min(buffer.len());
        if count == 0 {
            return Supply::End;
        }
        buffer[..count].copy_from_slice(&rest[..count]);
        *given += count;
        Supply::Bytes(count)
    }

    fn rewind(&mut self, _: JobId) {
        if let Some((_, given)) = &mut self.source {
            *given = 0;
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.put_away)
    }
}

impl WireHost for Host {
    fn on_wire(&mut self, start: Micros, byte: u8) {
        if let Some(recorder) = &mut self.recorder {
            recorder.on_wire(start, byte);
        }
    }

    fn off_wire(&mut self, end: Micros, byte: u8) {
        self.left.push((end, byte));
    }
}
