//! Our side of the line: messages on their way, and the room that is left for more.

use crate::model::Broken;
use crate::port::Port;
use std::collections::VecDeque;

/// What a character belongs to.
#[derive(Copy, Clone, Debug)]
struct Label {
    /// DAT or EOD of the job under way.
    is_job: bool,
    /// The last one of its message.
    is_last: bool,
    clause: &'static str,
}

/// The port with its queue.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    port: Port,
    waiting: VecDeque<Label>,
    inside: VecDeque<Label>,
    /// Bytes that the transmit queue takes in all.
    capacity: usize,
    /// What of it the plug-in knows to be free.
    known: usize,
    /// Free, and not told yet: it is told a quarter of the whole at a time, and when
    /// the queue is empty.
    untold: usize,
    /// Dropped, and not told yet.
    dropped: usize,
    /// Characters of the job that were ever queued, and those that the port took.
    queued: u64,
    taken: u64,
    /// The clause of what was last queued.
    clause: &'static str,
}

impl Wire {
    pub(super) fn new(depth: usize, room: u32) -> Self {
        Self {
            port: Port::new(depth),
            waiting: VecDeque::new(),
            inside: VecDeque::new(),
            capacity: room as usize,
            known: room as usize,
            untold: 0,
            dropped: 0,
            queued: 0,
            taken: 0,
            clause: "fanuc-rs232.remote.initialise",
        }
    }

    /// Sends a message behind all that waits.
    pub(super) fn send(&mut self, message: &[u8], is_job: bool, clause: &'static str) {
        self.port.send(message);
        self.known = self.known.saturating_sub(message.len());
        for place in 1..=message.len() {
            let is_last = place == message.len();
            self.waiting.push_back(Label { is_job, is_last, clause });
        }
        if is_job {
            self.queued += message.len() as u64;
        }
        self.clause = clause;
    }

    /// Drops all that the port has not taken.
    pub(super) fn discard(&mut self) {
        self.port.discard();
        self.dropped += self.waiting.len();
        self.waiting.clear();
    }

    /// What was dropped is told behind all that came from the line at the same instant.
    pub(super) fn tell_dropped(&mut self) {
        self.known += std::mem::take(&mut self.dropped);
    }

    /// Counts characters of a job from here on: those that wait are another's.
    pub(super) fn count_anew(&mut self) {
        self.waiting.iter_mut().for_each(|label| label.is_job = false);
        (self.queued, self.taken) = (0, 0);
    }

    /// Characters of the job that have left, those in the port included.
    pub(super) fn taken(&self) -> u64 {
        self.taken
    }

    /// Characters of the job that were ever queued.
    pub(super) fn queued(&self) -> u64 {
        self.queued
    }

    /// Room that was told.
    pub(super) fn known(&self) -> usize {
        self.known
    }

    pub(super) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Characters that have to leave.
    pub(super) fn count(&self) -> usize {
        self.waiting.len() + self.inside.len()
    }

    /// Whether nothing has to leave.
    pub(super) fn is_empty(&self) -> bool {
        self.count() == 0
    }

    pub(super) fn set_gone(&mut self, is_gone: bool) {
        self.port.set_gone(is_gone);
    }

    /// Closing drops all that waits.
    pub(super) fn close(&mut self) {
        self.discard();
        self.port.clear();
        self.known = self.capacity;
        (self.untold, self.dropped) = (0, 0);
    }

    /// A character begins.
    ///
    /// # Errors
    /// It is not the one that had to, or none had to.
    pub(super) fn begins(&mut self, byte: u8, idle: &'static str) -> Result<(), Broken> {
        let next = self.inside.front().or(self.waiting.front());
        let clause = next.map_or(idle, |next| next.clause);
        self.port.begins(byte, clause)?;
        self.follow();
        Ok(())
    }

    /// The last bit of a character has left. Whether it was the last of its message.
    pub(super) fn left(&mut self) -> bool {
        self.port.left();
        self.inside.pop_front().is_some_and(|label| label.is_last)
    }

    /// The instant is over.
    ///
    /// # Errors
    /// A character had to begin and did not.
    pub(super) fn settled(&mut self) -> Result<(), Broken> {
        let next = self.inside.front().or(self.waiting.front());
        let clause = next.map_or(self.clause, |next| next.clause);
        self.port.settled(clause)?;
        self.follow();
        self.tell_dropped();
        if self.untold >= self.capacity.div_ceil(4) || self.waiting.is_empty() {
            self.known += std::mem::take(&mut self.untold);
        }
        Ok(())
    }

    /// Labels go with their characters into the port.
    fn follow(&mut self) {
        while self.waiting.len() > self.port.waiting() {
            let Some(label) = self.waiting.pop_front() else { return };
            self.taken += u64::from(label.is_job);
            self.untold += 1;
            self.inside.push_back(label);
        }
    }
}
