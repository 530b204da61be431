//! The coordinator: events in, changes out. No clock, no I/O.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::event::{AfterCrash, Change, End, Event, Mode, Refused};
use crate::setup::{AxisId, ChannelId, ChannelSet, GroupId, Setup};
use crate::word::Word;

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
    pub(crate) setup: Setup,
    pub(crate) state: State,
}

/// What stands between two events.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub(crate) struct State {
    pub(crate) channels: Vec<Channel>,
    pub(crate) axes: Vec<Axis>,
    pub(crate) modes: Vec<Mode>,
    /// Who waits behind a block, in the order of arrival.
    pub(crate) order: Vec<ChannelId>,
    pub(crate) is_stopped: bool,
    pub(crate) deadlocked: ChannelSet,
    pub(crate) forsaken: ChannelSet,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Channel {
    /// The program that runs.
    pub(crate) program: Option<String>,
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

    pub(crate) fn name(&self, channel: ChannelId) -> String {
        self.setup.channel_name(channel).to_owned()
    }
}
