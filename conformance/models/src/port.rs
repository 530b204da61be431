//! The transmitting side of our port as a model knows it.

use crate::model::Broken;
use std::collections::VecDeque;

/// Characters that have to leave, and the port that they go through: it holds up to
/// `depth` of them, sends them back to back, and takes the next as soon as there is
/// space and nothing holds the queue.
///
/// A model queues what has to be sent, tells the port what it sees, and is told
/// whether that is right.
#[derive(Clone, PartialEq, Debug)]
pub struct Port {
    depth: usize,
    /// In the port: they leave whatever happens. The first is on the wire.
    inside: VecDeque<u8>,
    /// The first of `inside` has begun.
    is_sending: bool,
    /// They pass the queue and its hold.
    urgent: VecDeque<u8>,
    queue: VecDeque<u8>,
    is_held: bool,
    is_gone: bool,
}

impl Port {
    /// A port that holds so many characters.
    pub fn new(depth: usize) -> Self {
        Self {
            depth,
            inside: VecDeque::new(),
            is_sending: false,
            urgent: VecDeque::new(),
            queue: VecDeque::new(),
            is_held: false,
            is_gone: false,
        }
    }

    /// These follow all that waits.
    pub fn send(&mut self, bytes: &[u8]) {
        self.queue.extend(bytes);
    }

    /// These pass the queue and its hold.
    pub fn send_urgently(&mut self, bytes: &[u8]) {
        self.urgent.extend(bytes);
    }

    /// Nothing of the queue goes on into the port, or it does again.
    pub fn hold(&mut self, is_held: bool) {
        self.is_held = is_held;
    }

    /// Drops the queue; what is urgent or in the port stays.
    pub fn discard(&mut self) {
        self.queue.clear();
    }

    /// Drops the last one that waits in the queue.
    pub fn take_back(&mut self) {
        self.queue.pop_back();
    }

    /// Drops what waits in the queue and is not to be kept, by its place.
    pub fn keep(&mut self, is_kept: impl Fn(usize) -> bool) {
        let mut place = 0;
        self.queue.retain(|_| {
            place += 1;
            is_kept(place - 1)
        });
    }

    /// The port is gone, with all that waited and was in it, or is back.
    pub fn set_gone(&mut self, is_gone: bool) {
        self.is_gone = is_gone;
    }

    /// Drops all that waits, as closing does.
    pub fn clear(&mut self) {
        self.queue.clear();
        self.urgent.clear();
        self.is_held = false;
    }

    /// Characters of the queue that the port has not taken.
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// Urgent characters that the port has not taken.
    pub fn urgent(&self) -> usize {
        self.urgent.len()
    }

    /// Characters in the port, the one on the wire included.
    pub fn inside(&self) -> usize {
        self.inside.len()
    }

    /// Of the characters in the port, how many are one of these.
    pub fn inside_of(&self, bytes: &[u8]) -> usize {
        self.inside.iter().filter(|byte| bytes.contains(byte)).count()
    }

    /// Whether nothing waits and nothing is on the wire.
    pub fn is_empty(&self) -> bool {
        self.inside.is_empty() && self.queue.is_empty() && self.urgent.is_empty()
    }

    /// The plug-in's port begins a character.
    ///
    /// # Errors
    /// It is not the one that had to come, or none had to.
    pub fn begins(&mut self, byte: u8, clause: &'static str) -> Result<(), Broken> {
        if self.inside.is_empty() {
            self.fill(1);
        }
        match self.inside.front() {
            Some(next) if *next == byte && !self.is_sending => {
                self.is_sending = true;
                Ok(())
            }
            Some(next) => {
                Err(Broken::new(clause, format!("{byte:02X} left where {next:02X} had to")))
            }
            None if self.is_held && !self.queue.is_empty() => {
                Err(Broken::new(clause, format!("{byte:02X} left while the queue was held")))
            }
            None => Err(Broken::new(clause, format!("{byte:02X} left, and nothing had to"))),
        }
    }

    /// The last bit of the character on the wire has left.
    pub fn left(&mut self) {
        self.inside.pop_front();
        self.is_sending = false;
    }

    /// The instant is over: the port takes what it has space for.
    ///
    /// # Errors
    /// The wire is free and the next character has not begun.
    pub fn settled(&mut self, clause: &'static str) -> Result<(), Broken> {
        self.fill(self.depth);
        match self.inside.front() {
            Some(next) if !self.is_sending => {
                Err(Broken::new(clause, format!("{next:02X} had to leave, and nothing did")))
            }
            _ => Ok(()),
        }
    }

    fn fill(&mut self, depth: usize) {
        while !self.is_gone && self.inside.len() < depth {
            let next = self.urgent.pop_front();
            let next = next.or_else(|| if self.is_held { None } else { self.queue.pop_front() });
            let Some(next) = next else { return };
            self.inside.push_back(next);
        }
    }
}
