//! The deadlines of a thread's lanes, soonest first.

use softplug_abi::Micros;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// At most one deadline for each lane, by its slot.
///
/// A lane whose deadline moves further away keeps the earlier one: it then
/// comes to nothing once, which costs less than to put it in order at each
/// event. One that moves nearer leaves the old entry behind, to be skipped.
#[derive(Debug, Default)]
pub(super) struct Deadlines {
    heap: BinaryHeap<Reverse<(Micros, usize)>>,
    /// What counts for each slot.
    armed: Vec<Option<Micros>>,
}

impl Deadlines {
    /// The lane in `slot` wants to be called at `deadline`, or not at all.
    pub(super) fn set(&mut self, slot: usize, deadline: Option<Micros>) {
        if slot >= self.armed.len() {
            self.armed.resize(slot + 1, None);
        }
        let Some(deadline) = deadline else { return };
        if self.armed[slot].is_some_and(|armed| armed <= deadline) {
            return;
        }
        self.armed[slot] = Some(deadline);
        self.heap.push(Reverse((deadline, slot)));
        if self.heap.len() > 64 + 4 * self.armed.len() {
            self.rebuild();
        }
    }

    /// The lane is no more.
    pub(super) fn clear(&mut self, slot: usize) {
        if let Some(armed) = self.armed.get_mut(slot) {
            *armed = None;
        }
    }

    /// The soonest.
    pub(super) fn next(&mut self) -> Option<Micros> {
        while let Some(Reverse((deadline, slot))) = self.heap.peek().copied() {
            if self.armed[slot] == Some(deadline) {
                return Some(deadline);
            }
            self.heap.pop();
        }
        None
    }

    /// Takes a slot whose deadline has come.
    pub(super) fn take_due(&mut self, now: Micros) -> Option<usize> {
        let deadline = self.next()?;
        if deadline > now {
            return None;
        }
        let Reverse((_, slot)) = self.heap.pop()?;
        self.armed[slot] = None;
        Some(slot)
    }

    fn rebuild(&mut self) {
        let armed = self.armed.iter().enumerate();
        self.heap = armed.filter_map(|(slot, at)| at.map(|at| Reverse((at, slot)))).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due(deadlines: &mut Deadlines, now: i64) -> Vec<usize> {
        std::iter::from_fn(|| deadlines.take_due(Micros(now))).collect()
    }

    #[test]
    fn the_soonest_of_each_slot_counts_once() {
        let mut deadlines = Deadlines::default();
        deadlines.set(3, Some(Micros(30)));
        deadlines.set(1, Some(Micros(20)));
        deadlines.set(3, Some(Micros(10)));
        deadlines.set(3, Some(Micros(40)));
        deadlines.set(0, None);
        assert_eq!(deadlines.next(), Some(Micros(10)));
        assert_eq!(due(&mut deadlines, 20), [3, 1]);
        assert_eq!(due(&mut deadlines, 100), Vec::<usize>::new());
        deadlines.set(3, Some(Micros(50)));
        deadlines.clear(3);
        assert_eq!(deadlines.next(), None);
    }

    #[test]
    fn deadlines_that_come_ever_nearer_take_no_more_room() {
        let mut deadlines = Deadlines::default();
        for at in (0..10_000).rev() {
            deadlines.set(0, Some(Micros(at)));
        }
        assert!(deadlines.heap.len() <= 64 + 4);
        assert_eq!(due(&mut deadlines, 0), [0]);
    }
}
