//! Who comes first to what is written down: the lines.
//!
//! A mutex gives whoever asks often as good a chance as whoever has waited long, so that many
//! clients that order jobs could keep the feeder from its turn. Here what serves a line waits for
//! one change at most: the one that is being written.

use std::ops::{Deref, DerefMut};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Who asks for a turn.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Who {
    /// Something that a machine waits for, or the loop that serves all links.
    Line,
    /// A person, or a program in a person's place; the journal.
    Other,
}

/// Something that one at a time may use.
#[derive(Debug)]
pub(super) struct Turns<T> {
    queue: Mutex<Queue>,
    for_lines: Condvar,
    for_others: Condvar,
    thing: Mutex<T>,
}

#[derive(Debug, Default)]
struct Queue {
    is_taken: bool,
    /// Lines that wait.
    lines: usize,
}

/// A turn, until it is dropped.
pub(super) struct Turn<'a, T> {
    turns: &'a Turns<T>,
    thing: Option<MutexGuard<'a, T>>,
}

impl<T> Turns<T> {
    pub(super) fn new(thing: T) -> Self {
        Self {
            queue: Mutex::default(),
            for_lines: Condvar::new(),
            for_others: Condvar::new(),
            thing: Mutex::new(thing),
        }
    }

    /// Waits for a turn.
    pub(super) fn take(&self, who: Who) -> Turn<'_, T> {
        let mut queue = self.queue();
        match who {
            Who::Line => {
                queue.lines += 1;
                while queue.is_taken {
                    queue = waited(self.for_lines.wait(queue));
                }
                queue.lines -= 1;
            }
            Who::Other => {
                while queue.is_taken || queue.lines > 0 {
                    queue = waited(self.for_others.wait(queue));
                }
            }
        }
        queue.is_taken = true;
        drop(queue);
        // Nobody else has it. What a panicking thread left is what the disk says.
        Turn { turns: self, thing: Some(waited(self.thing.lock())) }
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        waited(self.queue.lock())
    }
}

fn waited<T>(got: Result<T, PoisonError<T>>) -> T {
    got.unwrap_or_else(PoisonError::into_inner)
}

impl<T> Drop for Turn<'_, T> {
    fn drop(&mut self) {
        drop(self.thing.take());
        let mut queue = self.turns.queue();
        queue.is_taken = false;
        let next = if queue.lines > 0 { &self.turns.for_lines } else { &self.turns.for_others };
        next.notify_one();
    }
}

impl<T> Deref for Turn<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.thing.as_ref().expect("it is taken out only when the turn ends")
    }
}

impl<T> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        self.thing.as_mut().expect("it is taken out only when the turn ends")
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::thread;

    use super::*;

    #[test]
    fn a_line_waits_for_one_turn_at_most_however_many_others_wait() {
        let turns = Arc::new(Turns::new(Vec::new()));
        let first = turns.take(Who::Other);
        let spawn = |who| {
            let turns = Arc::clone(&turns);
            thread::spawn(move || turns.take(who).push(who))
        };
        let mut waiting: Vec<_> = (0..16).map(|_| spawn(Who::Other)).collect();
        let lines: Vec<_> = (0..2).map(|_| spawn(Who::Line)).collect();
        while turns.queue().lines < lines.len() {
            thread::yield_now();
        }
        drop(first);
        waiting.extend(lines);
        for thread in waiting {
            thread.join().unwrap();
        }
        let spec = turns.take(Who::Other).clone();
        assert_eq!(spec.len(), 18);
        assert_eq!(spec[..2], [Who::Line; 2], "{spec:?}");
    }
}
