//! The states that are known: how each was reached, and where the usual way leads from it.

use crate::choice::Choice;
use crate::hash::Hash128;
use softplug_abi::Micros;
use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;

/// A state.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Node {
    /// The state that it was reached from, and by which choice.
    pub(crate) parent: u32,
    pub(crate) choice: Choice,
    /// A job or a delivery is under way.
    pub(crate) is_under_way: bool,
}

/// Every state that was found, in the order of the levels.
#[derive(Default)]
pub(crate) struct Graph {
    numbers: HashMap<u128, u32>,
    hashes: Vec<u128>,
    pub(crate) nodes: Vec<Node>,
    /// Where the usual way leads, and how long it takes.
    usual: Vec<Option<(u32, Micros)>>,
    /// The first state of each level.
    levels: Vec<u32>,
    pub(crate) transitions: u64,
    /// What the protocol could not keep from happening, by its name.
    pub(crate) unavoidable: BTreeMap<String, u64>,
    /// What the latest level added to the counts.
    added: (u64, BTreeMap<String, u64>),
}

/// One level: its states, and what is known of those of the level before.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Level {
    /// Choices that were made in the level before.
    pub(crate) transitions: u64,
    pub(crate) nodes: Vec<(u128, Node)>,
    /// From a state to the next one, and how long that takes.
    pub(crate) usual: Vec<(u32, u32, Micros)>,
    pub(crate) unavoidable: BTreeMap<String, u64>,
}

/// What becomes of the states when nothing goes wrong any more.
pub(crate) struct Ends {
    /// The longest way to rest.
    pub(crate) longest: Micros,
    /// A state from which a job or a delivery goes on for ever.
    pub(crate) endless: Option<u32>,
}

impl Graph {
    pub(crate) fn add(&mut self, hash: u128, node: Node) -> u32 {
        let number = self.nodes.len() as u32;
        self.numbers.insert(hash, number);
        self.hashes.push(hash);
        self.nodes.push(node);
        self.usual.push(None);
        if self.levels.is_empty() {
            self.levels.push(0);
        }
        number
    }

    pub(crate) fn begin_level(&mut self) {
        self.levels.push(self.nodes.len() as u32);
    }

    pub(crate) fn set_usual(&mut self, from: u32, to: u128, time: Micros) {
        self.usual[from as usize] = self.numbers.get(&to).map(|to| (*to, time));
    }

    /// What was counted on the way to the latest level.
    pub(crate) fn count(&mut self, transitions: u64, unavoidable: BTreeMap<String, u64>) {
        self.transitions += transitions;
        for (name, count) in &unavoidable {
            *self.unavoidable.entry(name.clone()).or_default() += count;
        }
        self.added = (transitions, unavoidable);
    }

    /// The latest level, to be kept.
    pub(crate) fn latest(&self) -> Level {
        let (first, before) = match self.levels[..] {
            [.., before, first] => (first as usize, before as usize),
            [first] => (first as usize, first as usize),
            [] => (0, 0),
        };
        let (transitions, unavoidable) = self.added.clone();
        let usual = (before..first)
            .filter_map(|from| self.usual[from].map(|(next, time)| (from as u32, next, time)));
        let hashes = self.hashes[first..].iter().copied();
        Level {
            transitions,
            nodes: hashes.zip(self.nodes[first..].iter().copied()).collect(),
            usual: usual.collect(),
            unavoidable,
        }
    }

    /// Adds a level that was kept; whether it fits.
    pub(crate) fn add_level(&mut self, level: Level) -> bool {
        let Level { transitions, nodes, usual, unavoidable } = level;
        let before = self.nodes.len();
        let is_first_alone = before > 0 || nodes.len() == 1;
        if !is_first_alone || nodes.iter().any(|(_, node)| node.parent as usize >= before.max(1)) {
            return false;
        }
        if before > 0 {
            self.begin_level();
        }
        for (hash, node) in nodes {
            self.add(hash, node);
        }
        let known = self.nodes.len();
        for (from, next, time) in usual {
            if from as usize >= before || next as usize >= known {
                return false;
            }
            self.usual[from as usize] = Some((next, time));
        }
        self.count(transitions, unavoidable);
        true
    }

    /// The states of the latest level.
    pub(crate) fn frontier(&self) -> std::ops::Range<u32> {
        self.levels.last().copied().unwrap_or(0)..self.nodes.len() as u32
    }

    pub(crate) fn hash_of(&self, number: u32) -> u128 {
        self.hashes[number as usize]
    }

    pub(crate) fn contains(&self, hash: u128) -> bool {
        self.numbers.contains_key(&hash)
    }

    pub(crate) fn states(&self) -> u64 {
        self.nodes.len() as u64
    }

    /// Choices from the first state to the latest level.
    pub(crate) fn depth(&self) -> u32 {
        self.levels.len().saturating_sub(1) as u32
    }

    /// The choices that lead to a state.
    pub(crate) fn path_to(&self, mut number: u32) -> Vec<Choice> {
        let mut path = Vec::new();
        while number != 0 {
            let node = &self.nodes[number as usize];
            path.push(node.choice);
            number = node.parent;
        }
        path.reverse();
        path
    }

    /// The same for the same search, on any machine with any number of threads.
    pub(crate) fn digest(&self) -> u128 {
        let mut state = Hash128::new();
        (&self.hashes, self.transitions, &self.levels, &self.unavoidable).hash(&mut state);
        state.finish_128()
    }

    /// Follows the usual way from every state.
    pub(crate) fn ends(&self) -> Ends {
        #[derive(Copy, Clone, PartialEq)]
        enum Seen {
            No,
            OnTheWay,
            Rests(Micros),
        }
        let mut seen = vec![Seen::No; self.nodes.len()];
        let mut ends = Ends { longest: Micros::ZERO, endless: None };
        for start in 0..self.nodes.len() {
            let mut way = Vec::new();
            let mut at = start;
            let mut rest = loop {
                match seen[at] {
                    Seen::Rests(time) => break time,
                    Seen::OnTheWay => {
                        let round = way.iter().skip_while(|(state, _)| *state != at);
                        let mut states = round.map(|(state, _): &(usize, Micros)| *state);
                        if states.all(|state| self.nodes[state].is_under_way) {
                            let first =
                                ends.endless.map_or(at as u32, |first| first.min(at as u32));
                            ends.endless = Some(first);
                        }
                        break Micros::ZERO;
                    }
                    Seen::No => seen[at] = Seen::OnTheWay,
                }
                let Some((next, time)) = self.usual[at] else {
                    way.push((at, Micros::ZERO));
                    break Micros::ZERO;
                };
                way.push((at, time));
                at = next as usize;
            };
            for (state, time) in way.into_iter().rev() {
                rest = rest + time;
                seen[state] = Seen::Rests(rest);
                ends.longest = ends.longest.max(rest);
            }
        }
        ends
    }
}
