//! The reactor: many links on few threads, none of which ever waits for one of
//! them.
//!
//! Each link is a *lane*: a port, a plug-in and what belongs to them. Each
//! thread drives up to some 256 lanes with one poll, one timer and one heap of
//! deadlines, and gives each that has something to do a bounded turn. A lane whose
//! plug-in fails or computes for long is given to a thread for such lanes and stays
//! there: its neighbours do not wait for it a second time.
//!
//! [`Reactor::add`] makes a lane, [`Reactor::tell`] gives it commands, and what
//! comes of them is told through the channel of reports. Job data comes, and
//! deliveries go, through [reservoirs](crate::reservoir). Nothing is locked,
//! allocated or sent for each byte or event.

mod deadlines;
pub mod endpoint;
mod fault;
mod host;
mod job_end;
mod opener;
mod real_time;
mod report;
mod setup;
mod status;
mod swap;
mod thread;
mod watch;

pub use endpoint::{
    ENDPOINT_JOBS, Endpoint, EndpointNews, EndpointRequest, LaneEndpoint, LineNews,
};
pub use fault::LaneFault;
pub use job_end::{JobEnd, JobOutcome};
pub use report::{Alarm, AlarmKind, Report};
pub use setup::{Backoff, Command, Feed, LaneId, LaneSetup, Watchdogs};
pub(crate) use status::UnitFigures;
pub use status::{Condition, LaneFigures, LaneStatus};
pub use swap::{Probation, Swap, SwapReport, When};
pub use watch::{Seen, Watch, WatchEvent};

use opener::Opener;
use softplug_abi::Instance;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use thread::{Driver, Reach, ThreadCommand};

use crate::error::PortError;

/// Stack of a thread that drives lanes: a plug-in's step needs 512 KiB.
const STACK: usize = 1024 * 1024;

/// Where reports go.
type Reports = Arc<dyn Fn(LaneId, Report) + Send + Sync>;

/// How a reactor divides its work.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct ReactorOptions {
    /// How many threads; as many as the lanes need if `None`.
    pub threads: Option<usize>,
    /// Lanes after which another thread is begun.
    pub links_per_thread: usize,
    /// Real-time priority of these threads, 1 to 99 (`SCHED_RR`), so that nothing else that
    /// computes on the machine makes them late. The thread for lanes that hold others up never
    /// has it. Needs a right: [`PortError::RealTime`] without it.
    pub real_time_priority: Option<u8>,
}

impl Default for ReactorOptions {
    /// A thread for each 256 links, at ordinary priority.
    fn default() -> Self {
        Self { threads: None, links_per_thread: 256, real_time_priority: None }
    }
}

/// A plug-in that a lane can drive: it and its faults may go to another thread.
pub trait LaneInstance: Instance<Fault: Send> + Send + 'static {}

impl<I: Instance<Fault: Send> + Send + 'static> LaneInstance for I {}

/// Drives lanes. Dropping it ends them all at once.
pub struct Reactor<I: Instance> {
    options: ReactorOptions,
    reports: Reports,
    opener: Opener,
    state: Mutex<State<I>>,
}

struct State<I: Instance> {
    /// For lanes that hold others up.
    aside: Running<I>,
    threads: Vec<Running<I>>,
    lanes: HashMap<LaneId, (usize, Arc<LaneStatus>)>,
}

struct Running<I: Instance> {
    reach: Reach<I>,
    thread: Option<JoinHandle<()>>,
    lanes: usize,
}

impl<I: LaneInstance> Reactor<I> {
    /// A reactor without lanes. What happens is told to `reports`, on the threads
    /// that drive lanes: it must only pass it on.
    pub fn start(
        options: ReactorOptions,
        reports: impl Fn(LaneId, Report) + Send + Sync + 'static,
    ) -> Result<Self, PortError> {
        let reports: Reports = Arc::new(reports);
        let opener = Opener::start()?;
        let aside = begin("softplug-aside".to_owned(), None, &opener, &reports, None)?;
        let mut state = State { aside, threads: Vec::new(), lanes: HashMap::new() };
        for _ in 0..options.threads.unwrap_or(1).max(1) {
            state.begin_thread(options.real_time_priority, &opener, &reports)?;
        }
        let state = Mutex::new(state);
        Ok(Self { options, reports, opener, state })
    }

    /// Adds a lane; its port is opened at once, elsewhere. An id that is taken
    /// already is not added.
    pub fn add(&self, id: LaneId, setup: LaneSetup<I>) {
        let mut state = self.state();
        if state.lanes.contains_key(&id) {
            return;
        }
        let at = self.thread_for_one_more(&mut state);
        let status = Arc::new(LaneStatus::default());
        state.lanes.insert(id, (at, Arc::clone(&status)));
        state.threads[at].lanes += 1;
        state.threads[at].reach.give(ThreadCommand::Add(id, Box::new(setup), status));
    }

    /// Tells a lane something; one that is no more is told nothing.
    pub fn tell(&self, id: LaneId, command: Command<I>) {
        let state = self.state();
        if let Some((at, _)) = state.lanes.get(&id) {
            state.threads[*at].reach.give(ThreadCommand::Tell(id, command));
        }
    }

    /// Ends a lane at once; [`Report::Removed`] follows. [`Command::Close`] before
    /// lets what was given to its port leave. Its status is forgotten.
    pub fn remove(&self, id: LaneId) {
        let mut state = self.state();
        if let Some((at, _)) = state.lanes.remove(&id) {
            state.threads[at].lanes -= 1;
            state.threads[at].reach.give(ThreadCommand::Remove(id));
        }
    }

    /// What the lane is doing; it stays readable after the lane's end.
    pub fn status(&self, id: LaneId) -> Option<Arc<LaneStatus>> {
        self.state().lanes.get(&id).map(|(_, status)| Arc::clone(status))
    }

    /// How many threads drive lanes.
    pub fn threads(&self) -> usize {
        self.state().threads.len()
    }

    fn thread_for_one_more(&self, state: &mut State<I>) -> usize {
        let least = state.threads.iter().enumerate().min_by_key(|(_, thread)| thread.lanes);
        let (at, lanes) = least.map_or((0, 0), |(at, thread)| (at, thread.lanes));
        if self.options.threads.is_some() || lanes < self.options.links_per_thread.max(1) {
            return at;
        }
        match state.begin_thread(self.options.real_time_priority, &self.opener, &self.reports) {
            Ok(()) => state.threads.len() - 1,
            Err(error) => {
                tracing::warn!(%error, "no further thread for links; the others take more");
                at
            }
        }
    }
}

impl<I: LaneInstance> State<I> {
    fn begin_thread(
        &mut self,
        real_time_priority: Option<u8>,
        opener: &Opener,
        reports: &Reports,
    ) -> Result<(), PortError> {
        let name = format!("softplug-io-{}", self.threads.len());
        let aside = self.aside.reach.clone();
        self.threads.push(begin(name, real_time_priority, opener, reports, Some(aside))?);
        Ok(())
    }
}

impl<I: Instance> Reactor<I> {
    fn state(&self) -> MutexGuard<'_, State<I>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn begin<I: LaneInstance>(
    name: String,
    real_time_priority: Option<u8>,
    opener: &Opener,
    reports: &Reports,
    aside: Option<Reach<I>>,
) -> Result<Running<I>, PortError> {
    let (opener, reports) = (opener.clone(), Arc::clone(reports));
    let (made, wait) = std::sync::mpsc::sync_channel(1);
    // Made where it runs: plug-ins' faults need not be sent anywhere.
    let make = move || {
        real_time_priority.map_or(Ok(()), real_time::give)?;
        Driver::new(opener, reports, aside)
    };
    let drive = move || match make() {
        Ok((driver, reach)) => {
            let _ = made.send(Ok(reach));
            driver.run();
        }
        Err(error) => {
            let _ = made.send(Err(error));
        }
    };
    let failed = |error| PortError::io("start a thread", error);
    let thread =
        std::thread::Builder::new().name(name).stack_size(STACK).spawn(drive).map_err(failed)?;
    let reach = wait.recv().map_err(|_| failed(std::io::ErrorKind::Other.into()))??;
    Ok(Running { reach, thread: Some(thread), lanes: 0 })
}

impl<I: Instance> Drop for Reactor<I> {
    fn drop(&mut self) {
        let mut state = self.state();
        end(&mut state.threads);
        // Only now: till then lanes may still be given to it.
        end(std::slice::from_mut(&mut state.aside));
    }
}

fn end<I: Instance>(threads: &mut [Running<I>]) {
    for running in &*threads {
        running.reach.give(ThreadCommand::Stop);
    }
    for running in threads {
        if let Some(thread) = running.thread.take() {
            let _ = thread.join();
        }
    }
}

impl<I: Instance> std::fmt::Debug for Reactor<I> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reactor").field("options", &self.options).finish_non_exhaustive()
    }
}
