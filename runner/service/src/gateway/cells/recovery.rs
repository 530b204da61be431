//! Cells as the configuration names them, and as the last gateway left them.

use softplug_abi::JobId;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use softplug_cell::{AfterCrash, Cell, ChannelSet, Chart, End, Event, Mode};

use super::super::jobs::JobCommand;
use super::{CellState, ChannelJob, Control, SPANS, SavedCell};
use crate::config::CellConfig;
use crate::jobs::{
    CellStep, Job, JobSpec, Note, Resumed, Start, State as JobState, Subject, Weight,
};
use crate::view::now_ms;

impl Control {
    /// Takes the cells of a configuration; those that are changed only by a new start.
    pub(in super::super) fn set_cells(&mut self, configs: &[CellConfig]) -> Vec<String> {
        let (mut waiting, mut returned) = (Vec::new(), Vec::new());
        let is_start = !self.cells.are_set;
        self.cells.are_set = true;
        let gone: Vec<String> = self
            .cells
            .by_name
            .iter()
            .filter(|(name, _)| !configs.iter().any(|config| config.name == **name))
            .map(|(name, _)| name.clone())
            .collect();
        for name in gone {
            if self.is_at_work(&name) {
                waiting.push(format!("cell.{name}"));
            } else {
                self.cells.by_name.remove(&name);
            }
        }
        let mut left = if is_start { self.left_cells(configs) } else { LeftCells::default() };
        for config in configs {
            let is_at_work = self.is_at_work(&config.name);
            let is_elsewhere = self.is_channel_elsewhere(config);
            match self.cells.by_name.get_mut(&config.name) {
                Some(state) if state.config.setup == config.setup => state.config = config.clone(),
                Some(_) if is_at_work => {
                    waiting.push(format!("cell.{}", config.name));
                }
                Some(_) => self.add_cell(config, Cell::new(config.setup.clone())),
                None if is_elsewhere => {
                    waiting.push(format!("cell.{}", config.name));
                }
                None if !is_start => self.add_cell(config, Cell::new(config.setup.clone())),
                None => {
                    let jobs = self.bring_back(config, &mut left);
                    returned.extend(jobs.map(|jobs| (config, jobs)));
                }
            }
        }
        let channels = self.cells.by_name.iter().flat_map(|(name, state)| {
            let setup = &state.config.setup;
            let of = |channel| (setup.channel_name(channel).to_owned(), (name.clone(), channel));
            setup.channels().map(of)
        });
        self.cells.of_link = channels.collect();
        self.forget(left.renamed);
        for (config, jobs) in returned {
            self.after_crash(config, &jobs);
        }
        waiting
    }

    fn is_at_work(&self, name: &str) -> bool {
        self.cells.by_name.get(name).is_some_and(|state| {
            let setup = &state.config.setup;
            setup.channels().any(|channel| state.cell.runs(channel))
                || setup.axes().any(|axis| state.cell.axis(axis).0.is_some())
                || setup.groups().any(|(group, ..)| state.cell.mode(group) != Mode::Auto)
                || state.cell.is_stopped()
        })
    }

    /// A link is in one cell: one that is still at work keeps it.
    fn is_channel_elsewhere(&self, config: &CellConfig) -> bool {
        self.cells.by_name.values().any(|state| {
            let other = &state.config.setup;
            let mut names = config.setup.channels().map(|one| config.setup.channel_name(one));
            names.any(|name| other.channels().any(|one| other.channel_name(one) == name))
        })
    }

    fn add_cell(&mut self, config: &CellConfig, cell: Cell) {
        let jobs = vec![None; config.setup.channels().count()];
        let mut chart = Chart::new(SPANS);
        chart.look(now_ms(), &cell);
        let pending = VecDeque::new();
        let state = CellState { config: config.clone(), cell, chart, jobs, pending };
        self.cells.by_name.insert(config.name.clone(), state);
    }

    /// What the last gateway left.
    fn left_cells(&mut self, configs: &[CellConfig]) -> LeftCells {
        let read = self.shared.parts.jobs.reader().cells();
        let is_configured = |name: &str| configs.iter().any(|config| config.name == name);
        let all = self.wrote(read).unwrap_or_default().into_iter();
        let (configured, former) = all.partition(|(name, _)| is_configured(name));
        LeftCells { configured, former, renamed: BTreeSet::new() }
    }

    /// A cell as it was before the gateway was ended, if it was; with the jobs of its channels.
    fn bring_back(
        &mut self,
        config: &CellConfig,
        left: &mut LeftCells,
    ) -> Option<Vec<Option<JobId>>> {
        let mut former = left.former_of(config);
        let (first, second) = (former.next(), former.next());
        drop(former);
        let (renamed, saved) = match (left.configured.get(&config.name), first) {
            (Some(own), _) => (None, own),
            (None, None) => {
                self.add_cell(config, Cell::new(config.setup.clone()));
                return None;
            }
            (None, Some(_)) if second.is_some() => {
                self.begin_stopped(config, "its channels were in several cells that are gone");
                return None;
            }
            (None, Some((name, saved))) => (Some(name.clone()), saved),
        };
        let saved: Option<SavedCell> = serde_json::from_slice(saved).ok();
        let restored = saved.map(|SavedCell { cell, jobs }| {
            Cell::restore(config.setup.clone(), cell).map(|cell| (cell, jobs))
        });
        let jobs = match restored {
            Some(Ok((cell, jobs))) => {
                self.add_cell(config, cell);
                Some(jobs)
            }
            Some(Err(error)) => {
                self.begin_stopped(config, &error.to_string());
                None
            }
            None => {
                self.begin_stopped(config, "what was saved of the cell is damaged");
                None
            }
        };
        if let Some(former) = renamed
            && self.has_another_name(&former, config, jobs.as_deref().unwrap_or_default())
        {
            left.renamed.insert(former);
        }
        jobs
    }

    /// What a cell was is written down under its new name; whether it could be.
    fn has_another_name(
        &mut self,
        former: &str,
        config: &CellConfig,
        jobs: &[Option<JobId>],
    ) -> bool {
        let name = &config.name;
        let Some(state) = self.cells.by_name.get(name) else { return false };
        let saved = SavedCell { cell: state.cell.save(), jobs: jobs.to_vec() };
        let text = format!("{name}: was called {former} when the gateway was ended");
        let step = CellStep {
            cell: name.clone(),
            saved: serde_json::to_vec(&saved).expect("plain data with text keys is JSON"),
            notes: vec![Note::new(Subject::Cell, text)],
            ..CellStep::default()
        };
        let written = self.shared.parts.jobs.step_cell(step);
        self.wrote(written).is_some()
    }

    /// Nothing stays under a name that a cell no longer has.
    fn forget(&mut self, renamed: BTreeSet<String>) {
        for cell in renamed {
            let written =
                self.shared.parts.jobs.step_cell(CellStep { cell, ..CellStep::default() });
            self.wrote(written);
        }
    }

    /// It is not known how it was: somebody has to look before anything begins.
    fn begin_stopped(&mut self, config: &CellConfig, why: &str) {
        let text = format!("{}: {why}; it is stopped until somebody clears it", config.name);
        let note = Note::new(Subject::Cell, text).weighing(Weight::Alarm);
        self.shared.parts.journal_writer.note(note);
        self.add_cell(config, Cell::stopped(config.setup.clone()));
    }

    fn after_crash(&mut self, config: &CellConfig, jobs: &[Option<JobId>]) {
        let (name, setup) = (&config.name, &config.setup);
        let policy = config.after_crash;
        let (mut cut_off, mut resumed) = (ChannelSet::default(), Vec::new());
        for (channel, id) in setup.channels().zip(jobs) {
            let Some(state) = self.cells.by_name.get(name) else { return };
            if !state.cell.runs(channel) {
                continue;
            }
            let waits = state.cell.waits(channel);
            let is_paused = state.cell.channel(channel).is_paused;
            let job = id.and_then(|id| self.shared.parts.jobs.reader().job(id).ok());
            match job {
                // Its end was written down, and not what came of it.
                Some(job) if job.state == JobState::Done => {
                    self.happened(name, Event::Ended { channel, end: End::Done });
                }
                // It went on behind a block already, and had not begun.
                Some(job) if waits && policy == AfterCrash::Resume && !job.state.is_final() => {
                    self.stands_again(name, &job);
                }
                Some(job) if waits && job.state == JobState::Interrupted => {
                    match self.goes_on(&job, is_paused) {
                        Some(goes_on) => resumed.push(goes_on),
                        None => cut_off.insert(channel),
                    }
                }
                // Started, and still in the queue.
                None if !self.started(setup.channel_name(channel)).is_empty() => {}
                _ => cut_off.insert(channel),
            }
        }
        if policy == AfterCrash::Resume && !resumed.is_empty() {
            let Some(unchanged) = self.unchanged(name) else { return };
            let step = CellStep { resumed, ..unchanged };
            let written = self.shared.parts.jobs.step_cell(step);
            for job in self.wrote(written).unwrap_or_default() {
                self.stands_again(name, &job);
                self.show_job(&job);
            }
        }
        let is_at_work = setup.channels().any(|channel| {
            self.cells.by_name.get(name).is_some_and(|state| state.cell.runs(channel))
        });
        if is_at_work {
            self.happened(name, Event::Restarted { cut_off, policy });
            if policy == AfterCrash::Stop {
                self.end_started(config);
            }
        }
        self.load_again(config);
    }

    /// Programs that others had started, and that had not begun, have ended with the cell's.
    fn end_started(&mut self, config: &CellConfig) {
        for channel in config.setup.channels() {
            for job in self.started(config.setup.channel_name(channel)) {
                let text = format!(
                    "{}: the program of job {job} was started and had not begun: it has ended",
                    config.name
                );
                let note = Note::new(Subject::Cell, text).of_job(job).weighing(Weight::Warning);
                self.shared.parts.journal_writer.note(note);
                if let Err(refusal) = self.steer(job, JobCommand::Abort) {
                    tracing::error!(%refusal, %job, "what was started begins when the cell is cleared");
                }
            }
        }
    }

    /// A job that goes on with one that stands behind a block is the channel's, before it begins.
    fn stands_again(&mut self, name: &str, job: &Job) {
        let stops = self.shared.parts.jobs.reader().stops(job.id);
        let Some(stops) = self.wrote(stops) else { return };
        let Some(state) = self.cells.by_name.get_mut(name) else { return };
        let Some(channel) = state.config.setup.channel(&job.spec.link) else { return };
        let passed = job.passed as usize;
        if passed < stops.len() {
            let stands =
                ChannelJob { id: job.id, stops: stops.into(), reached: passed + 1, passed };
            state.jobs[usize::from(channel.0)] = Some(stands);
        }
    }

    /// The job that goes on with one that stands behind a block.
    fn goes_on(&self, job: &Job, is_paused: bool) -> Option<Resumed> {
        let stops = self.shared.parts.jobs.reader().stops(job.id).ok()?;
        let spec = JobSpec {
            from: stops.get(job.passed as usize)?.at,
            words_before: job.passed,
            restarts: Some(job.id),
            start: Some(Start::Given),
            ..job.spec.clone()
        };
        Some(Resumed { spec, stops, is_paused })
    }

    /// Programs that were started there and are in the queue.
    fn started(&self, link: &str) -> Vec<JobId> {
        let live = self.shared.parts.jobs.live().into_iter();
        let is_started = |job: &Job| job.spec.link == link && job.spec.start == Some(Start::Given);
        live.filter(is_started).map(|job| job.id).collect()
    }

    /// What was loaded when the gateway was ended, and is in no queue.
    fn load_again(&self, config: &CellConfig) {
        for channel in config.setup.channels() {
            let Some(state) = self.cells.by_name.get(&config.name) else { return };
            let loaded = state.cell.channel(channel).loaded.map(ToOwned::to_owned);
            let Some(program) = loaded else { continue };
            if self.loaded_job(config.setup.channel_name(channel)).is_none() {
                self.load(&config.name, channel, &program);
            }
        }
    }
}

/// Cells as the last gateway left them, encoded, by their names.
#[derive(Default)]
struct LeftCells {
    configured: BTreeMap<String, Vec<u8>>,
    /// Those that have no configuration any more.
    former: BTreeMap<String, Vec<u8>>,
    /// Those of them that go on under another name.
    renamed: BTreeSet<String>,
}

impl LeftCells {
    /// Those that are gone and had a channel of this one.
    fn former_of<'a>(
        &'a self,
        config: &'a CellConfig,
    ) -> impl Iterator<Item = (&'a String, &'a Vec<u8>)> {
        let setup = &config.setup;
        self.former.iter().filter(|(_, saved)| {
            let saved: Option<SavedCell> = serde_json::from_slice(saved).ok();
            saved.is_some_and(|SavedCell { cell, .. }| {
                let mut names = setup.channels().map(|one| setup.channel_name(one));
                names.any(|name| cell.channels().iter().any(|other| other == name))
            })
        })
    }
}
