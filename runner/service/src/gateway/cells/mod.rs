//! Cells: the coordinator's events from what happens to links and jobs, and what comes of them.
//!
//! A step is written down before it takes effect: the cell, the words that jobs have passed, the
//! jobs that it starts and the journal, in one go. What is not written has not happened; it is tried
//! again at the next tick.

mod calls;
mod loading;
mod notes;
mod program;
mod recovery;
mod show;

use notes::notes;
pub(crate) use program::ChannelOf;
use softplug_abi::JobId;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use softplug_cell::{Cell, Change, ChannelId, Chart, End, Event, Refused, Saved, Stop};
use softplug_live::reactor::Command;

use super::Control;
use super::link::Running;
use crate::Refusal;
use crate::config::CellConfig;
use crate::jobs::{Arrived, CellStep, Job, JobsError, Kind, Start, State as JobState};
use crate::supervise::State as Supervised;
use crate::view::{Change as Shown, now_ms};

/// Spans of each channel that the chart keeps.
const SPANS: usize = 200;
/// Events that wait for a disk.
const PENDING: usize = 1_000;

/// All cells, and which link is a channel of which.
#[derive(Default)]
pub(crate) struct Cells {
    by_name: BTreeMap<String, CellState>,
    of_link: HashMap<String, (String, ChannelId)>,
    /// They were taken from a configuration once.
    are_set: bool,
}

/// A cell that runs.
pub(super) struct CellState {
    config: CellConfig,
    cell: Cell,
    chart: Chart,
    /// The job of each channel that has one.
    jobs: Vec<Option<ChannelJob>>,
    /// What happened and could not be written down yet.
    pending: VecDeque<Event>,
}

/// The job of a channel.
#[derive(Clone, Debug)]
struct ChannelJob {
    id: JobId,
    stops: Arc<[Stop]>,
    /// Stops at which it has arrived.
    reached: usize,
    /// Stops that are behind it.
    passed: usize,
}

/// A cell as it is written down.
#[derive(Serialize, Deserialize)]
struct SavedCell {
    cell: Saved,
    jobs: Vec<Option<JobId>>,
}

/// Why a step was not taken.
enum NotTaken {
    Refused(Refused),
    NotWritten(JobsError),
}

impl From<NotTaken> for Refusal {
    fn from(not_taken: NotTaken) -> Self {
        match not_taken {
            NotTaken::Refused(refused @ Refused::Unknown(_)) => Self::NotFound(refused.to_string()),
            NotTaken::Refused(refused) => Self::Conflict(refused.to_string()),
            NotTaken::NotWritten(error) => error.into(),
        }
    }
}

impl Control {
    /// The cell that a link is a channel of.
    pub(super) fn channel_of(&self, link: &str) -> Option<ChannelOf> {
        let (name, channel) = self.cells.of_link.get(link)?;
        let config = self.cells.by_name.get(name)?.config.clone();
        let search = |channel| {
            let link = self.links.get(config.setup.channel_name(channel));
            link.map(|link| link.config.search.clone()).unwrap_or_default()
        };
        let searches = config.setup.channels().map(search).collect();
        Some(ChannelOf { config, channel: *channel, searches })
    }

    /// Whether the cell keeps a job from being begun.
    pub(super) fn keeps_waiting(&self, link: &str, job: &Job) -> bool {
        let Some((name, channel)) = self.cells.of_link.get(link) else { return false };
        let Some(state) = self.cells.by_name.get(name) else { return false };
        let is_started = job.spec.start == Some(Start::Given) && state.cell.runs(*channel);
        let is_kept = if is_started {
            state.cell.is_held(*channel)
        } else {
            job.spec.kind == Kind::Send && state.cell.check(&begins(*channel, job)).is_err()
        };
        is_kept || !state.pending.is_empty()
    }

    /// Begins a job that is a program of a channel; none if it is not.
    pub(super) fn begin_in_cell(
        &mut self,
        link: &str,
        job: &Job,
    ) -> Option<Result<Job, JobsError>> {
        if job.spec.kind != Kind::Send || job.spec.data.is_none() {
            return None;
        }
        let (name, channel) = self.cells.of_link.get(link)?.clone();
        let stops = match self.shared.parts.jobs.reader().stops(job.id) {
            Ok(stops) => stops.into(),
            Err(error) => return Some(Err(error)),
        };
        let state = self.cells.by_name.get_mut(&name)?;
        let is_started = job.spec.start == Some(Start::Given) && state.cell.runs(channel);
        let of = &mut state.jobs[usize::from(channel.0)];
        let before = of.clone();
        // One that goes on behind a block has its place already.
        if of.as_ref().is_none_or(|of| of.id != job.id) {
            let passed = job.passed as usize;
            *of = Some(ChannelJob { id: job.id, stops, reached: passed, passed });
        }
        let is_paused = state.cell.channel(channel).is_paused;
        let event = match (is_started, is_paused) {
            (false, _) => Some(begins(channel, job)),
            // Somebody ended its pause before it began.
            (true, true) => Some(Event::Paused { channel, is: false }),
            (true, false) => None,
        };
        match self.step(&name, event, Some(job.id)) {
            Ok(()) => Some(self.shared.parts.jobs.reader().job(job.id)),
            Err(not_taken) => {
                let state = self.cells.by_name.get_mut(&name)?;
                state.jobs[usize::from(channel.0)] = before;
                Some(Err(match not_taken {
                    NotTaken::NotWritten(error) => error,
                    NotTaken::Refused(refused) => JobsError::Spec(refused.to_string()),
                }))
            }
        }
    }

    /// The byte of a job behind which nothing is given yet.
    pub(super) fn gate(&self, link: &str, job: JobId) -> Option<u64> {
        let (name, channel) = self.cells.of_link.get(link)?;
        let job_of = self.cells.by_name.get(name)?.jobs[usize::from(channel.0)].as_ref();
        let of_channel = job_of.filter(|of| of.id == job)?;
        Some(of_channel.stops.get(of_channel.passed)?.at)
    }

    /// All before a job's gate has left: its word is said now.
    pub(super) fn at_gate(&mut self, job: JobId, gate: u64) {
        let found = self.cells.by_name.iter_mut().find_map(|(name, state)| {
            let mut jobs = (0..).zip(&mut state.jobs);
            let (at, of) =
                jobs.find_map(|(at, of)| Some((at, of.as_mut().filter(|of| of.id == job)?)))?;
            // What was told before the gate was moved is late.
            let stop = of.stops.get(of.passed).filter(|stop| stop.at == gate)?;
            // What was taken from it comes first; it is told again when the gate is moved then.
            let is_deprived = !state.cell.channel(ChannelId(at)).deprived.is_empty();
            if of.reached > of.passed || is_deprived {
                return None;
            }
            of.reached = of.passed + 1;
            let word = stop.word.clone();
            Some((name.clone(), Event::Reached { channel: ChannelId(at), word }))
        });
        if let Some((name, event)) = found {
            self.happened(&name, event);
        }
    }

    /// A job of a link has ended.
    pub(super) fn left_cell(&mut self, job: &Job) {
        let Some((name, channel)) = self.cells.of_link.get(&job.spec.link).cloned() else { return };
        let Some(state) = self.cells.by_name.get_mut(&name) else { return };
        let of = &mut state.jobs[usize::from(channel.0)];
        if of.as_ref().is_some_and(|of| of.id == job.id) {
            *of = None;
            let end = if job.state == JobState::Done { End::Done } else { End::Failed };
            self.happened(&name, Event::Ended { channel, end });
            self.begin_waiting(&name);
        } else if job.spec.start == Some(Start::Awaited) {
            self.happened(&name, Event::Unloaded { channel });
        } else if job.spec.start == Some(Start::Given) && !job.has_begun() && of.is_none() {
            if !state.cell.runs(channel) {
                return;
            }
            self.happened(&name, Event::Ended { channel, end: End::Failed });
        }
    }

    /// Somebody has a job pause or go on.
    pub(super) fn steered_in_cell(&mut self, job: &Job) {
        let Some((name, channel)) = self.cells.of_link.get(&job.spec.link).cloned() else { return };
        let Some(state) = self.cells.by_name.get(&name) else { return };
        let is_its = state.jobs[usize::from(channel.0)].as_ref().is_some_and(|of| of.id == job.id);
        let is = job.state == JobState::Paused;
        if is_its && state.cell.channel(channel).is_paused != is {
            self.happened(&name, Event::Paused { channel, is });
        }
    }

    /// What nobody tells: ports that came or went, and what a disk did not take.
    pub(super) fn tend_cells(&mut self) {
        let names: Vec<String> = self.cells.by_name.keys().cloned().collect();
        for name in names {
            self.carry_out_pending(&name);
            let Some(state) = self.cells.by_name.get(&name) else { continue };
            let setup = state.config.setup.clone();
            for channel in setup.channels() {
                let link = self.links.get(setup.channel_name(channel));
                let is = link.is_none_or(|link| {
                    let is_out = matches!(link.supervisor.state(), Supervised::Quarantined { .. });
                    !link.port.is_up || is_out
                });
                let Some(state) = self.cells.by_name.get(&name) else { break };
                if state.cell.channel(channel).is_lost != is {
                    self.happened(&name, Event::Lost { channel, is });
                }
            }
        }
    }

    /// Something has happened, and cannot be refused: it counts as soon as it is written down.
    fn happened(&mut self, name: &str, event: Event) {
        let Some(state) = self.cells.by_name.get_mut(name) else { return };
        if state.pending.len() >= PENDING {
            tracing::error!(cell = name, ?event, "too much waits for the disk; this is lost");
            return;
        }
        state.pending.push_back(event);
        self.carry_out_pending(name);
    }

    fn carry_out_pending(&mut self, name: &str) {
        loop {
            let Some(state) = self.cells.by_name.get_mut(name) else { return };
            // Taken out first: what comes of it may have something else happen.
            let Some(event) = state.pending.pop_front() else { return };
            match self.step(name, Some(event.clone()), None) {
                Ok(()) => {}
                Err(NotTaken::Refused(refused)) => {
                    tracing::error!(cell = name, %refused, ?event, "a cell was told what cannot be");
                }
                Err(NotTaken::NotWritten(error)) => {
                    if let Some(state) = self.cells.by_name.get_mut(name) {
                        state.pending.push_front(event);
                    }
                    let _: Option<()> = self.wrote(Err(error));
                    return;
                }
            }
        }
    }

    /// Takes a step, writes it down, and has it take effect.
    fn step(
        &mut self,
        name: &str,
        event: Option<Event>,
        begins: Option<JobId>,
    ) -> Result<(), NotTaken> {
        let Some(state) = self.cells.by_name.get(name) else { return Ok(()) };
        let now = now_ms();
        let arrives = match &event {
            Some(Event::Reached { channel, .. }) => Some(*channel),
            _ => None,
        };
        let mut cell = state.cell.clone();
        let changes = match event {
            Some(event) => cell.handle(now, event).map_err(NotTaken::Refused)?,
            None => Vec::new(),
        };
        let mut step = CellStep { cell: name.to_owned(), begins, ..CellStep::default() };
        step.notes = notes(name, &cell, &changes);
        let setup = &state.config.setup;
        let mut jobs = state.jobs.clone();
        for (channel, of) in setup.channels().zip(&mut jobs) {
            let Some(of) = of.as_mut().filter(|of| of.reached > of.passed) else { continue };
            let left = of.stops[of.passed].at;
            if !cell.waits(channel) {
                of.passed = of.reached;
            } else if arrives != Some(channel) {
                continue;
            }
            step.arrived.push(Arrived { id: of.id, passed: of.passed as u32, left });
        }
        for change in &changes {
            if let Change::Began { channel, by: Some(_), .. } = change {
                step.started.extend(self.loaded_job(setup.channel_name(*channel)));
            }
        }
        step.saved = encoded(&cell, &jobs);
        let changed = self.shared.parts.jobs.step_cell(step).map_err(NotTaken::NotWritten)?;
        if let Some(state) = self.cells.by_name.get_mut(name) {
            state.chart.look(now, &cell);
            (state.cell, state.jobs) = (cell, jobs);
        }
        self.take_effect(name, &changes, &changed);
        Ok(())
    }

    /// A step in which nothing happens to the cell.
    fn unchanged(&self, name: &str) -> Option<CellStep> {
        let state = self.cells.by_name.get(name)?;
        let saved = encoded(&state.cell, &state.jobs);
        Some(CellStep { cell: name.to_owned(), saved, ..CellStep::default() })
    }

    fn take_effect(&mut self, name: &str, changes: &[Change], changed: &[Job]) {
        for job in changed {
            if let Some(running) = self.running(job) {
                running.job = job.clone();
            }
            self.show_job(job);
        }
        let Some(state) = self.cells.by_name.get(name) else { return };
        let setup = state.config.setup.clone();
        for channel in setup.channels() {
            self.let_go_or_hold(name, setup.channel_name(channel), channel);
        }
        for change in changes {
            match change {
                Change::Loaded { channel, program, .. } => self.load(name, *channel, program),
                Change::Began { channel, by: Some(_), .. } => {
                    self.begin_next(setup.channel_name(*channel));
                }
                _ => {}
            }
        }
        if !changes.is_empty()
            && let Some(view) = self.cell_view(name)
        {
            self.shared.changed(Shown::Cell(Box::new(view)));
        }
    }

    /// Moves a channel's gate, and holds or lets go what is on its way: nothing behind the gate leaves
    /// while the cell holds the channel.
    fn let_go_or_hold(&mut self, name: &str, link: &str, channel: ChannelId) {
        let Some(state) = self.cells.by_name.get(name) else { return };
        let Some(of) = &state.jobs[usize::from(channel.0)] else { return };
        let holds = state.cell.is_held(channel);
        let gate = of.stops.get(of.passed).map(|stop| stop.at);
        let (id, is_behind) = (of.id, of.reached == of.passed);
        let held = self.links.get_mut(link).and_then(|link| {
            let lane = link.lane_id();
            let running = link.job.as_mut().filter(|running| running.job.id == id)?;
            let was = std::mem::replace(&mut running.is_held_by_cell, holds);
            // Who was paused by somebody stays so.
            let is_paused = running.job.state == JobState::Paused;
            (was != holds && !is_paused).then_some(lane)
        });
        if let Some(lane) = held.filter(|_| holds) {
            self.drivers.tell(lane, Command::Pause(id));
        }
        if is_behind && !holds {
            self.feeder.move_gate(id, gate);
        }
        if let Some(lane) = held.filter(|_| !holds) {
            self.drivers.tell(lane, Command::Resume(id));
        }
    }

    fn running(&mut self, job: &Job) -> Option<&mut Running> {
        let running = self.links.get_mut(&job.spec.link)?.job.as_mut()?;
        (running.job.id == job.id).then_some(running)
    }

    /// Begins what waits in a cell's queues.
    fn begin_waiting(&mut self, name: &str) {
        let Some(state) = self.cells.by_name.get(name) else { return };
        let setup = state.config.setup.clone();
        for channel in setup.channels() {
            self.begin_next(setup.channel_name(channel));
        }
    }
}

fn encoded(cell: &Cell, jobs: &[Option<ChannelJob>]) -> Vec<u8> {
    let jobs = jobs.iter().map(|of| Some(of.as_ref()?.id)).collect();
    let saved = SavedCell { cell: cell.save(), jobs };
    serde_json::to_vec(&saved).expect("plain data with text keys is JSON")
}

fn begins(channel: ChannelId, job: &Job) -> Event {
    Event::Begin {
        channel,
        program: job.spec.program.clone().unwrap_or_else(|| format!("job {}", job.id)),
        by_hand: job.spec.start.is_none(),
    }
}
