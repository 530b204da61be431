//! The coordinator against a slow and obvious model of what `docs/gateway/cells.md` promises.
//!
//! The model has no queues and no graph: it keeps who stands at which word in the order in which
//! they came, and looks through all of it, again and again, until nobody can go on any more.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use proptest::prelude::*;
use proptest::test_runner::TestCaseResult;
use softplug_cell::{
    AfterCrash, AxisId, Cell, Change, ChannelId, End, Event, GroupId, Mode, Saved, Setup, Word,
};

const CHANNELS: u8 = 32;
const GROUPS: u8 = 8;
const AXES: u8 = 6;
const MARKS: u32 = 5;

/// All that is known of a cell.
#[derive(Clone, Default)]
struct Model {
    /// Who runs which program.
    runs: BTreeMap<ChannelId, String>,
    /// What is loaded, and where.
    loaded: BTreeMap<ChannelId, String>,
    owners: BTreeMap<AxisId, ChannelId>,
    /// Who stands at which word, the first who came first.
    stands: Vec<(ChannelId, Word)>,
    /// Who is to have which axis, by the number that it drew: the smallest is the next.
    queues: BTreeMap<(AxisId, i64), ChannelId>,
    /// From whom which axis was taken.
    deprived: BTreeSet<(AxisId, ChannelId)>,
    paused: BTreeSet<ChannelId>,
    lost: BTreeSet<ChannelId>,
    /// Modes that somebody chose; AUTO otherwise.
    modes: BTreeMap<GroupId, Mode>,
    is_stopped: bool,
}

/// Groups are four channels each, in their order.
fn group_of(channel: ChannelId) -> GroupId {
    GroupId(channel.0 / (CHANNELS / GROUPS))
}

fn channels() -> impl Iterator<Item = ChannelId> {
    (0..CHANNELS).map(ChannelId)
}

fn axes() -> impl Iterator<Item = AxisId> {
    (0..AXES).map(AxisId)
}

/// A word as `by` says it: whoever says it belongs to the meeting.
fn as_said(by: ChannelId, word: &Word) -> Word {
    match word {
        Word::Wait { mark, with } => {
            Word::Wait { mark: *mark, with: with.iter().chain([by]).collect() }
        }
        other => other.clone(),
    }
}

impl Model {
    fn mode(&self, group: GroupId) -> Mode {
        self.modes.get(&group).copied().unwrap_or_default()
    }

    fn word_of(&self, channel: ChannelId) -> Option<&Word> {
        self.stands.iter().find(|(who, _)| *who == channel).map(|(_, word)| word)
    }

    fn is_deprived(&self, channel: ChannelId) -> bool {
        self.deprived.iter().any(|(_, who)| *who == channel)
    }

    fn may_be_fed(&self, channel: ChannelId) -> bool {
        self.runs.contains_key(&channel)
            && self.word_of(channel).is_none()
            && !self.is_deprived(channel)
            && !self.paused.contains(&channel)
            && !self.lost.contains(&channel)
            && self.mode(group_of(channel)) != Mode::JogInAuto
    }

    fn queue(&self, axis: AxisId) -> Vec<ChannelId> {
        self.queues.iter().filter(|((of, _), _)| *of == axis).map(|(_, who)| *who).collect()
    }

    /// Puts somebody into the queue of an axis; who is there stays where it is.
    fn draw(&mut self, axis: AxisId, who: ChannelId, is_first: bool) {
        if self.queue(axis).contains(&who) {
            return;
        }
        let numbers = self.queues.keys().map(|(_, number)| *number);
        let number =
            if is_first { numbers.min().unwrap_or(0) - 1 } else { numbers.max().unwrap_or(0) + 1 };
        self.queues.insert((axis, number), who);
    }

    /// Why an event does not fit; empty if it does.
    fn against(&self, event: &Event) -> Vec<&'static str> {
        let mut against = Vec::new();
        let mut unless = |is: bool, why| {
            if !is {
                against.push(why);
            }
        };
        let knows = |channel: &ChannelId| channel.0 < CHANNELS;
        let has = |axis: &AxisId| axis.0 < AXES;
        let runs = |channel: &ChannelId| self.runs.contains_key(channel);
        match event {
            Event::Begin { channel, by_hand, .. } => {
                unless(knows(channel), "Unknown");
                unless(!self.is_stopped, "Stopped");
                unless(!runs(channel), "Runs");
                let begins = match self.mode(group_of(*channel)) {
                    Mode::Auto => true,
                    Mode::Mda => *by_hand,
                    Mode::Jog | Mode::JogInAuto => false,
                };
                unless(begins, "Mode");
            }
            Event::Reached { channel, word } => {
                unless(knows(channel), "Unknown");
                let is_known = match word {
                    Word::Wait { with, .. } => with.iter().all(|one| knows(&one)),
                    Word::Load { channel, .. } | Word::Start { channel } => knows(channel),
                    Word::Get { axis, .. } | Word::Release { axis } => has(axis),
                };
                unless(is_known, "Unknown");
                unless(runs(channel), "Idle");
                unless(self.word_of(*channel).is_none(), "Waits");
                unless(!self.is_deprived(*channel), "Interrupted");
            }
            Event::Ended { channel, .. } => {
                unless(knows(channel), "Unknown");
                unless(runs(channel), "Idle");
            }
            Event::Unloaded { channel }
            | Event::Paused { channel, .. }
            | Event::Lost { channel, .. } => unless(knows(channel), "Unknown"),
            Event::Mode { group, mode } => {
                unless(group.0 < GROUPS, "Unknown");
                let jogs = [Mode::Auto, Mode::JogInAuto];
                let is_free = !self.runs.keys().any(|one| group_of(*one) == *group);
                let between = jogs.contains(mode) && jogs.contains(&self.mode(*group));
                let is_other = *mode != self.mode(*group);
                unless(is_free || between || !is_other, "GroupRuns");
            }
            Event::Force { axis, channel } => {
                unless(has(axis) && knows(channel), "Unknown");
                unless(runs(channel), "NoUse");
            }
            Event::Free { axis } => unless(has(axis), "Unknown"),
            Event::Restarted { cut_off, .. } => {
                unless(cut_off.iter().all(|one| knows(&one)), "Unknown");
            }
            Event::Clear => {}
        }
        against
    }

    /// What an event that fits does.
    fn take(&mut self, event: &Event) {
        match event.clone() {
            Event::Begin { channel, program, .. } => self.begin(channel, program),
            Event::Reached { channel, word } => {
                let word = as_said(channel, &word);
                let word = match word {
                    Word::Get { axis, forced } => {
                        // What a program that ended badly kept is not taken.
                        let owner = self.owners.get(&axis);
                        let is_kept = owner.is_some_and(|owner| !self.runs.contains_key(owner));
                        self.draw(axis, channel, false);
                        Word::Get { axis, forced: forced && !is_kept }
                    }
                    word => word,
                };
                self.stands.push((channel, word));
            }
            Event::Ended { channel, end } => self.end(channel, end),
            Event::Unloaded { channel } => {
                self.loaded.remove(&channel);
            }
            Event::Paused { channel, is } => put(&mut self.paused, channel, is),
            Event::Lost { channel, is } => put(&mut self.lost, channel, is),
            Event::Mode { group, mode } => {
                self.modes.insert(group, mode);
            }
            Event::Force { axis, channel } => self.give(axis, channel),
            Event::Free { axis } => {
                if let Some(owner) = self.owners.remove(&axis) {
                    self.settle();
                    if self.runs.contains_key(&owner) {
                        self.deprived.insert((axis, owner));
                        self.draw(axis, owner, false);
                    }
                }
            }
            Event::Restarted { cut_off, policy } => {
                let ends = |one: &ChannelId| policy == AfterCrash::Stop || cut_off.has(*one);
                let ended: Vec<ChannelId> = self.runs.keys().copied().filter(ends).collect();
                self.is_stopped |= policy == AfterCrash::Stop && !ended.is_empty();
                for channel in ended {
                    self.end(channel, End::Failed);
                }
            }
            Event::Clear => self.is_stopped = false,
        }
        self.settle();
    }

    fn begin(&mut self, channel: ChannelId, program: String) {
        self.paused.remove(&channel);
        self.runs.insert(channel, program);
    }

    fn end(&mut self, channel: ChannelId, end: End) {
        self.runs.remove(&channel);
        self.paused.remove(&channel);
        self.stands.retain(|(who, _)| *who != channel);
        self.deprived.retain(|(_, who)| *who != channel);
        self.queues.retain(|_, who| *who != channel);
        if end == End::Done {
            self.owners.retain(|_, owner| *owner != channel);
        }
    }

    /// An axis changes hands: a program that had it is interrupted.
    fn give(&mut self, axis: AxisId, to: ChannelId) {
        let before = self.owners.insert(axis, to);
        if let Some(owner) = before.filter(|one| *one != to && self.runs.contains_key(one)) {
            self.deprived.insert((axis, owner));
            self.draw(axis, owner, true);
        }
        self.deprived.remove(&(axis, to));
        self.queues.retain(|(of, _), who| (*of, *who) != (axis, to));
        self.stands.retain(|(who, word)| *who != to || !word_wants(word, axis));
    }

    /// Lets everybody go on who can, one after the other, until nobody can.
    fn settle(&mut self) {
        while self.step() {}
    }

    fn step(&mut self) -> bool {
        for axis in axes() {
            let first = self.queue(axis).first().copied();
            if let (None, Some(first)) = (self.owners.get(&axis), first) {
                self.give(axis, first);
                return true;
            }
        }
        for (who, word) in self.stands.clone() {
            let goes = match &word {
                Word::Wait { with, .. } => {
                    let are_there = with.iter().all(|one| self.word_of(one) == Some(&word));
                    if are_there {
                        self.stands.retain(|(one, _)| !with.has(*one));
                        return true;
                    }
                    false
                }
                Word::Load { channel, program } => {
                    let has_place = !self.loaded.contains_key(channel);
                    if has_place {
                        self.loaded.insert(*channel, program.clone());
                    }
                    has_place
                }
                Word::Start { channel } => self.start(*channel),
                Word::Get { axis, forced } => {
                    let owner = self.owners.get(axis);
                    let gets = owner == Some(&who) || *forced;
                    if gets {
                        self.give(*axis, who);
                    }
                    gets
                }
                Word::Release { axis } => {
                    if self.owners.get(axis) == Some(&who) {
                        self.owners.remove(axis);
                    }
                    true
                }
            };
            if goes {
                self.stands.retain(|(one, _)| *one != who);
                return true;
            }
        }
        false
    }

    /// Starts what is loaded in a channel, if it is free and in AUTO.
    fn start(&mut self, channel: ChannelId) -> bool {
        let is_auto = matches!(self.mode(group_of(channel)), Mode::Auto | Mode::JogInAuto);
        if !is_auto || self.runs.contains_key(&channel) {
            return false;
        }
        let Some(program) = self.loaded.remove(&channel) else { return false };
        self.begin(channel, program);
        true
    }
}

fn word_wants(word: &Word, axis: AxisId) -> bool {
    matches!(word, Word::Get { axis: of, .. } if *of == axis)
}

fn put<T: Ord>(set: &mut BTreeSet<T>, one: T, is: bool) {
    if is {
        set.insert(one);
    } else {
        set.remove(&one);
    }
}

/// Everything that can be asked of a cell is as the model has it.
fn same(cell: &Cell, model: &Model) -> TestCaseResult {
    for channel in channels() {
        let view = cell.channel(channel);
        let runs = model.runs.get(&channel).map(String::as_str);
        prop_assert_eq!(view.program, runs, "runs in {}", channel);
        prop_assert_eq!(cell.runs(channel), runs.is_some(), "runs {}", channel);
        let loaded = model.loaded.get(&channel).map(String::as_str);
        prop_assert_eq!(view.loaded, loaded, "loaded in {}", channel);
        let word = view.waits.map(|(word, _)| as_said(channel, word));
        prop_assert_eq!(word.as_ref(), model.word_of(channel), "word of {}", channel);
        prop_assert_eq!(cell.waits(channel), word.is_some(), "waits {}", channel);
        let lacks: BTreeSet<AxisId> = view.deprived.iter().copied().collect();
        let lost = model.deprived.iter().filter(|(_, who)| *who == channel);
        prop_assert_eq!(lacks, lost.map(|(axis, _)| *axis).collect(), "deprived {}", channel);
        prop_assert_eq!(view.is_paused, model.paused.contains(&channel), "paused {}", channel);
        prop_assert_eq!(view.is_lost, model.lost.contains(&channel), "lost {}", channel);
        prop_assert_eq!(view.mode, model.mode(group_of(channel)), "mode of {}", channel);
        prop_assert_eq!(cell.may_be_fed(channel), model.may_be_fed(channel), "feeds {}", channel);
    }
    for axis in axes() {
        let (owner, queue) = cell.axis(axis);
        prop_assert_eq!(owner, model.owners.get(&axis).copied(), "owner of {:?}", axis);
        prop_assert_eq!(queue, model.queue(axis), "queue of {:?}", axis);
    }
    for group in (0..GROUPS).map(GroupId) {
        prop_assert_eq!(cell.mode(group), model.mode(group), "mode of {:?}", group);
    }
    prop_assert_eq!(cell.is_stopped(), model.is_stopped, "stopped");
    Ok(())
}

/// One event at both, and what must be true behind it.
fn one_step(cell: &mut Cell, model: &mut Model, now: u64, event: &Event) -> TestCaseResult {
    let before = cell.clone();
    let [fed_before, deadlocked, forsaken] = told(cell);
    let against = model.against(event);
    match cell.handle(now, event.clone()) {
        Err(refused) => {
            let why = format!("{refused:?}");
            prop_assert!(against.iter().any(|one| why.starts_with(one)), "{why}, not {against:?}");
            prop_assert_eq!(&before, &*cell, "refused, and something changed");
        }
        Ok(changes) => {
            prop_assert!(against.is_empty(), "taken, expected {against:?}");
            model.take(event);
            let before = [fed_before, deadlocked.clone(), forsaken.clone()];
            prop_assert_eq!(heard(before, &changes), told(cell), "heard {:?}", changes);
        }
    }
    same(cell, model)?;
    let stuck: BTreeSet<ChannelId> = deadlocked.union(&forsaken).copied().collect();
    let [fed, deadlocked, forsaken] = told(cell);
    let stuck_now: BTreeSet<ChannelId> = deadlocked.union(&forsaken).copied().collect();
    let is_helped = !matches!(event, Event::Reached { .. } | Event::Lost { .. });
    prop_assert!(is_helped || stuck_now.is_superset(&stuck), "{stuck:?} go on by themselves");
    prop_assert!(deadlocked.is_disjoint(&forsaken) && fed.is_disjoint(&stuck_now));
    let named: BTreeSet<ChannelId> = cell.stuck().iter().map(|one| one.channel).collect();
    prop_assert_eq!(named, stuck_now, "those who are stuck");
    for channel in fed {
        prop_assert!(cell.waits_for(channel).is_empty(), "{channel} is fed and waits for somebody");
    }
    Ok(())
}

/// Who may be fed, who is told deadlocked, and who forsaken.
fn told(cell: &Cell) -> [BTreeSet<ChannelId>; 3] {
    let fed = channels().filter(|one| cell.may_be_fed(*one));
    [fed.collect(), cell.deadlocked().iter().collect(), cell.forsaken().iter().collect()]
}

/// Whoever only hears what has come of an event knows the same.
fn heard(mut told: [BTreeSet<ChannelId>; 3], changes: &[Change]) -> [BTreeSet<ChannelId>; 3] {
    for change in changes {
        let [fed, deadlocked, forsaken] = &mut told;
        match change {
            Change::Goes { channel } => put(fed, *channel, true),
            Change::Stands { channel } | Change::Waits { channel, .. } => put(fed, *channel, false),
            Change::Ended { channel, .. } => {
                for all in &mut told {
                    put(all, *channel, false);
                }
            }
            Change::Deadlock { channels: set }
            | Change::NobodyComes { channels: set }
            | Change::Free { channels: set } => {
                deadlocked.retain(|one| !set.has(*one));
                forsaken.retain(|one| !set.has(*one));
                match change {
                    Change::Deadlock { .. } => deadlocked.extend(set.iter()),
                    Change::NobodyComes { .. } => forsaken.extend(set.iter()),
                    _ => {}
                }
            }
            _ => {}
        }
    }
    told
}

/// What is to happen next: what kind, and numbers that choose who and what.
type Dice = (u8, usize, usize, usize);

fn pick<T: Clone>(from: &[T], dice: usize) -> Option<T> {
    from.get(dice.checked_rem(from.len())?).cloned()
}

/// An event that mostly fits what the model says: otherwise most would be refused.
fn event(model: &Model, (kind, a, b, c): Dice) -> Event {
    let any = ChannelId((a % usize::from(CHANNELS)) as u8);
    let other = ChannelId((b % if c & 1 == 0 { 6 } else { usize::from(CHANNELS) }) as u8);
    let axis = AxisId((b % usize::from(AXES)) as u8);
    let rare = c % 16 == 15;
    let choose = |fits: &dyn Fn(ChannelId) -> bool| {
        let fitting: Vec<ChannelId> = channels().filter(|one| rare || fits(*one)).collect();
        pick(&fitting, a).unwrap_or(any)
    };
    let runs = |one: ChannelId| model.runs.contains_key(&one);
    let begin = || {
        let begins = |one: ChannelId| {
            let jogs = [Mode::Mda, Mode::Jog].contains(&model.mode(group_of(one)));
            !runs(one) && !jogs && !model.lost.contains(&one) && !model.loaded.contains_key(&one)
        };
        let program = format!("O{}", b % 4);
        Event::Begin { channel: choose(&begins), program, by_hand: c & 2 == 0 }
    };
    let goes: Vec<ChannelId> = channels().filter(|one| model.may_be_fed(*one)).collect();
    let kind = match kind {
        // Programs begin, or somebody helps, where few go on.
        14..90 if goes.len() < 6 && !rare => match c / 2 % 5 {
            _ if model.is_stopped => 118,
            0..3 if model.runs.len() < usize::from(CHANNELS) => 0,
            3 => 112,
            _ => 78,
        },
        kind => kind,
    };
    let channel = choose(&|one| model.may_be_fed(one));
    let reached = |word| Event::Reached { channel, word };
    match kind {
        0..14 => begin(),
        14..30 => {
            // Somebody comes to a meeting where others are.
            let mut comes = Vec::new();
            for (_, word) in &model.stands {
                if let Word::Wait { with, .. } = word {
                    let free = |one: &ChannelId| runs(*one) && model.word_of(*one).is_none();
                    comes.extend(with.iter().filter(free).map(|one| (one, word.clone())));
                }
            }
            let (channel, word) = pick(&comes, a).unwrap_or((channel, Word::Release { axis }));
            Event::Reached { channel, word }
        }
        30..36 => {
            let fit: Vec<ChannelId> = if rare { channels().collect() } else { goes };
            let others = (0..=c / 16 % 3).filter_map(|at| pick(&fit, b / 32_usize.pow(at as u32)));
            reached(Word::Wait { mark: c as u32 / 64 % MARKS, with: others.collect() })
        }
        36..52 => reached(Word::Get { axis, forced: c % 4 == 0 }),
        52..58 => {
            let owner = model.owners.get(&axis).copied().filter(|one| !rare && runs(*one));
            let channel = owner.unwrap_or(channel);
            Event::Reached { channel, word: Word::Release { axis } }
        }
        58..68 => reached(Word::Load { channel: other, program: format!("P{}", c % 7) }),
        68..78 => {
            let loaded: Vec<ChannelId> = model.loaded.keys().copied().collect();
            let channel = if c & 6 == 0 { other } else { pick(&loaded, b).unwrap_or(other) };
            reached(Word::Start { channel })
        }
        78..90 => {
            let end = if c % 3 == 0 { End::Failed } else { End::Done };
            let starts =
                |one| model.stands.iter().any(|(_, word)| *word == Word::Start { channel: one });
            let channel = choose(&|one| runs(one) && (c / 4 % 4 == 0 || starts(one)));
            Event::Ended { channel, end }
        }
        90..92 => Event::Unloaded { channel: other },
        92..95 => Event::Paused { channel: choose(&runs), is: c & 2 == 0 },
        95..97 => Event::Paused { channel: choose(&|one| model.paused.contains(&one)), is: false },
        97 => Event::Lost { channel: any, is: true },
        98..102 => Event::Lost { channel: choose(&|one| model.lost.contains(&one)), is: false },
        102..109 => {
            let modes = [Mode::Auto, Mode::Auto, Mode::Auto, Mode::JogInAuto, Mode::Mda, Mode::Jog];
            let group = GroupId((b % usize::from(GROUPS)) as u8);
            Event::Mode { group, mode: modes[c % modes.len()] }
        }
        109..112 => Event::Force { axis, channel: choose(&runs) },
        112..115 => Event::Free { axis },
        115..117 => {
            let policy = if c % 4 == 0 { AfterCrash::Stop } else { AfterCrash::Resume };
            let cut =
                |one: &ChannelId| rare || (model.may_be_fed(*one) && a >> (one.0 % 32) & 1 == 0);
            Event::Restarted { cut_off: channels().filter(cut).collect(), policy }
        }
        117..120 => Event::Clear,
        // What is not there.
        120 => Event::Begin { channel: ChannelId(CHANNELS), program: "O1".into(), by_hand: true },
        121 => {
            reached(Word::Wait { mark: 1, with: [channel, ChannelId(40)].into_iter().collect() })
        }
        122 => Event::Mode { group: GroupId(GROUPS), mode: Mode::Auto },
        _ => reached(Word::Get { axis: AxisId(AXES), forced: true }),
    }
}

fn setup() -> Setup {
    let names = |of: &str, count: u8| (0..count).map(|at| format!("{of}{at}")).collect();
    let (all, axes, groups): (Vec<String>, Vec<String>, Vec<String>) =
        (names("C", CHANNELS), names("X", AXES), names("G", GROUPS));
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let axes: Vec<&str> = axes.iter().map(String::as_str).collect();
    let members = all.chunks(usize::from(CHANNELS / GROUPS));
    let groups: Vec<(&str, &[&str])> = groups.iter().map(String::as_str).zip(members).collect();
    Setup::new(&all, &axes, &groups).expect("a cell")
}

/// A deadlock is what nobody can help by beginning programs; who is forsaken is helped by that.
fn programs_help_the_forsaken(cell: &Cell) -> TestCaseResult {
    let [_, deadlocked, forsaken] = told(cell);
    let mut helped = cell.clone();
    for channel in channels().filter(|one| !cell.runs(*one)) {
        if matches!(helped.mode(group_of(channel)), Mode::Jog | Mode::JogInAuto) {
            let chosen = Event::Mode { group: group_of(channel), mode: Mode::Auto };
            helped.handle(0, chosen).expect("it may be chosen");
        }
        // Another may have been started meanwhile.
        let begun = Event::Begin { channel, program: "O1".into(), by_hand: true };
        let begun = helped.handle(0, begun);
        prop_assert!(begun.is_ok() || helped.runs(channel) || cell.is_stopped());
    }
    let [_, still, missing] = told(&helped);
    for one in &forsaken {
        let is_stuck = still.contains(one) || missing.contains(one);
        prop_assert!(!is_stuck, "{one:?} is told forsaken, and stuck though all run");
    }
    for one in &deadlocked {
        prop_assert!(still.contains(one), "{one:?} is told deadlocked, and a program helps it");
    }
    Ok(())
}

/// All events from the beginning, saved and restored between them, and what is true behind each.
fn all(events: &[Event], is_true: &dyn Fn(&Cell) -> TestCaseResult) -> TestCaseResult {
    let (mut cell, mut model) = (Cell::new(setup()), Model::default());
    for (now, event) in events.iter().enumerate() {
        one_step(&mut cell, &mut model, now as u64 / 2, event)?;
        is_true(&cell)?;
        if now % 4 == 0 {
            let saved = serde_json::to_string(&cell.save()).expect("it is written");
            let saved: Saved = serde_json::from_str(&saved).expect("it is read");
            let restored = Cell::restore(setup(), saved).expect("it is restored");
            prop_assert_eq!(&restored, &cell, "saved and restored, and something changed");
            cell = restored;
        }
    }
    Ok(())
}

/// Nothing; or why it fails, and as few of these events as still fail, one on each line.
fn fewest(mut events: Vec<Event>, is_true: &dyn Fn(&Cell) -> TestCaseResult) -> TestCaseResult {
    let mut why = all(&events, is_true);
    let mut many = if why.is_ok() { 0 } else { events.len() };
    while many > 0 {
        let (mut at, before) = (0, events.len());
        while at < events.len() {
            let mut fewer = events.clone();
            fewer.drain(at..events.len().min(at + many));
            match all(&fewer, is_true) {
                Ok(()) => at += many,
                other => (events, why) = (fewer, other),
            }
        }
        // One by one until nothing more can be left out.
        if many > 1 || events.len() == before {
            many /= 2;
        }
    }
    let lines: Vec<String> = events.iter().map(|event| format!("\n{event:?}")).collect();
    why.map_err(|why| TestCaseError::fail(format!("{why} behind{}", lines.concat())))
}

/// They are shown when it is known which of them matter.
struct Events(Vec<Event>);

impl fmt::Debug for Events {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} events", self.0.len())
    }
}

/// Some 300 events, most of which fit what has happened before them.
fn some_events() -> impl Strategy<Value = Events> {
    let dice = (0..124_u8, any::<usize>(), any::<usize>(), any::<usize>());
    prop::collection::vec(dice, 1..600).prop_map(|dice| {
        let (mut model, mut events) = (Model::default(), Vec::new());
        for dice in dice {
            let event = event(&model, dice);
            if model.against(&event).is_empty() {
                model.take(&event);
            }
            events.push(event);
        }
        Events(events)
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        max_shrink_iters: 0,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_cell_does_what_its_page_says(Events(events) in some_events()) {
        fewest(events, &|_| Ok(()))?;
    }

    #[test]
    fn whoever_is_forsaken_is_helped_by_programs_that_begin(Events(events) in some_events()) {
        fewest(events, &programs_help_the_forsaken)?;
    }
}

#[test]
fn two_who_wait_for_each_other_are_a_deadlock_even_if_one_waits_for_a_third() {
    let [one, two, three] = [0, 1, 2].map(ChannelId);
    let mut cell = Cell::new(setup());
    for channel in [one, two, three] {
        let begin = Event::Begin { channel, program: "O1".into(), by_hand: false };
        cell.handle(0, begin).expect("it begins");
    }
    let meet = |mark, with: &[ChannelId]| Word::Wait { mark, with: with.iter().copied().collect() };
    for (channel, word) in [(one, meet(1, &[two, three])), (two, meet(2, &[one]))] {
        cell.handle(0, Event::Reached { channel, word }).expect("it waits");
    }
    let told = told(&cell);
    assert_eq!(told, [[three].into(), [one, two].into(), [].into()]);
}
