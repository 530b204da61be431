//! The coordinator: events in, changes out. No clock, no I/O.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::event::{AfterCrash, Change, End, Event, Mode, Refused};
use crate::setup::{AxisId, ChannelId, ChannelSet, GroupId, Setup};
use crate::word::Word;

/// What is saved has this shape.
const FORMAT: u8 = 1;

/// Machines that work together: who runs what, who waits for whom, and who has which axis.
///
/// Time is given in milliseconds since any moment; it is only kept, to say since when somebody
/// waits.
///
/// ```
/// use softplug_cell::{Cell, Change, Event, Setup, Word};
///
/// let setup = Setup::new(&["LATHE-1", "LATHE-2"], &["GANTRY"], &[])?;
/// let mut cell = Cell::new(setup);
/// let [one, two] = ["LATHE-1", "LATHE-2"].map(|name| cell.setup().channel(name).unwrap());
/// for channel in [one, two] {
///     cell.handle(0, Event::Begin { channel, program: "O1".into(), by_hand: false })?;
/// }
/// let meet = Word::Wait { mark: 10, with: [one, two].into_iter().collect() };
/// cell.handle(5, Event::Reached { channel: one, word: meet.clone() })?;
/// assert!(!cell.may_be_fed(one));
/// let changes = cell.handle(9, Event::Reached { channel: two, word: meet })?;
/// assert!(matches!(changes[0], Change::Met { mark: 10, .. }));
/// assert!(cell.may_be_fed(one) && cell.may_be_fed(two));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Cell {
    setup: Setup,
    pub(crate) state: State,
}

/// What stands between two events.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub(crate) struct State {
    pub(crate) channels: Vec<Channel>,
    pub(crate) axes: Vec<Axis>,
    modes: Vec<Mode>,
    /// Who waits behind a block, in the order of arrival.
    order: Vec<ChannelId>,
    is_stopped: bool,
    pub(crate) deadlocked: ChannelSet,
    pub(crate) forsaken: ChannelSet,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Channel {
    /// The program that runs.
    program: Option<String>,
    /// The one that is to run next, when it is started.
    pub(crate) loaded: Option<String>,
    /// What it stands for behind a block.
    pub(crate) waits: Option<Waiting>,
    /// Axes that were taken from it: it is interrupted until it has them back.
    pub(crate) deprived: Vec<AxisId>,
    is_paused: bool,
    is_lost: bool,
}

/// What a channel stands for.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub(crate) struct Waiting {
    pub(crate) word: Word,
    since: u64,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Axis {
    pub(crate) owner: Option<ChannelId>,
    pub(crate) queue: VecDeque<ChannelId>,
}

/// A cell as it is saved.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Saved {
    format: u8,
    channels: Vec<String>,
    axes: Vec<String>,
    groups: Vec<String>,
    state: State,
}

/// Why what was saved is not taken.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum RestoreError {
    /// Another version wrote it.
    #[error("the cell was saved in format {0}, and this version reads format {FORMAT}")]
    Format(u8),
    /// Channels, axes or groups are others now, and something was under way.
    #[error(
        "the cell's channels, axes or groups were changed while programs ran or axes were owned"
    )]
    OtherSetup,
    /// It names what there is not, or contradicts itself.
    #[error("what was saved of the cell is damaged")]
    Damaged,
}

/// What a channel does, to be shown.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ChannelView<'a> {
    /// The program that runs.
    pub program: Option<&'a str>,
    /// The one that was loaded into it and waits to be started.
    pub loaded: Option<&'a str>,
    /// What it stands for, and since when.
    pub waits: Option<(&'a Word, u64)>,
    /// Axes that were taken from it.
    pub deprived: &'a [AxisId],
    /// Somebody has it pause.
    pub is_paused: bool,
    /// Its port is gone, or its plug-in in quarantine.
    pub is_lost: bool,
    /// Its group's mode.
    pub mode: Mode,
}

impl Cell {
    /// Nothing runs, all axes are neutral, all groups are in AUTO.
    pub fn new(setup: Setup) -> Self {
        let state = State {
            channels: vec![Channel::default(); setup.channels().count()],
            axes: vec![Axis::default(); setup.axes().count()],
            modes: vec![Mode::Auto; setup.groups().count()],
            order: Vec::new(),
            is_stopped: false,
            deadlocked: ChannelSet::default(),
            forsaken: ChannelSet::default(),
        };
        Self { setup, state }
    }

    /// As [`new`](Self::new), and nothing begins before it is [cleared](Event::Clear): it is not known how
    /// its machines stand.
    pub fn stopped(setup: Setup) -> Self {
        let mut cell = Self::new(setup);
        cell.state.is_stopped = true;
        cell
    }

    /// Its channels, axes and groups.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Takes an event and says what has come of it. `now`: in milliseconds.
    ///
    /// # Errors
    /// The event does not fit; nothing has changed then.
    pub fn handle(&mut self, now: u64, event: Event) -> Result<Vec<Change>, Refused> {
        self.check(&event)?;
        let mut fed: Vec<bool> = self.setup.channels().map(|one| self.may_be_fed(one)).collect();
        if let Event::Reached { channel, .. } = &event {
            // Its feed has come to a stop by itself: it has to be told in any case.
            fed[usize::from(channel.0)] = false;
        }
        let mut changes = Vec::new();
        self.apply(now, event, &mut changes);
        self.settle(&mut changes);
        for (channel, was_fed) in self.setup.channels().zip(fed) {
            // A program that has begun is another one than before.
            let begins = |change: &Change| matches!(change, Change::Began { channel: who, .. } if *who == channel);
            let was_fed = was_fed && !changes.iter().any(begins);
            match (was_fed, self.may_be_fed(channel)) {
                (false, true) => changes.push(Change::Goes { channel }),
                (true, false) if self.runs(channel) => changes.push(Change::Stands { channel }),
                _ => {}
            }
        }
        self.find_stuck(&mut changes);
        Ok(changes)
    }

    /// Whether more of a channel's program may be sent.
    pub fn may_be_fed(&self, channel: ChannelId) -> bool {
        let state = self.of(channel);
        self.is_unhindered(channel)
            && !state.is_paused
            && !state.is_lost
            && !self.state.is_stopped
            && self.mode_of(channel) != Mode::JogInAuto
    }

    /// Whether other channels, its group's mode or a stop of the cell keep a channel from going on with
    /// what it is in the middle of; not whether it waits behind a block.
    pub fn is_held(&self, channel: ChannelId) -> bool {
        let state = self.of(channel);
        let is_hindered = !state.deprived.is_empty()
            || self.state.is_stopped
            || self.mode_of(channel) == Mode::JogInAuto;
        self.runs(channel) && state.waits.is_none() && is_hindered
    }

    /// Whether a channel runs a program.
    pub fn runs(&self, channel: ChannelId) -> bool {
        self.of(channel).program.is_some()
    }

    /// Whether a channel stands behind a block.
    pub fn waits(&self, channel: ChannelId) -> bool {
        self.of(channel).waits.is_some()
    }

    /// Whether nothing begins before the cell is cleared.
    pub fn is_stopped(&self) -> bool {
        self.state.is_stopped
    }

    /// A channel, to be shown.
    pub fn channel(&self, channel: ChannelId) -> ChannelView<'_> {
        let state = self.of(channel);
        ChannelView {
            program: state.program.as_deref(),
            loaded: state.loaded.as_deref(),
            waits: state.waits.as_ref().map(|waiting| (&waiting.word, waiting.since)),
            deprived: &state.deprived,
            is_paused: state.is_paused,
            is_lost: state.is_lost,
            mode: self.mode_of(channel),
        }
    }

    /// Who owns an axis, and who waits for it, the first first.
    pub fn axis(&self, axis: AxisId) -> (Option<ChannelId>, Vec<ChannelId>) {
        let state = &self.state.axes[usize::from(axis.0)];
        (state.owner, state.queue.iter().copied().collect())
    }

    /// A group's mode.
    pub fn mode(&self, group: GroupId) -> Mode {
        self.state.modes[usize::from(group.0)]
    }

    /// As it is, to be written down.
    pub fn save(&self) -> Saved {
        let (channels, axes, groups) = self.names();
        Saved { format: FORMAT, channels, axes, groups, state: self.state.clone() }
    }

    /// A cell as it was saved.
    ///
    /// # Errors
    /// Another version saved it, it is damaged, or the setup is another one and something was
    /// under way. If nothing was, the cell begins anew.
    pub fn restore(setup: Setup, saved: Saved) -> Result<Self, RestoreError> {
        if saved.format != FORMAT {
            return Err(RestoreError::Format(saved.format));
        }
        let fresh = Self::new(setup);
        if fresh.names() != (saved.channels, saved.axes, saved.groups) {
            let is_idle = saved.state.channels.iter().all(|one| one.program.is_none())
                && saved.state.axes.iter().all(|axis| axis.owner.is_none());
            return if is_idle { Ok(fresh) } else { Err(RestoreError::OtherSetup) };
        }
        let cell = Self { state: saved.state, ..fresh };
        if cell.is_sound() { Ok(cell) } else { Err(RestoreError::Damaged) }
    }

    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        let setup = &self.setup;
        (
            setup.channels().map(|one| setup.channel_name(one).to_owned()).collect(),
            setup.axes().map(|axis| setup.axis_name(axis).to_owned()).collect(),
            setup.groups().map(|(_, name, set)| format!("{name}: {}", setup.names(set))).collect(),
        )
    }

    /// What holds between any two events.
    fn is_sound(&self) -> bool {
        let (channels, axes) = (self.setup.channels().count(), self.setup.axes().count());
        let state = &self.state;
        let is_channel = |one: &ChannelId| usize::from(one.0) < channels;
        let sizes = state.channels.len() == channels
            && state.axes.len() == axes
            && state.modes.len() == self.setup.groups().count();
        if !sizes || !state.order.iter().all(is_channel) {
            return false;
        }
        let words = state.channels.iter().filter_map(|one| one.waits.as_ref());
        let words = words.map(|waiting| waiting.word.clone()).all(|word| self.knows(&word).is_ok());
        let axes_are_known = state
            .axes
            .iter()
            .all(|axis| axis.owner.iter().all(is_channel) && axis.queue.iter().all(is_channel));
        if !words || !axes_are_known {
            return false;
        }
        self.setup.channels().all(|one| {
            let is_in_order = state.order.iter().filter(|other| **other == one).count();
            let in_queues = self.setup.axes().filter(|axis| self.axis(*axis).1.contains(&one));
            let wanted = self.setup.axes().filter(|axis| self.wants(one, *axis));
            is_in_order == usize::from(self.waits(one))
                && (self.runs(one) || (!self.waits(one) && self.of(one).deprived.is_empty()))
                && in_queues.eq(wanted)
        })
    }

    /// Whether a channel is in an axis' queue, by what it waits for.
    fn wants(&self, channel: ChannelId, axis: AxisId) -> bool {
        let state = self.of(channel);
        let asked = state.waits.as_ref().map(|waiting| &waiting.word);
        state.deprived.contains(&axis)
            || matches!(asked, Some(Word::Get { axis: asked, .. }) if *asked == axis)
    }

    /// Whether an event fits.
    fn check(&self, event: &Event) -> Result<(), Refused> {
        match event {
            Event::Begin { channel, by_hand, .. } => {
                self.check_channel(*channel)?;
                self.check_begin(*channel, *by_hand)
            }
            Event::Reached { channel, word } => {
                self.check_runs(*channel)?;
                self.knows(word)?;
                if !self.of(*channel).deprived.is_empty() {
                    return Err(Refused::Interrupted(self.name(*channel)));
                }
                if self.waits(*channel) {
                    return Err(Refused::Waits(self.name(*channel)));
                }
                Ok(())
            }
            Event::Ended { channel, .. } => self.check_runs(*channel),
            Event::Unloaded { channel }
            | Event::Paused { channel, .. }
            | Event::Lost { channel, .. } => self.check_channel(*channel),
            Event::Mode { group, mode } => self.check_mode(*group, *mode),
            Event::Force { axis, channel } => {
                self.check_axis(*axis)?;
                self.check_channel(*channel)?;
                if self.runs(*channel) {
                    return Ok(());
                }
                let axis = self.setup.axis_name(*axis).to_owned();
                Err(Refused::NoUse { axis, channel: self.name(*channel) })
            }
            Event::Free { axis } => self.check_axis(*axis),
            Event::Restarted { cut_off, .. } => {
                cut_off.iter().try_for_each(|one| self.check_channel(one))
            }
            Event::Clear => Ok(()),
        }
    }

    fn check_begin(&self, channel: ChannelId, by_hand: bool) -> Result<(), Refused> {
        if self.state.is_stopped {
            return Err(Refused::Stopped);
        }
        if let Some(program) = &self.of(channel).program {
            let program = program.escape_debug().to_string();
            return Err(Refused::Runs { channel: self.name(channel), program });
        }
        let group = self.setup.group_of(channel);
        let mode = self.mode(group);
        let hint = match (mode, by_hand) {
            (Mode::Auto | Mode::JogInAuto, _) | (Mode::Mda, true) => return Ok(()),
            (Mode::Mda, false) => "the queue waits until it is in AUTO",
            (Mode::Jog, _) => "choose AUTO to begin a program",
        };
        let group = self.setup.group_name(group).to_owned();
        Err(Refused::Mode { group, mode: mode.name(), hint })
    }

    fn check_mode(&self, group: GroupId, mode: Mode) -> Result<(), Refused> {
        let Some((.., set)) = self.setup.groups().find(|(id, ..)| *id == group) else {
            return Err(Refused::Unknown(format!("group {}", group.0 + 1)));
        };
        // JOG in AUTO counts as AUTO: programs stay where they are.
        let is_auto = |mode: Mode| matches!(mode, Mode::Auto | Mode::JogInAuto);
        let running: ChannelSet = set.iter().filter(|one| self.runs(*one)).collect();
        let stays = mode == self.mode(group) || (is_auto(mode) && is_auto(self.mode(group)));
        if stays || running.is_empty() {
            return Ok(());
        }
        let group = self.setup.group_name(group).to_owned();
        Err(Refused::GroupRuns { group, running: self.setup.names(running) })
    }

    fn check_runs(&self, channel: ChannelId) -> Result<(), Refused> {
        self.check_channel(channel)?;
        if self.runs(channel) { Ok(()) } else { Err(Refused::Idle(self.name(channel))) }
    }

    fn check_channel(&self, channel: ChannelId) -> Result<(), Refused> {
        let is_there = usize::from(channel.0) < self.state.channels.len();
        if is_there { Ok(()) } else { Err(Refused::Unknown(channel.to_string())) }
    }

    fn check_axis(&self, axis: AxisId) -> Result<(), Refused> {
        let is_there = usize::from(axis.0) < self.state.axes.len();
        if is_there { Ok(()) } else { Err(Refused::Unknown(format!("axis {}", axis.0 + 1))) }
    }

    fn knows(&self, word: &Word) -> Result<(), Refused> {
        match word {
            Word::Wait { with, .. } => with.iter().try_for_each(|one| self.check_channel(one)),
            Word::Load { channel, .. } | Word::Start { channel } => self.check_channel(*channel),
            Word::Get { axis, .. } | Word::Release { axis } => self.check_axis(*axis),
        }
    }

    fn apply(&mut self, now: u64, event: Event, changes: &mut Vec<Change>) {
        match event {
            Event::Begin { channel, program, .. } => self.begin(channel, program, None, changes),
            Event::Reached { channel, word } => self.reached(now, channel, word, changes),
            Event::Ended { channel, end } => self.end(channel, end, changes),
            Event::Unloaded { channel } => {
                if self.of_mut(channel).loaded.take().is_some() {
                    changes.push(Change::Unloaded { channel });
                }
            }
            Event::Paused { channel, is } => self.of_mut(channel).is_paused = is,
            Event::Lost { channel, is } => self.of_mut(channel).is_lost = is,
            Event::Mode { group, mode } => {
                let known = &mut self.state.modes[usize::from(group.0)];
                if *known != mode {
                    *known = mode;
                    changes.push(Change::Mode { group, mode });
                }
            }
            Event::Force { axis, channel } => self.force(axis, channel, changes),
            Event::Free { axis } => self.free(axis, changes),
            Event::Restarted { cut_off, policy } => self.restarted(cut_off, policy, changes),
            Event::Clear => {
                if std::mem::take(&mut self.state.is_stopped) {
                    changes.push(Change::Cleared);
                }
            }
        }
    }

    fn begin(
        &mut self,
        channel: ChannelId,
        program: String,
        by: Option<ChannelId>,
        changes: &mut Vec<Change>,
    ) {
        changes.push(Change::Began { channel, program: program.clone(), by });
        let state = self.of_mut(channel);
        state.program = Some(program);
        // A pause is a job's, and the next one has none.
        state.is_paused = false;
    }

    fn reached(&mut self, now: u64, channel: ChannelId, word: Word, changes: &mut Vec<Change>) {
        let word = match word {
            Word::Wait { mark, mut with } => {
                with.insert(channel);
                Word::Wait { mark, with }
            }
            // What a program that ended badly kept is somebody's to give.
            Word::Get { axis, forced: true } if self.is_in_use(axis) => {
                return self.force(axis, channel, changes);
            }
            Word::Get { axis, .. } => {
                let state = &mut self.state.axes[usize::from(axis.0)];
                if state.owner == Some(channel) {
                    return;
                }
                if state.owner.is_none() {
                    state.owner = Some(channel);
                    return changes.push(Change::Owned { axis, channel, from: None });
                }
                let behind = state.queue.len();
                state.queue.push_back(channel);
                changes.push(Change::Queued { axis, channel, behind });
                Word::Get { axis, forced: false }
            }
            Word::Release { axis } => return self.release(axis, channel, changes),
            Word::Load { .. } | Word::Start { .. } => word,
        };
        let waits = Change::Waits { channel, word: word.clone() };
        self.of_mut(channel).waits = Some(Waiting { word, since: now });
        self.state.order.push(channel);
        self.settle(changes);
        if self.waits(channel) {
            changes.push(waits);
        }
    }

    fn end(&mut self, channel: ChannelId, end: End, changes: &mut Vec<Change>) {
        changes.push(Change::Ended { channel, end });
        let state = self.of_mut(channel);
        state.program = None;
        state.waits = None;
        state.deprived.clear();
        state.is_paused = false;
        self.state.order.retain(|other| *other != channel);
        for at in self.setup.axes() {
            let axis = &mut self.state.axes[usize::from(at.0)];
            axis.queue.retain(|other| *other != channel);
            if end == End::Done && axis.owner == Some(channel) {
                axis.owner = None;
                changes.push(Change::Released { axis: at, by: Some(channel) });
            }
        }
    }

    /// Gives an axis to a channel, whoever has it.
    fn force(&mut self, axis: AxisId, channel: ChannelId, changes: &mut Vec<Change>) {
        let state = &mut self.state.axes[usize::from(axis.0)];
        if state.owner == Some(channel) {
            return;
        }
        state.queue.retain(|other| *other != channel);
        let before = state.owner.replace(channel);
        let from = before.filter(|owner| self.runs(*owner));
        changes.push(Change::Owned { axis, channel, from });
        self.has_it_now(axis, channel);
        let Some(from) = from else { return };
        // It had the axis before any of those asked who wait.
        self.state.axes[usize::from(axis.0)].queue.push_front(from);
        self.of_mut(from).deprived.push(axis);
    }

    /// Whether an axis is neutral, or owned by a program that runs.
    fn is_in_use(&self, axis: AxisId) -> bool {
        self.state.axes[usize::from(axis.0)].owner.is_none_or(|owner| self.runs(owner))
    }

    /// A channel that may have waited for an axis has it.
    fn has_it_now(&mut self, axis: AxisId, channel: ChannelId) {
        let state = self.of_mut(channel);
        state.deprived.retain(|other| *other != axis);
        let asked = state.waits.as_ref().map(|waiting| &waiting.word);
        if matches!(asked, Some(Word::Get { axis: asked, .. }) if *asked == axis) {
            self.fulfilled(channel);
        }
    }

    fn release(&mut self, axis: AxisId, channel: ChannelId, changes: &mut Vec<Change>) {
        let state = &mut self.state.axes[usize::from(axis.0)];
        if state.owner == Some(channel) {
            state.owner = None;
            changes.push(Change::Released { axis, by: Some(channel) });
        } else {
            changes.push(Change::NotOwned { axis, channel });
        }
    }

    /// Makes an axis neutral by somebody's hand. Who had it and runs has to get it back.
    fn free(&mut self, axis: AxisId, changes: &mut Vec<Change>) {
        let Some(owner) = self.state.axes[usize::from(axis.0)].owner.take() else { return };
        changes.push(Change::Released { axis, by: None });
        if self.runs(owner) {
            self.state.axes[usize::from(axis.0)].queue.push_back(owner);
            self.of_mut(owner).deprived.push(axis);
        }
    }

    fn restarted(&mut self, cut_off: ChannelSet, policy: AfterCrash, changes: &mut Vec<Change>) {
        let running: ChannelSet = self.setup.channels().filter(|one| self.runs(*one)).collect();
        let ending: Vec<ChannelId> = match policy {
            AfterCrash::Stop => running.iter().collect(),
            AfterCrash::Resume => running.iter().filter(|one| cut_off.has(*one)).collect(),
        };
        for channel in ending {
            self.end(channel, End::Failed, changes);
        }
        if policy == AfterCrash::Stop && !running.is_empty() && !self.state.is_stopped {
            self.state.is_stopped = true;
            changes.push(Change::Stopped);
        }
    }

    /// Carries out all that has become possible, who came first first.
    fn settle(&mut self, changes: &mut Vec<Change>) {
        while self.settle_one(changes) {}
    }

    fn settle_one(&mut self, changes: &mut Vec<Change>) -> bool {
        for at in self.setup.axes() {
            let axis = &mut self.state.axes[usize::from(at.0)];
            if axis.owner.is_none()
                && let Some(channel) = axis.queue.pop_front()
            {
                axis.owner = Some(channel);
                changes.push(Change::Owned { axis: at, channel, from: None });
                self.has_it_now(at, channel);
                return true;
            }
        }
        for by in self.state.order.clone() {
            let Some(word) = self.of(by).waits.as_ref().map(|waiting| waiting.word.clone()) else {
                continue;
            };
            match word {
                Word::Wait { mark, with } if self.are_met(mark, with) => {
                    changes.push(Change::Met { mark, with });
                    for channel in with.iter() {
                        self.fulfilled(channel);
                    }
                    return true;
                }
                Word::Load { channel, program } if self.of(channel).loaded.is_none() => {
                    changes.push(Change::Loaded { channel, program: program.clone(), by });
                    self.of_mut(channel).loaded = Some(program);
                    self.fulfilled(by);
                    return true;
                }
                Word::Start { channel } if self.check_begin(channel, false).is_ok() => {
                    let Some(program) = self.of_mut(channel).loaded.take() else { continue };
                    self.fulfilled(by);
                    self.begin(channel, program, Some(by), changes);
                    return true;
                }
                _ => {}
            }
        }
        false
    }

    fn are_met(&self, mark: u32, with: ChannelSet) -> bool {
        with.iter().all(|one| self.is_at(one, mark, with))
    }

    /// Whether a channel stands at this meeting.
    pub(crate) fn is_at(&self, channel: ChannelId, mark: u32, with: ChannelSet) -> bool {
        let word = self.of(channel).waits.as_ref().map(|waiting| &waiting.word);
        matches!(word, Some(Word::Wait { mark: at, with: who }) if *at == mark && *who == with)
    }

    fn fulfilled(&mut self, channel: ChannelId) {
        self.of_mut(channel).waits = None;
        self.state.order.retain(|other| *other != channel);
    }

    /// Whether nothing that other channels do keeps it.
    pub(crate) fn is_unhindered(&self, channel: ChannelId) -> bool {
        let state = self.of(channel);
        state.program.is_some() && state.waits.is_none() && state.deprived.is_empty()
    }

    pub(crate) fn of(&self, channel: ChannelId) -> &Channel {
        &self.state.channels[usize::from(channel.0)]
    }

    fn of_mut(&mut self, channel: ChannelId) -> &mut Channel {
        &mut self.state.channels[usize::from(channel.0)]
    }

    fn mode_of(&self, channel: ChannelId) -> Mode {
        self.mode(self.setup.group_of(channel))
    }

    fn name(&self, channel: ChannelId) -> String {
        self.setup.channel_name(channel).to_owned()
    }
}
