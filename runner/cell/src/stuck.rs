//! Who cannot go on, whatever the other channels do: found when it comes to be.
//!
//! A channel is *able* if it can go on, now or later, with nobody's help from outside: it runs
//! unhindered, or what it waits for can come from able channels. That is the least set that is
//! closed under this rule, so a circle of channels that wait for each other is not in it. Who
//! waits and is not able is stuck. What a channel that runs will do is not known; so it counts as
//! able to say any word. A pause, a lost port and a mode are somebody's to end, and hinder nobody
//! here.

use std::fmt::Write as _;

use crate::cell::Cell;
use crate::event::Change;
use crate::setup::{AxisId, ChannelId, ChannelSet};
use crate::word::Word;

/// Why a channel cannot go on, and what would free it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stuck {
    /// Who.
    pub channel: ChannelId,
    /// For whom it waits.
    pub waits_for: ChannelSet,
    /// Since when it stands behind its block, in milliseconds; none if an axis was taken from it.
    pub since: Option<u64>,
    /// In words, with what would free it.
    pub text: String,
}

impl Cell {
    /// Channels that wait for each other.
    pub fn deadlocked(&self) -> ChannelSet {
        self.state.deadlocked
    }

    /// Channels that wait for one that runs no program, with nobody left who would start one.
    pub fn forsaken(&self) -> ChannelSet {
        self.state.forsaken
    }

    /// All that are stuck, each with its reason.
    pub fn stuck(&self) -> Vec<Stuck> {
        let stuck = self
            .setup()
            .channels()
            .filter(|one| self.state.deadlocked.has(*one) || self.state.forsaken.has(*one));
        stuck.map(|channel| self.explained(channel)).collect()
    }

    /// For whom a channel waits directly; nobody if it goes on.
    pub fn waits_for(&self, channel: ChannelId) -> ChannelSet {
        let mut blockers = ChannelSet::default();
        match self.of(channel).waits.as_ref().map(|waiting| &waiting.word) {
            Some(Word::Wait { mark, with }) => {
                for one in with.iter().filter(|one| !self.is_at(*one, *mark, *with)) {
                    blockers.insert(one);
                }
            }
            Some(Word::Load { channel: other, .. } | Word::Start { channel: other }) => {
                blockers.insert(*other);
            }
            Some(Word::Get { axis, .. }) => self.add_before(channel, *axis, &mut blockers),
            Some(Word::Release { .. }) | None => {}
        }
        for axis in &self.of(channel).deprived {
            self.add_before(channel, *axis, &mut blockers);
        }
        blockers
    }

    /// Looks who is stuck now, and tells what is new.
    pub(crate) fn find_stuck(&mut self, changes: &mut Vec<Change>) {
        let nobody = ChannelSet::default();
        let able = self.able(nobody);
        let stuck: ChannelSet = self
            .setup()
            .channels()
            .filter(|one| self.runs(*one) && !self.is_unhindered(*one) && !able.has(*one))
            .collect();
        // Who would be free if programs began wherever none runs waits for these.
        let idle: ChannelSet = self.setup().channels().filter(|one| !self.runs(*one)).collect();
        let helped = self.able(idle);
        let forsaken: ChannelSet = stuck.iter().filter(|one| helped.has(*one)).collect();
        let deadlocked: ChannelSet = stuck.iter().filter(|one| !forsaken.has(*one)).collect();
        let before = (self.state.deadlocked, self.state.forsaken);
        (self.state.deadlocked, self.state.forsaken) = (deadlocked, forsaken);
        let was_stuck = before.0.iter().chain(before.1.iter());
        let free: ChannelSet =
            was_stuck.filter(|one| !stuck.has(*one) && self.runs(*one)).collect();
        if !free.is_empty() {
            changes.push(Change::Free { channels: free });
        }
        if deadlocked != before.0 && !deadlocked.is_empty() {
            changes.push(Change::Deadlock { channels: deadlocked });
        }
        if forsaken != before.1 && !forsaken.is_empty() {
            changes.push(Change::NobodyComes { channels: forsaken });
        }
    }

    /// All that can go on; `begun`: channels that count as if a program ran there.
    fn able(&self, begun: ChannelSet) -> ChannelSet {
        let is_free = |one: &ChannelId| self.is_unhindered(*one) || begun.has(*one);
        let mut able: ChannelSet = self.setup().channels().filter(is_free).collect();
        loop {
            let more: Vec<ChannelId> = self
                .setup()
                .channels()
                .filter(|one| !able.has(*one) && self.can_go_on(*one, able, begun))
                .collect();
            if more.is_empty() {
                return able;
            }
            for one in more {
                able.insert(one);
            }
        }
    }

    fn can_go_on(&self, channel: ChannelId, able: ChannelSet, begun: ChannelSet) -> bool {
        if !self.runs(channel) {
            // Whoever is able can load a program here and start it.
            return !able.is_empty();
        }
        let state = self.of(channel);
        let word = state.waits.as_ref().is_none_or(|waiting| match &waiting.word {
            Word::Wait { mark, with } => {
                with.iter().all(|one| self.is_at(one, *mark, *with) || able.has(one))
            }
            Word::Get { axis, .. } => self.can_get(channel, *axis, able),
            Word::Load { channel: into, .. } => self.can_load(*into, able, begun),
            Word::Start { channel: other } => self.can_start(channel, *other, able, begun),
            Word::Release { .. } => true,
        });
        word && state.deprived.iter().all(|axis| self.can_get(channel, *axis, able))
    }

    fn can_get(&self, channel: ChannelId, axis: AxisId, able: ChannelSet) -> bool {
        let mut before = ChannelSet::default();
        self.add_before(channel, axis, &mut before);
        before.iter().all(|one| able.has(one))
    }

    /// Who has an axis before a channel gets it.
    fn add_before(&self, channel: ChannelId, axis: AxisId, to: &mut ChannelSet) {
        let (owner, queue) = self.axis(axis);
        let ahead = queue.into_iter().take_while(|other| *other != channel);
        for one in owner.into_iter().chain(ahead) {
            to.insert(one);
        }
    }

    /// Whether the program that is loaded there can be started, which makes room for the next.
    fn can_load(&self, into: ChannelId, able: ChannelSet, begun: ChannelSet) -> bool {
        let is_idle = !self.runs(into);
        if !is_idle && !able.has(into) {
            return false;
        }
        let starts = |one: ChannelId| {
            let word = self.of(one).waits.as_ref().map(|waiting| &waiting.word);
            one != into && matches!(word, Some(Word::Start { channel }) if *channel == into)
        };
        let is_running_and_able =
            |one: &ChannelId| able.has(*one) && (self.runs(*one) || begun.has(*one));
        self.setup().channels().any(starts)
            || self.setup().channels().any(|one| one != into && is_running_and_able(&one))
            // It has one begin that starts it, once it has ended.
            || (is_running_and_able(&into) && self.setup().channels().any(|one| one != into && !self.runs(one)))
    }

    fn can_start(
        &self,
        by: ChannelId,
        other: ChannelId,
        able: ChannelSet,
        begun: ChannelSet,
    ) -> bool {
        let can_end = !self.runs(other) || able.has(other);
        let can_be_loaded = self.of(other).loaded.is_some()
            || able.iter().any(|one| self.runs(one) || begun.has(one));
        by != other && can_end && can_be_loaded
    }

    fn explained(&self, channel: ChannelId) -> Stuck {
        let setup = self.setup();
        let name = |one: ChannelId| setup.channel_name(one);
        let waits_for = self.waits_for(channel);
        let waiting = self.channel(channel).waits;
        let mut helps: Vec<String> = Vec::new();
        let mut what = match waiting {
            Some((word @ Word::Wait { .. }, _)) => word.told(channel, setup),
            Some((Word::Get { axis, .. }, _)) => {
                helps.push(self.help_with(*axis));
                format!("waits for {}", self.owned(*axis))
            }
            Some((Word::Load { channel: into, program }, _)) => {
                let (into, program) = (name(*into), program.escape_debug());
                format!("waits to load {program} into {into}, where one is loaded and not started")
            }
            Some((Word::Start { channel: other }, _)) if self.of(*other).loaded.is_none() => {
                format!("waits to start {}, where nothing is loaded", name(*other))
            }
            Some((Word::Start { channel: other }, _)) => {
                format!("waits for the end of {} to start its next program", name(*other))
            }
            Some((Word::Release { .. }, _)) | None => "is interrupted".to_owned(),
        };
        for axis in &self.of(channel).deprived {
            let _ = write!(what, "; {} was taken from it", setup.axis_name(*axis));
            if let (Some(owner), _) = self.axis(*axis) {
                let _ = write!(what, ", {} has it", name(owner));
            }
        }
        let begin: Vec<&str> = self.would_help(channel).iter().map(name).collect();
        if self.state.forsaken.has(channel) && !begin.is_empty() {
            helps.push(format!("begin a program in {}", crate::setup::listed(&begin)));
        }
        helps.push(format!("end the program of {}", name(channel)));
        helps.dedup();
        let text = format!("{} {what}: {}", name(channel), helps.join(", or "));
        Stuck { channel, waits_for, since: waiting.map(|(_, since)| since), text }
    }

    /// Channels without a program at the end of the chain of those that a channel waits for, where a
    /// program that begins could help. Where nothing is loaded it would have to load one.
    fn would_help(&self, channel: ChannelId) -> ChannelSet {
        let (mut seen, mut idle) = (ChannelSet::default(), ChannelSet::default());
        let mut next = vec![channel];
        while let Some(one) = next.pop() {
            if seen.has(one) {
                continue;
            }
            seen.insert(one);
            let word = self.of(one).waits.as_ref().map(|waiting| &waiting.word);
            for other in self.waits_for(one).iter() {
                let starts = matches!(word, Some(Word::Start { channel }) if *channel == other);
                if self.runs(other) {
                    next.push(other);
                } else if !starts || self.of(other).loaded.is_some() {
                    idle.insert(other);
                }
            }
        }
        idle
    }

    fn owned(&self, axis: AxisId) -> String {
        let name = self.setup().axis_name(axis);
        match self.axis(axis).0 {
            Some(owner) => format!("{name}, which {} has", self.setup().channel_name(owner)),
            None => name.to_owned(),
        }
    }

    fn help_with(&self, axis: AxisId) -> String {
        format!("release {}", self.setup().axis_name(axis))
    }
}
