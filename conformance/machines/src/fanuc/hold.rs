//! The host held by DC3: how often, how long, and what came then.

use softplug_abi::Micros;

use crate::kept::Counts;

/// All holds of a control.
#[derive(Debug, Default)]
pub(super) struct Hold {
    since: Option<Micros>,
    /// Time of the holds that have ended.
    ended: Micros,
    characters: Vec<u32>,
    current: u32,
}

impl Hold {
    /// DC3 has left; a repeated one changes nothing.
    pub(super) fn begin(&mut self, at: Micros) {
        if self.since.is_none() {
            self.since = Some(at);
            self.current = 0;
        }
    }

    /// DC1 has left, or the reading is over.
    pub(super) fn end(&mut self, at: Micros) {
        if let Some(since) = self.since.take() {
            self.ended = self.ended + (at - since);
            self.characters.push(self.current);
        }
    }

    /// A character ended; the characters of this hold so far. One that ended
    /// together with DC3 was in time.
    pub(super) fn character(&mut self, at: Micros) -> u32 {
        if self.since.is_none_or(|since| at <= since) {
            return 0;
        }
        self.current += 1;
        self.current
    }

    pub(super) fn total(&self, now: Micros) -> Micros {
        self.ended + self.since.map_or(Micros::ZERO, |since| now - since)
    }

    pub(super) fn count(&self) -> u32 {
        self.characters.len() as u32 + u32::from(self.since.is_some())
    }

    pub(super) fn characters(&self) -> Counts {
        let mut counts = self.characters.clone();
        counts.extend(self.since.map(|_| self.current));
        Counts(counts)
    }
}
