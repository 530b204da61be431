//! Marks: which byte each belongs to and how far it has come.

use alloc::collections::VecDeque;
use core::hash::{Hash, Hasher};
use softplug_abi::limits::MARKS;
use softplug_abi::{MarkId, MarkState};

/// Positions count bytes since the link began: in the queue, all that was ever
/// queued; on the wire, all that the port was ever given.
#[derive(Clone, Debug, Default)]
pub(crate) struct Marks {
    queued: VecDeque<(MarkId, u64)>,
    given: VecDeque<Given>,
    dropped: VecDeque<MarkId>,
}

#[derive(Clone, Debug)]
struct Given {
    mark: MarkId,
    wire: u64,
    maybe_reported: bool,
}

impl Marks {
    /// Whether one more may be outstanding.
    pub(crate) fn has_room(&self) -> bool {
        self.count() < MARKS
    }

    /// Marks that are outstanding.
    pub(crate) fn count(&self) -> usize {
        self.queued.len() + self.given.len() + self.dropped.len()
    }

    /// A mark on the queued byte that ends at `position`.
    pub(crate) fn queue(&mut self, mark: MarkId, position: u64) {
        self.queued.push_back((mark, position));
    }

    /// A mark on a byte that the port has, or will have as its `wire`th.
    pub(crate) fn give(&mut self, mark: MarkId, wire: u64) {
        self.given.push_back(Given { mark, wire, maybe_reported: false });
    }

    /// The port was given queued bytes up to `position`, the last as its `wire`th.
    pub(crate) fn taken(&mut self, position: u64, wire: u64) {
        while let Some((mark, at)) = self.queued.front().copied().filter(|(_, at)| *at <= position)
        {
            self.queued.pop_front();
            self.give(mark, wire - (position - at));
        }
    }

    /// Each mark by the bytes before it: in the queue from `queued` on, on the wire from `given` on.
    pub(crate) fn hash_ahead(&self, queued: u64, given: u64, state: &mut impl Hasher) {
        let Self { queued: waiting, given: gone, dropped } = self;
        (waiting.len(), gone.len()).hash(state);
        for (mark, position) in waiting {
            (mark, position.wrapping_sub(queued)).hash(state);
        }
        for Given { mark, wire, maybe_reported } in gone {
            (mark, wire.wrapping_sub(given), maybe_reported).hash(state);
        }
        dropped.hash(state);
    }

    /// This mark is no longer outstanding; or, if it is not known, one without a
    /// name.
    pub(crate) fn settle(&mut self, mark: MarkId) {
        for mark in [mark, MarkId::NONE] {
            if let Some(at) = self.queued.iter().position(|(known, _)| *known == mark) {
                self.queued.remove(at);
                return;
            }
            if let Some(at) = self.dropped.iter().position(|known| *known == mark) {
                self.dropped.remove(at);
                return;
            }
            if let Some(at) = self.given.iter().position(|given| given.mark == mark) {
                self.given.remove(at);
                return;
            }
        }
    }

    /// The queue was dropped.
    pub(crate) fn drop_queued(&mut self) {
        self.dropped.extend(self.queued.drain(..).map(|(mark, _)| mark));
    }

    /// Whether a byte that the port was given carries one.
    pub(crate) fn awaits_departures(&self) -> bool {
        !self.given.is_empty()
    }

    /// The next report, given how many characters maybe and surely have left.
    pub(crate) fn next_report(&mut self, maybe: u64, surely: u64) -> Option<(MarkId, MarkState)> {
        if let Some(mark) = self.dropped.pop_front() {
            return Some((mark, MarkState::Dropped));
        }
        if let Some(at) = self.given.iter().position(|given| given.wire <= surely) {
            let given = &mut self.given[at];
            if given.maybe_reported {
                let mark = given.mark;
                self.given.remove(at);
                return Some((mark, MarkState::SurelyLeft));
            }
            given.maybe_reported = true;
            return Some((given.mark, MarkState::MaybeLeft));
        }
        let given =
            self.given.iter_mut().find(|given| given.wire <= maybe && !given.maybe_reported)?;
        given.maybe_reported = true;
        Some((given.mark, MarkState::MaybeLeft))
    }
}
