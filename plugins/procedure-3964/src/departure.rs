//! When the last byte that we queued has left the wire.

use softplug_plugin::{Context, MarkId, MarkState, State};

/// Marks that may be outstanding: well below the 64 that a host allows. A
/// partner that answers too early over and over could use them up.
const MOST_OUTSTANDING: u8 = 32;

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Stage {
    /// Nothing is watched, or it has left.
    #[default]
    None,
    /// A mark is to be set behind the queue.
    Wanted,
    /// It cannot have left yet.
    Marked,
    /// It may have left.
    MaybeLeft,
}

/// Watches one byte at a time.
#[derive(Clone, Debug, Default, State)]
pub(crate) struct Departure {
    stage: Stage,
    mark: MarkId,
    outstanding: u8,
}

impl Departure {
    /// Watches the byte that is the last of the queue when this event ends.
    pub(crate) fn watch(&mut self) {
        self.stage = Stage::Wanted;
    }

    /// Watches the same byte, which is queued again.
    pub(crate) fn watch_again(&mut self) {
        if self.is_pending() {
            self.watch();
        }
    }

    pub(crate) fn forget(&mut self) {
        self.stage = Stage::None;
    }

    /// Whether the byte has not left for certain.
    pub(crate) fn is_watching(&self) -> bool {
        self.stage != Stage::None
    }

    /// What comes now cannot be an answer to the byte.
    pub(crate) fn is_pending(&self) -> bool {
        matches!(self.stage, Stage::Wanted | Stage::Marked)
    }

    /// Sets the mark, at the end of an event.
    pub(crate) fn set_mark(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Wanted && self.outstanding < MOST_OUTSTANDING {
            self.mark = self.mark.next();
            self.outstanding += 1;
            self.stage = Stage::Marked;
            link.transmit_marked(self.mark, &[]);
        }
    }

    /// News of a mark; `Some` if it concerns the byte that is watched.
    pub(crate) fn reported(&mut self, mark: MarkId, state: MarkState) -> Option<MarkState> {
        if state != MarkState::MaybeLeft {
            self.outstanding = self.outstanding.saturating_sub(1);
        }
        if mark != self.mark || !matches!(self.stage, Stage::Marked | Stage::MaybeLeft) {
            return None;
        }
        self.stage = if state == MarkState::MaybeLeft { Stage::MaybeLeft } else { Stage::None };
        Some(state)
    }
}
