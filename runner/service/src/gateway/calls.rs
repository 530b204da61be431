//! The handle's calls that concern links, jobs and the gateway itself.

use softplug_abi::JobId;
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use softplug_catalogue::Notations;
use softplug_cell::Stop;
use softplug_host::Plugin;
use softplug_live::reactor::Command;
use tokio::sync::broadcast;

use super::jobs::JobCommand;
use super::link::{Link, WantedSwap};
use super::simulated::Simulated;
use super::{Control, Gateway, Watching, show};
use crate::Refusal;
use crate::config::{Config, ConfigError};
use crate::jobs::{
    BeginAt, EntryFilter, Job, JobFilter as Filter, JobSpec, Kind, Words, beginning_at,
};
use crate::view::{
    Change, HealthView, HistoryView, JobFilter, JobOrder, JobView, JournalEntry, JournalFilter,
    KindView, LatheView, LinkCounts, LinkState, LinkView, ReadyView, ReloadView, StopHow,
    SwapOrder, SwapView,
};

/// How long a swap is waited for that does not have to wait for the link.
const SWAPPING: Duration = Duration::from_secs(5);
/// The kind of job that is meant if nothing else is said.
const SEND: &str = "send";
/// Fields by which a plug-in that finds blocks itself is told the first, by the line of the program or by a
/// count of its own.
const FROM: [&str; 2] = ["from_line", "from_block"];

/// Links.
impl Gateway {
    /// All links, in the order of their names.
    pub fn links(&self) -> Result<Vec<LinkView>, Refusal> {
        self.shared.ask(|control| Ok(control.link_views()))
    }

    /// One link.
    pub fn link(&self, name: &str) -> Result<LinkView, Refusal> {
        let name = name.to_owned();
        self.shared.ask(move |control| control.link_view(&name))
    }

    /// The kinds of job that a link's plug-in takes.
    pub fn job_kinds(&self, link: &str) -> Result<Vec<KindView>, Refusal> {
        Ok(show::kinds(&self.plugin_of(link)?.manifest().jobs))
    }

    /// What the simulated lathe of a link has cut so far.
    pub fn lathe(&self, link: &str) -> Result<LatheView, Refusal> {
        let name = link.to_owned();
        let lathe = self.shared.ask(move |control| {
            let machine = &control.link(&name)?.machine;
            Ok(machine.as_ref().and_then(Simulated::lathe))
        })?;
        let no_lathe =
            || Refusal::NotFound(format!("the port of link {link} is no simulated lathe"));
        lathe.map(|lathe| lathe.view()).ok_or_else(no_lathe)
    }

    /// What a link did over the last day.
    pub fn history(&self, link: &str) -> Result<HistoryView, Refusal> {
        let name = link.to_owned();
        self.shared.ask(move |control| control.history(&name))
    }

    /// Closes a link's port and opens it again.
    pub fn reopen(&self, link: &str) -> Result<LinkView, Refusal> {
        self.on_link(link, Control::reopen)
    }

    /// Swaps a link's plug-in. Loads it first, which may take a second; then
    /// waits a moment for the swap, which may have to wait for the link.
    pub fn swap(&self, link: &str, order: &SwapOrder) -> Result<SwapView, Refusal> {
        let settings = if let Some(settings) = &order.settings {
            settings.clone()
        } else {
            // Settings belong to a plug-in: another one has others.
            let running = self.link(link)?;
            let to = self.shared.parts.loader.resolve(&order.plugin)?;
            let is_same = running.plugin.is_some_and(|plugin| plugin.name == to.name);
            if is_same { running.settings } else { BTreeMap::new() }
        };
        let successor = self.shared.parts.loader.prepare(&order.plugin, &settings)?;
        let (to, done) = sync_channel(1);
        let probation = order.probation.map(Into::into);
        let wanted = WantedSwap {
            successor,
            when: order.when,
            probation,
            waits: Some(to),
            configured: None,
        };
        let link = link.to_owned();
        let ordered = self.shared.ask(move |control| control.order_swap(&link, wanted))?;
        Ok(done.recv_timeout(SWAPPING).unwrap_or(ordered))
    }

    /// Goes on although the machine holds the line.
    pub fn force_resume(&self, link: &str) -> Result<LinkView, Refusal> {
        self.on_link(link, |control, name| {
            let lane = control.link(name)?.lane_id();
            control.drivers.tell(lane, Command::ForceResume);
            Ok(())
        })
    }

    /// Stops a link's plug-in at once, whatever it is doing: the link is in quarantine then.
    pub fn quarantine(&self, link: &str) -> Result<LinkView, Refusal> {
        self.on_link(link, Control::quarantine)
    }

    /// Lets a link out of quarantine: its plug-in is started again.
    pub fn release(&self, link: &str) -> Result<LinkView, Refusal> {
        self.on_link(link, Control::release)
    }

    /// What passes on a link's line from now on. A link never waits for who watches it.
    pub fn watch(&self, link: &str) -> Result<Watching, Refusal> {
        let link = link.to_owned();
        self.shared.ask(move |control| control.watch(&link))
    }

    fn on_link(
        &self,
        link: &str,
        act: impl FnOnce(&mut Control, &str) -> Result<(), Refusal> + Send + 'static,
    ) -> Result<LinkView, Refusal> {
        let link = link.to_owned();
        self.shared.ask(move |control| {
            act(control, &link)?;
            control.link_view(&link)
        })
    }

    pub(super) fn names_of(&self, link: &str) -> Result<Notations, Refusal> {
        let link = link.to_owned();
        self.shared.ask(move |control| Ok(control.link(&link)?.config.names.clone()))
    }

    pub(super) fn plugin_of(&self, link: &str) -> Result<Plugin, Refusal> {
        let link = link.to_owned();
        self.shared.ask(move |control| Ok(control.link(&link)?.plugin.plugin.clone()))
    }
}

/// Jobs.
impl Gateway {
    /// Jobs, the newest first.
    pub fn jobs(&self, filter: &JobFilter) -> Result<Vec<JobView>, Refusal> {
        let jobs = self.shared.parts.jobs.reader().list(&Filter::from(filter.clone()))?;
        // Of one that has ended nobody knows more than is written down.
        let live: Vec<_> = jobs.iter().filter(|job| !job.state.is_final()).cloned().collect();
        let mut views: HashMap<JobId, JobView> = if live.is_empty() {
            HashMap::new()
        } else {
            self.shared.ask(move |control| {
                Ok(live.iter().map(|job| (job.id, control.job_view(job))).collect())
            })?
        };
        let view = |job: &Job| views.remove(&job.id).unwrap_or_else(|| job.view(None));
        Ok(jobs.iter().map(view).collect())
    }

    /// One job.
    pub fn job(&self, id: JobId) -> Result<JobView, Refusal> {
        let job = self.shared.parts.jobs.reader().job(id)?;
        let between = self.shared.parts.snapshots.between(&job);
        let last_block = between.ok().and_then(|between| between.last_whole);
        let view = self.shared.ask(move |control| Ok(control.job_view(&job)))?;
        Ok(JobView { last_block: last_block.map(|block| block.number), ..view })
    }

    /// Puts a job into a link's queue. A program that it sends is copied first:
    /// editing the file afterwards changes nothing.
    pub fn submit(&self, link: &str, order: &JobOrder) -> Result<JobView, Refusal> {
        self.refuse_while_stopping()?;
        let plugin = self.plugin_of(link)?;
        let _hold = self.shared.parts.snapshots.hold();
        let job = self::order(link, order, &plugin)?;
        let has_field = finds_blocks(&plugin, &job.job_kind);
        let mut stops = Vec::new();
        let job = match (&order.program, order.from_block) {
            (Some(program), from) => {
                let parts = &self.shared.parts;
                let data = parts.programs.snapshot(&program.parse()?, &parts.snapshots)?;
                let named = parts.snapshots.name_of(data, &self.names_of(link)?);
                let (data, found) = self.words_of(link, data)?;
                stops = found;
                let job = JobSpec { data: Some(data), named, ..job };
                let at = from.map_or(BeginAt::Start, BeginAt::Block);
                if at == BeginAt::Start {
                    job
                } else {
                    let words = Words { stops: &stops, stood: None };
                    beginning_at(job, at, has_field, words, &parts.snapshots)?
                }
            }
            (None, Some(_)) => {
                return Err(Refusal::invalid("from_block", "only a program has blocks: name one"));
            }
            (None, None) => job,
        };
        self.put(job, stops)
    }

    /// A job whose data is all that comes from `source`. The order's program is only a name.
    ///
    /// It is given to the machine as it comes, and refused if the link is busy; a source that
    /// fails is no whole program, and neither is the job. But a plug-in that looks at a program
    /// before it sends it gets it as a whole: it is kept first, and waits for its turn then. So is
    /// one for a channel of a cell, whose words must be known before it begins.
    pub fn feed(
        &self,
        link: &str,
        order: &JobOrder,
        size: Option<u64>,
        source: &mut dyn Read,
    ) -> Result<JobView, Refusal> {
        self.refuse_while_stopping()?;
        let plugin = self.plugin_of(link)?;
        if order.from_block.is_some() {
            return Err(Refusal::invalid("from_block", "only an uploaded program has blocks"));
        }
        let job = self::order(link, order, &plugin)?;
        if plugin.manifest().needs.check_pass || self.channel_of(link)?.is_some() {
            let snapshots = &self.shared.parts.snapshots;
            let _hold = snapshots.hold();
            let name = job.program.as_deref().unwrap_or("the data");
            let mut source = self.shared.parts.quotas.within(source);
            let data = snapshots.take_all(&mut source, name, self.shared.upload_bytes)?;
            let named = snapshots.name_of(data, &self.names_of(link)?);
            let (data, stops) = self.words_of(link, data)?;
            return self.put(JobSpec { data: Some(data), named, ..job }, stops);
        }
        let link = link.to_owned();
        let (id, mut feeding) = self.shared.ask(move |control| control.feed(&link, job, size))?;
        match io::copy(source, &mut feeding) {
            Ok(_) => feeding.finish(),
            // Dropped: the job fails, and says why.
            Err(_) => drop(feeding),
        }
        self.job(JobId(id))
    }

    /// Puts a job into its link's queue.
    fn put(&self, order: JobSpec, stops: Vec<Stop>) -> Result<JobView, Refusal> {
        let job = self.shared.parts.jobs.submit_with(order, stops)?;
        self.shared.ask(move |control| {
            control.show_job(&job);
            control.begin_next(&job.spec.link);
            let job = control.shared.parts.jobs.reader().job(job.id)?;
            Ok(control.job_view(&job))
        })
    }

    /// Pauses a job.
    pub fn pause(&self, id: JobId) -> Result<JobView, Refusal> {
        self.shared.ask(move |control| control.steer(id, JobCommand::Pause))
    }

    /// Ends its pause.
    pub fn resume(&self, id: JobId) -> Result<JobView, Refusal> {
        self.shared.ask(move |control| control.steer(id, JobCommand::Resume))
    }

    /// Aborts a job, or takes it out of the queue.
    pub fn abort(&self, id: JobId) -> Result<JobView, Refusal> {
        self.shared.ask(move |control| control.steer(id, JobCommand::Abort))
    }

    /// Puts a job that has ended into the queue again, as a new job.
    pub fn restart(&self, id: JobId, at: BeginAt) -> Result<JobView, Refusal> {
        self.refuse_while_stopping()?;
        let parts = &self.shared.parts;
        let _hold = parts.snapshots.hold();
        let before = parts.jobs.reader().job(id)?;
        let link = before.spec.link.clone();
        let plugin = self.plugin_of(&link)?;
        let field = finds_blocks(&plugin, &before.spec.job_kind);
        let job = parts.jobs.restart(id, at, field, &parts.snapshots)?;
        self.shared.ask(move |control| {
            // Who does it again knows how it ended.
            control.acknowledge(id)?;
            control.show_job(&job);
            control.begin_next(&link);
            Ok(control.job_view(&job))
        })
    }

    /// Somebody has seen how a job ended, and the jobs of its link before it: they are no
    /// trouble any more.
    pub fn acknowledge(&self, id: JobId) -> Result<JobView, Refusal> {
        self.shared.ask(move |control| control.acknowledge(id))
    }

    /// Gives a job that waits another priority.
    pub fn prioritise(&self, id: JobId, priority: i32) -> Result<JobView, Refusal> {
        self.shared.ask(move |control| control.steer(id, JobCommand::Prioritise(priority)))
    }

    fn refuse_while_stopping(&self) -> Result<(), Refusal> {
        if self.shared.is_stopping() {
            return Err(Refusal::Unavailable("the gateway stops; it takes no new jobs".to_owned()));
        }
        Ok(())
    }
}

fn finds_blocks(plugin: &Plugin, kind: &str) -> Option<&'static str> {
    let kind = plugin.manifest().jobs.iter().find(|known| known.name == kind)?;
    FROM.into_iter().find(|name| kind.fields.iter().any(|field| field.name == *name))
}

/// The gateway itself.
impl Gateway {
    /// Entries of the journal, the newest first.
    pub fn journal(&self, filter: &JournalFilter) -> Result<Vec<JournalEntry>, Refusal> {
        let entries =
            self.shared.parts.jobs.reader().journal(&EntryFilter::from(filter.clone()))?;
        Ok(entries.into_iter().map(Into::into).collect())
    }

    /// All that changes from now on. A reader who is too slow misses the oldest
    /// and is told how many.
    pub fn subscribe(&self) -> broadcast::Receiver<Arc<Change>> {
        self.shared.changes.subscribe()
    }

    /// How it is.
    pub fn health(&self) -> HealthView {
        let asked = self
            .shared
            .ask(|control| Ok((control.counts(), control.trouble.clone(), control.warnings())));
        let (links, problems, warnings) = match asked {
            Ok((links, trouble, warnings)) => (links, trouble.into_iter().collect(), warnings),
            Err(refusal) => (LinkCounts::default(), vec![refusal.to_string()], Vec::new()),
        };
        HealthView {
            is_healthy: problems.is_empty(),
            problems,
            warnings,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            started_ms: self.shared.started_ms,
            links,
        }
    }

    /// Whether its control loop answers.
    pub fn is_alive(&self) -> bool {
        self.shared.ask(|_| Ok(())).is_ok()
    }

    /// Whether it takes work.
    pub fn ready(&self) -> ReadyView {
        let mut reasons = Vec::new();
        if self.shared.is_stopping() {
            reasons.push("the gateway stops".to_owned());
        }
        reasons.extend(self.health().problems);
        ReadyView { is_ready: reasons.is_empty(), reasons }
    }

    /// Reads the configuration again and applies what changed in it, without
    /// touching other links.
    pub fn reload(&self) -> Result<ReloadView, Refusal> {
        self.refuse_while_stopping()?;
        let file = self.shared.ask(|control| Ok(control.config.file.clone()))?;
        let read = read_again(&file).map_err(|error| (error, Vec::new()));
        match read.and_then(|config| self.shared.prepare_all(config)) {
            Ok(ready) => self.shared.ask(move |control| Ok(control.reload(ready))),
            Err((error, missing)) => {
                let why = error.to_string();
                self.shared.tell(move |control| control.reload_refused(&why, missing));
                Err(Refusal::invalid("configuration", error))
            }
        }
    }

    /// Stops the gateway for a new one that takes its place, if no link is busy and all that came is
    /// put away: what a link has under way lives in this process and cannot be handed over byte by byte.
    pub fn make_way(&self) -> Result<(), Refusal> {
        self.refuse_while_stopping()?;
        self.shared.ask(Control::make_way)
    }

    /// Stops the gateway; returns at once. It waits until what was received is put away. Said
    /// again, nothing is waited for: jobs are parked, and what cannot be put away is
    /// [lost](super::Running::lost).
    pub fn stop(&self, how: StopHow) {
        self.shared.tell(move |control| control.stop(how));
    }
}

/// An empty file is being written, or could not be: no link is closed for it.
fn read_again(file: &Path) -> Result<Config, ConfigError> {
    let config = Config::read(file)?;
    let is_empty = config.links.is_empty() && fs::metadata(file).is_ok_and(|of| of.len() == 0);
    if is_empty {
        return Err(ConfigError::Empty { file: file.to_owned() });
    }
    Ok(config)
}

impl Control {
    fn link_views(&self) -> Vec<LinkView> {
        let mut queued = self.shared.parts.jobs.queued();
        let links = self.links.iter();
        let view = |(name, link): (&String, &Link)| {
            let queued = queued.remove(name).unwrap_or(0);
            self.with_drop(show::link(name, link, queued, &self.results))
        };
        links.map(view).collect()
    }

    pub(super) fn link_view(&self, name: &str) -> Result<LinkView, Refusal> {
        let link = self.links.get(name).ok_or_else(|| Refusal::no_link(name))?;
        let queued = self.shared.parts.jobs.queued().remove(name).unwrap_or(0);
        Ok(self.with_drop(show::link(name, link, queued, &self.results)))
    }

    /// Shows the links that look otherwise than when they were last shown.
    pub(super) fn show_links(&mut self) {
        for view in self.link_views() {
            if self.shown.get(&view.name) != Some(&view) {
                self.shown.insert(view.name.clone(), view.clone());
                self.shared.changed(Change::Link(Box::new(view)));
            }
        }
        self.show_running();
        let links = &self.links;
        self.shown.retain(|name, _| links.contains_key(name));
    }

    /// Shows how far the jobs under way are.
    fn show_running(&mut self) {
        self.shown_jobs
            .retain(|name, _| self.links.get(name).is_some_and(|link| link.job.is_some()));
        for (name, link) in &self.links {
            let Some(running) = &link.job else { continue };
            let view = self.job_view(&running.job);
            if self.shown_jobs.get(name) != Some(&view) {
                self.shared.changed(Change::Job(Box::new(view.clone())));
                self.shown_jobs.insert(name.clone(), view);
            }
        }
    }

    /// What somebody should look at.
    fn warnings(&self) -> Vec<String> {
        let links = self.links.iter().filter_map(|(name, link)| {
            let unapplied = link.unapplied.as_ref()?;
            Some(format!("{name}: {}", unapplied.text))
        });
        self.config_trouble.iter().cloned().chain(links).collect()
    }

    fn counts(&self) -> LinkCounts {
        let mut counts = LinkCounts { all: self.links.len() as u32, ..LinkCounts::default() };
        for link in self.links.values() {
            match link.state(&link.status.read()) {
                LinkState::Quarantined => counts.quarantined += 1,
                LinkState::Idle | LinkState::Sending | LinkState::Receiving | LinkState::Paused => {
                    counts.up += 1;
                }
                LinkState::Opening
                | LinkState::Down
                | LinkState::Restarting
                | LinkState::Closing => counts.down += 1,
            }
        }
        counts
    }
}

/// The order, with its kind and fields checked.
pub(super) fn order(link: &str, order: &JobOrder, plugin: &Plugin) -> Result<JobSpec, Refusal> {
    let manifest = plugin.manifest();
    let name = order.kind.as_deref().unwrap_or(SEND);
    let kind = manifest.jobs.iter().find(|kind| kind.name == name).ok_or_else(|| {
        let known = manifest.jobs.iter().map(|kind| kind.name.as_str());
        let hint = crate::config::of_names("it has", name, known);
        let name = name.escape_debug();
        let text = format!("the plug-in {} has no job \"{name}\"; {hint}", manifest.name);
        Refusal::invalid("kind", text)
    })?;
    let fields = order.fields.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    let records = kind.records(fields).map_err(|error| Refusal::invalid("fields", error))?;
    kind.require(&records).map_err(|error| Refusal::invalid("fields", error))?;
    if name == SEND && order.program.is_none() {
        return Err(Refusal::invalid("program", "the job \"send\" sends a program: name one"));
    }
    let fetches = order.program.is_none();
    Ok(JobSpec {
        fields: order.fields.clone().into_iter().collect(),
        program: order.program.clone(),
        priority: order.priority,
        ..JobSpec::new(link, if fetches { Kind::Fetch } else { Kind::Send }, name)
    })
}
