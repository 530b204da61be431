//! All states that a cell can come to, and what leads from one to another.

use std::collections::HashMap;

use softplug_cell::{
    AfterCrash, AxisId, Cell, Change, ChannelId, ChannelSet, End, Event, Setup, Word,
};

/// What a cell has, and what is said in it.
pub(crate) struct Alphabet {
    pub(crate) channels: u8,
    pub(crate) marks: u32,
    pub(crate) axes: u8,
    /// LAD and EXE are said, too.
    pub(crate) loads: bool,
    /// Somebody gives and frees axes, and the gateway is ended.
    pub(crate) turns: bool,
}

pub(crate) struct Graph {
    pub(crate) states: Vec<Cell>,
    /// From, to; by what channels do themselves.
    pub(crate) inside: Vec<(u32, u32)>,
}

impl Alphabet {
    pub(crate) fn cell(&self) -> Cell {
        let channels: Vec<String> = (0..self.channels).map(|at| format!("C{at}")).collect();
        let axes: Vec<String> = (0..self.axes).map(|at| format!("A{at}")).collect();
        let channels: Vec<&str> = channels.iter().map(String::as_str).collect();
        let axes: Vec<&str> = axes.iter().map(String::as_str).collect();
        Cell::new(Setup::new(&channels, &axes, &[]).expect("distinct names"))
    }

    fn words(&self, by: ChannelId) -> Vec<Word> {
        let mut words = Vec::new();
        for members in 0..1_u32 << self.channels {
            let with: ChannelSet =
                (0..self.channels).filter(|at| members >> at & 1 == 1).map(ChannelId).collect();
            if with.has(by) && with.len() > 1 {
                words.extend((0..self.marks).map(|mark| Word::Wait { mark, with }));
            }
        }
        for axis in (0..self.axes).map(AxisId) {
            words.extend([false, true].map(|forced| Word::Get { axis, forced }));
            words.push(Word::Release { axis });
        }
        if self.loads {
            for channel in (0..self.channels).map(ChannelId) {
                words.push(Word::Load { channel, program: "P".to_owned() });
                words.push(Word::Start { channel });
            }
        }
        words
    }
}

/// All that can happen to a cell, also what it refuses.
pub(crate) fn events(cell: &Cell, alphabet: &Alphabet) -> Vec<Event> {
    let mut events = Vec::new();
    let channels = || (0..alphabet.channels).map(ChannelId);
    for channel in channels() {
        if !cell.runs(channel) {
            let program = "P".to_owned();
            events.push(Event::Begin { channel, program, by_hand: true });
            continue;
        }
        if cell.may_be_fed(channel) {
            let said = alphabet.words(channel).into_iter();
            events.extend(said.map(|word| Event::Reached { channel, word }));
            events.push(Event::Ended { channel, end: End::Done });
        }
        events.push(Event::Ended { channel, end: End::Failed });
        if alphabet.loads {
            events.push(Event::Unloaded { channel });
        }
    }
    if !alphabet.turns {
        return events;
    }
    for axis in (0..alphabet.axes).map(AxisId) {
        events.extend(channels().map(|channel| Event::Force { axis, channel }));
        events.push(Event::Free { axis });
    }
    let fed: Vec<ChannelId> = channels().filter(|one| cell.may_be_fed(*one)).collect();
    for some in 0..1_u32 << fed.len() {
        let cut_off = fed.iter().enumerate().filter(|(at, _)| some >> at & 1 == 1);
        let cut_off = cut_off.map(|(_, one)| *one).collect();
        events.push(Event::Restarted { cut_off, policy: AfterCrash::Resume });
    }
    events.push(Event::Restarted { cut_off: ChannelSet::default(), policy: AfterCrash::Stop });
    events.push(Event::Clear);
    events
}

/// Whether channels do it by themselves. `before`: where it happened. Where LAD and EXE are not
/// said, a beginning stands for both: some channel that runs says them.
pub(crate) fn is_inside(before: &Cell, event: &Event, alphabet: &Alphabet) -> bool {
    match event {
        Event::Reached { .. } => true,
        Event::Begin { .. } => {
            !alphabet.loads && before.setup().channels().any(|one| before.may_be_fed(one))
        }
        Event::Ended { channel, .. } => before.may_be_fed(*channel),
        _ => false,
    }
}

impl Graph {
    pub(crate) fn of(alphabet: &Alphabet, check: impl Fn(&Cell, &Event, &[Change], &Cell)) -> Self {
        let first = alphabet.cell();
        let mut known = HashMap::from([(first.clone(), 0)]);
        let mut graph = Self { states: vec![first], inside: Vec::new() };
        let mut at = 0;
        while at < graph.states.len() {
            let before = graph.states[at].clone();
            for event in events(&before, alphabet) {
                let mut after = before.clone();
                let Ok(changes) = after.handle(0, event.clone()) else {
                    assert_eq!(after, before, "refused, and changed by {event:?}");
                    continue;
                };
                check(&before, &event, &changes, &after);
                let to = *known.entry(after).or_insert_with_key(|after| {
                    graph.states.push(after.clone());
                    (graph.states.len() - 1) as u32
                });
                if is_inside(&before, &event, alphabet) {
                    graph.inside.push((at as u32, to));
                }
            }
            at += 1;
        }
        graph
    }

    pub(crate) fn deadlocks(&self) -> usize {
        self.states.iter().filter(|cell| !cell.deadlocked().is_empty()).count()
    }

    pub(crate) fn forsaken(&self) -> usize {
        self.states.iter().filter(|cell| !cell.forsaken().is_empty()).count()
    }
}
