//! The spindle: it turns, and tells its angle.

use softplug_abi::Micros;

/// How often the angle is told.
const BEAT: Micros = Micros::from_millis(2);
/// Increments of one character at most.
const MOST: u64 = 63;
const INDEX: u8 = 0x40;
const MINUTE: u64 = 60_000_000;

#[derive(Debug)]
pub(super) struct Spindle {
    /// Increments of a turn.
    increments: u64,
    /// Turns a minute.
    speed: u64,
    /// When the angle is told next, while it turns.
    next: Option<Micros>,
    /// Increments since the index mark, and what is left over in parts of a minute's.
    since_mark: u64,
    rest: u64,
}

impl Spindle {
    pub(super) fn new(increments: u64) -> Self {
        Self { increments, speed: 0, next: None, since_mark: 0, rest: 0 }
    }

    pub(super) fn turns(&self) -> bool {
        self.speed > 0
    }

    pub(super) fn next(&self) -> Option<Micros> {
        self.next
    }

    pub(super) fn set_speed(&mut self, now: Micros, turns_a_minute: u64) {
        self.speed = turns_a_minute;
        self.next = match (self.next, turns_a_minute) {
            (_, 0) => None,
            (next, _) => next.or(Some(now + BEAT)),
        };
    }

    /// The characters of the beat that is due: none goes over the index mark.
    pub(super) fn turned(&mut self, now: Micros) -> Option<(Micros, Vec<u8>)> {
        let at = self.next.filter(|at| *at <= now)?;
        self.next = Some(at + BEAT);
        let sum = self.rest + self.speed * self.increments * BEAT.0.unsigned_abs();
        self.rest = sum % MINUTE;
        let mut left = sum / MINUTE;
        let mut characters = Vec::new();
        while left > 0 {
            let to_mark = self.increments - self.since_mark;
            let count = left.min(MOST).min(to_mark);
            left -= count;
            self.since_mark = (self.since_mark + count) % self.increments;
            characters.push(count as u8 | if self.since_mark == 0 { INDEX } else { 0 });
        }
        Some((at, characters))
    }
}
