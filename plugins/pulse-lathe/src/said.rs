//! What the machine is told past the queue: holds and stops.

use crate::codes;
use softplug_plugin::{Context, MarkId, MarkState, StateReader, StateWriter};

/// The marks of a hold and of a stop: the queue's own count up from 1.
const HOLD: MarkId = MarkId(u32::MAX);
const STOP: MarkId = MarkId(u32::MAX - 1);
/// So many of each wait to leave at most: more would not fit the link.
const MOST: u8 = 8;

/// How many holds and stops wait to leave.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Said {
    holds: u8,
    stops: u8,
}

impl Said {
    /// Where so many wait already, those do for it.
    pub(crate) fn hold(&mut self, link: &mut Context<'_>) {
        say(&mut self.holds, link, HOLD, codes::HOLD);
    }

    /// As a hold, but counted for itself: it leaves behind however many holds.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>) {
        say(&mut self.stops, link, STOP, codes::STOP);
    }

    /// News of a mark; whether it is one of these.
    pub(crate) fn marked(&mut self, mark: MarkId, state: MarkState) -> bool {
        let waiting = match mark {
            HOLD => &mut self.holds,
            STOP => &mut self.stops,
            _ => return false,
        };
        // It is told of twice, and has left the link's queue by the first time.
        *waiting = waiting.saturating_sub(u8::from(state != MarkState::SurelyLeft));
        true
    }

    pub(crate) fn save(self, state: &mut StateWriter<'_>) {
        state.u8(self.holds);
        state.u8(self.stops);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        Self { holds: state.u8(), stops: state.u8() }
    }
}

fn say(waiting: &mut u8, link: &mut Context<'_>, mark: MarkId, code: u8) {
    if *waiting < MOST {
        *waiting += 1;
        link.transmit_urgent_marked(mark, &[code]);
    }
}
