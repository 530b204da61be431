//! What our station sends: characters on their way through the port, and whose
//! they are.

use super::rules::Rule;
use crate::model::Broken;
use crate::port::Port;
use softplug_abi::{LineParameters, Micros};
use std::collections::VecDeque;

/// What a character is for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Part {
    /// STX of a job, or any of its block but the last.
    Job,
    /// DLE that answers an STX.
    Grant,
    /// DLE or NAK at the end of something.
    Answer,
}

/// A character with what it is for.
#[derive(Copy, Clone, PartialEq, Debug)]
struct Labelled {
    part: Part,
    /// Told when it has left; 0: nobody waits for it.
    mark: u64,
    rule: Rule,
}

/// The transmitting side with its labels.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Outgoing {
    port: Port,
    line: LineParameters,
    waiting: VecDeque<Labelled>,
    inside: VecDeque<Labelled>,
    marks: u64,
    /// Characters of the job that the port has taken.
    taken: u64,
    /// When characters began to follow each other without a gap, and how many have
    /// begun since.
    run: (Micros, u64),
}

impl Outgoing {
    pub(super) fn new(line: LineParameters, depth: usize) -> Self {
        Self {
            port: Port::new(depth),
            line,
            waiting: VecDeque::new(),
            inside: VecDeque::new(),
            marks: 0,
            taken: 0,
            run: (Micros::ZERO, 0),
        }
    }

    /// Sends these behind all that waits; the last one is marked.
    pub(super) fn send(&mut self, bytes: &[u8], part: Part, rule: Rule) -> u64 {
        self.marks += 1;
        let last = bytes.len().saturating_sub(1);
        for at in 0..bytes.len() {
            let mark = if at == last { self.marks } else { 0 };
            self.waiting.push_back(Labelled { part, mark, rule });
        }
        self.port.send(bytes);
        self.marks
    }

    /// Drops all that the port has not taken.
    pub(super) fn take_all_back(&mut self) {
        self.waiting.clear();
        self.port.discard();
    }

    /// Drops what the port has not taken of this part.
    pub(super) fn take_part_back(&mut self, part: Part) {
        let waiting = &self.waiting;
        self.port.keep(|place| waiting.get(place).is_some_and(|waiting| waiting.part != part));
        self.waiting.retain(|waiting| waiting.part != part);
    }

    /// Drops the last one that the port has not taken.
    pub(super) fn take_back(&mut self) {
        self.waiting.pop_back();
        self.port.take_back();
    }

    pub(super) fn set_gone(&mut self, is_gone: bool) {
        self.port.set_gone(is_gone);
    }

    /// Counts characters of a job from here on.
    pub(super) fn count_anew(&mut self) {
        self.taken = 0;
    }

    /// Characters of the job that have left, the one on the wire included.
    pub(super) fn taken(&self) -> u64 {
        self.taken
    }

    /// Characters of the job that have left, or will.
    pub(super) fn leaving(&self) -> u64 {
        let waits = self.waiting.iter().filter(|waiting| waiting.part == Part::Job).count();
        self.taken + waits as u64
    }

    /// Characters that have to leave.
    pub(super) fn count(&self) -> usize {
        self.waiting.len() + self.inside.len()
    }

    /// When the last of them will have left, and the one on the wire.
    pub(super) fn ends(&self, now: Micros) -> (Micros, Micros) {
        let begun = u64::from(!self.inside.is_empty());
        let (start, count) = self.run;
        let rest = self.count() as u64 - begun;
        if begun == 0 {
            return (now, now + self.line.characters(rest));
        }
        let end = |more| start + self.line.characters(count + more);
        (end(0), end(rest))
    }

    /// A character begins.
    ///
    /// # Errors
    /// It is not the one that had to, or `idle` says why none had to.
    pub(super) fn begins(
        &mut self,
        at: Micros,
        byte: u8,
        idle: Rule,
        clause: impl Fn(Rule) -> &'static str,
    ) -> Result<(), Broken> {
        let next = self.inside.front().or(self.waiting.front()).map_or(idle, |next| next.rule);
        self.port.begins(byte, clause(next))?;
        self.follow();
        let (start, count) = self.run;
        self.run =
            if start + self.line.characters(count) == at { (start, count + 1) } else { (at, 1) };
        Ok(())
    }

    /// The last bit of a character has left: its mark.
    pub(super) fn left(&mut self) -> u64 {
        self.port.left();
        self.inside.pop_front().map_or(0, |left| left.mark)
    }

    /// The instant is over.
    ///
    /// # Errors
    /// A character had to begin and did not.
    pub(super) fn settled(&mut self, clause: impl Fn(Rule) -> &'static str) -> Result<(), Broken> {
        let next = self.inside.front().or(self.waiting.front());
        let rule = next.map_or(Rule::SetUp, |next| next.rule);
        let settled = self.port.settled(clause(rule));
        self.follow();
        settled
    }

    /// Labels go with their characters into the port.
    fn follow(&mut self) {
        while self.waiting.len() > self.port.waiting() {
            let Some(taken) = self.waiting.pop_front() else { return };
            self.taken += u64::from(taken.part == Part::Job);
            self.inside.push_back(taken);
        }
    }
}
