//! One end of the line: a plug-in with its host.

use crate::hash::Hash128;
use crate::instance::{Explored, Shared};
use crate::log::{Input, Log};
use crate::sandbox::StepFault;
use softplug_abi::{Action, Failure, LineErrorKind, LinkDownReason, Micros};
use softplug_link::{
    HoldState, Job, LinkFault, LinkHost, LinkOptions, Recorder, Supply, SwapError, VirtualLine,
};
use std::hash::Hash;
use std::sync::Arc;

/// A job that the host gives.
#[derive(Clone, Debug)]
pub(crate) struct JobGiven {
    /// Place of its kind in the manifest.
    pub(crate) kind: u16,
    /// Its fields as value records.
    pub(crate) fields: Vec<u8>,
    pub(crate) data: Arc<[u8]>,
}

/// A plug-in on its line, and what its host does.
pub(crate) struct PlugIn {
    pub(crate) line: VirtualLine<Explored>,
    host: Host,
    /// The same for all states.
    jobs: Arc<[JobGiven]>,
    /// Jobs that have begun.
    begun: usize,
    is_down: bool,
    /// The job under way is to pause.
    is_paused: bool,
}

/// What a host is told, and what has left.
#[derive(Debug, Default)]
struct Host {
    /// Of the job under way, and how much of it was given.
    source: Option<(Arc<[u8]>, usize)>,
    /// Of the delivery under way.
    delivered: Vec<u8>,
    /// Bytes of deliveries that were put away.
    put_away: u32,
    left: Vec<(Micros, u8)>,
    told: Vec<Told>,
    log: Option<Box<Log>>,
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
#[derive(Debug, Default)]
pub(crate) struct Did {
    /// Each character with the time at which its stop bit ends.
    pub(crate) left: Vec<(Micros, u8)>,
    pub(crate) told: Vec<Told>,
}

/// The plug-in has ended by a fault, and how, for people.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Ended(pub(crate) String);

impl From<LinkFault<StepFault>> for Ended {
    fn from(fault: LinkFault<StepFault>) -> Self {
        Self(fault.to_string())
    }
}

impl From<StepFault> for Ended {
    fn from(fault: StepFault) -> Self {
        Self(fault.to_string())
    }
}

impl PlugIn {
    /// A new instance on a line that is not open yet.
    pub(crate) fn new(
        sandbox: &Shared,
        options: LinkOptions,
        jobs: Vec<JobGiven>,
        is_logged: bool,
    ) -> Self {
        let line = VirtualLine::new(Explored::new(sandbox), options, 1);
        let host = Host { log: is_logged.then(Box::default), ..Host::default() };
        Self { line, host, jobs: jobs.into(), begun: 0, is_down: false, is_paused: false }
    }

    pub(crate) fn open(&mut self, now: Micros) -> Result<Did, Ended> {
        self.line.link.open(now, &mut self.host)?;
        self.go_on(now)
    }

    /// A second one in the same state. The first must have settled.
    pub(crate) fn fork(&self) -> Self {
        let Self { line, host, jobs, begun, is_down, is_paused } = self;
        Self {
            line: line.fork(),
            host: host.fork(),
            jobs: Arc::clone(jobs),
            begun: *begun,
            is_down: *is_down,
            is_paused: *is_paused,
        }
    }

    /// Leaves the sandbox to others.
    pub(crate) fn settle(&mut self, now: Micros) -> Result<(), Ended> {
        Ok(self.line.link.instance_mut().settle(now)?)
    }

    pub(crate) fn move_to(&mut self, sandbox: &Shared) {
        self.line.link.instance_mut().move_to(sandbox);
    }

    /// All that decides what it does from now on.
    pub(crate) fn hash(&self, state: &mut Hash128) {
        self.line.link.instance().hash().hash(state);
        self.line.hash_ahead(state);
        let Host { source, delivered, put_away, .. } = &self.host;
        (source, delivered, put_away).hash(state);
        (self.begun, self.is_down, self.is_paused).hash(state);
    }

    /// When it does something by itself.
    pub(crate) fn next(&self) -> Option<Micros> {
        self.line.next()
    }

    /// When the next timer runs out.
    pub(crate) fn next_timer(&self) -> Option<Micros> {
        self.line.link.next_timer()
    }

    /// The job under way.
    pub(crate) fn job(&self) -> Option<u32> {
        self.line.link.job()
    }

    pub(crate) fn is_down(&self) -> bool {
        self.is_down
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

    /// Jobs that have begun, and all that there are.
    pub(crate) fn jobs(&self) -> (usize, &[JobGiven]) {
        (self.begun, &self.jobs)
    }

    pub(crate) fn into_log(self, end: Micros) -> Option<Log> {
        self.host.log.map(|log| Log { end, ..*log })
    }

    /// What is due at `now`.
    pub(crate) fn tick(&mut self, now: Micros) -> Result<Did, Ended> {
        self.go_on(now)
    }

    /// A character arrives, or one that is damaged.
    pub(crate) fn receive(
        &mut self,
        now: Micros,
        byte: u8,
        damage: Option<LineErrorKind>,
    ) -> Result<Did, Ended> {
        let Self { line, host, .. } = self;
        match damage {
            None => {
                host.note(now, Input::Byte(byte));
                line.link.received(now, &[byte], host)?;
            }
            Some(kind) => {
                host.note(now, Input::Damaged(kind, Some(byte)));
                line.link.line_error(now, kind, Some(byte), 0, host)?;
            }
        }
        self.go_on(now)
    }

    /// The next job begins.
    pub(crate) fn begin_job(&mut self, now: Micros) -> Result<Did, Ended> {
        let Some(job) = self.jobs.get(self.begun) else { return Ok(Did::default()) };
        self.begun += 1;
        let id = self.begun as u32;
        self.host.source = Some((Arc::clone(&job.data), 0));
        let JobGiven { kind, fields, data } = job.clone();
        self.host.note(now, Input::Job { id, kind, fields, data: data.to_vec() });
        self.line.advance(now, &mut self.host)?;
        let job = Job {
            id,
            kind: job.kind,
            size: Some(job.data.len() as u64),
            fields: job.fields.clone(),
            check: false,
        };
        self.line.link.begin_job(now, job, &mut self.host)?;
        self.go_on(now)
    }

    pub(crate) fn abort(&mut self, now: Micros, job: u32) -> Result<Did, Ended> {
        self.host.note(now, Input::Abort(job));
        self.line.advance(now, &mut self.host)?;
        self.line.link.abort(now, job, &mut self.host)?;
        self.go_on(now)
    }

    /// The job under way is to pause, or to go on.
    pub(crate) fn set_paused(&mut self, now: Micros, is_paused: bool) -> Result<Did, Ended> {
        self.is_paused = is_paused;
        let Some(job) = self.job() else { return Ok(Did::default()) };
        self.host.note(now, if is_paused { Input::Pause(job) } else { Input::Resume(job) });
        self.line.advance(now, &mut self.host)?;
        if is_paused {
            self.line.link.pause(now, job, &mut self.host)?;
        } else {
            self.line.link.resume(now, job, &mut self.host)?;
        }
        self.go_on(now)
    }

    pub(crate) fn force(&mut self, now: Micros) -> Result<Did, Ended> {
        self.host.note(now, Input::Force);
        self.line.advance(now, &mut self.host)?;
        self.line.link.force_resume(now, &mut self.host)?;
        self.go_on(now)
    }

    /// The port is gone, or it is back.
    pub(crate) fn set_down(&mut self, now: Micros, is_down: bool) -> Result<Did, Ended> {
        self.is_down = is_down;
        if is_down {
            self.host.note(now, Input::Down);
            self.line.link.link_down(now, LinkDownReason::Unplugged, &mut self.host)?;
        } else {
            self.host.note(now, Input::Up);
            self.line.link.link_up(now, &mut self.host)?;
        }
        self.go_on(now)
    }

    /// A new instance takes over, with the saved state of this one.
    pub(crate) fn swap(&mut self, now: Micros) -> Result<Did, Ended> {
        self.host.note(now, Input::Swap);
        self.line.advance(now, &mut self.host)?;
        let successor = Explored::new(self.line.link.instance().sandbox());
        let swapped = self.line.link.swap(now, successor, &mut self.host);
        swapped.map_err(|error: SwapError<StepFault>| Ended(error.to_string()))?;
        self.go_on(now)
    }

    fn go_on(&mut self, now: Micros) -> Result<Did, Ended> {
        self.line.tick(now, &mut self.host)?;
        if self.line.link.job().is_none() {
            self.host.source = None;
            self.is_paused = false;
        }
        let Host { left, told, .. } = &mut self.host;
        Ok(Did { left: std::mem::take(left), told: std::mem::take(told) })
    }
}

impl Host {
    /// The same for a second plug-in, of which nothing is written down.
    fn fork(&self) -> Self {
        let Self { source, delivered, put_away, left, told, log: _ } = self;
        debug_assert!(left.is_empty() && told.is_empty(), "it has gone on");
        Self {
            source: source.clone(),
            delivered: delivered.clone(),
            put_away: *put_away,
            ..Self::default()
        }
    }

    fn note(&mut self, now: Micros, input: Input) {
        if let Some(log) = &mut self.log {
            log.inputs.push((now, input));
        }
    }

    fn recorder(&mut self) -> Option<&mut Recorder> {
        self.log.as_deref_mut().map(|log| &mut log.recorder)
    }
}

impl LinkHost for Host {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        if let Some(recorder) = self.recorder() {
            recorder.handle(now, action);
        }
        match action {
            Action::DeliveryBegin { .. } => self.delivered.clear(),
            Action::Deliver { bytes, .. } => {
                self.delivered.extend_from_slice(bytes);
                self.put_away += bytes.len() as u32;
            }
            Action::DeliveryEnd { failure, .. } => {
                let bytes = std::mem::take(&mut self.delivered);
                self.told.push(Told::Delivered { bytes, failure: *failure });
            }
            Action::JobDone { .. } => self.told.push(Told::Done),
            Action::JobFailed { failure, .. } => self.told.push(Told::Failed(*failure)),
            Action::Request { request, .. } => self.told.push(Told::Requested(*request)),
            _ => {}
        }
    }

    fn supply(&mut self, _: u32, buffer: &mut [u8]) -> Supply {
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

    fn rewind(&mut self, _: u32) {
        if let Some((_, given)) = &mut self.source {
            *given = 0;
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.put_away)
    }

    fn on_wire(&mut self, start: Micros, byte: u8) {
        if let Some(recorder) = self.recorder() {
            recorder.on_wire(start, byte);
        }
    }

    fn off_wire(&mut self, end: Micros, byte: u8) {
        self.left.push((end, byte));
    }
}
