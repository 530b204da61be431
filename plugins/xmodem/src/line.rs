//! The line: answers that wait for room, timers.

use softplug_plugin::{Context, Micros, StateError, StateReader, StateWriter};

/// What time is kept for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Timer {
    /// The transfer: the next call, block, character or answer, or a clear line.
    Transfer,
    /// The call for a job.
    Request,
}

impl Timer {
    pub(crate) fn from_id(id: u8) -> Option<Self> {
        [Self::Transfer, Self::Request].get(usize::from(id)).copied()
    }
}

/// Answers that may wait for room.
const OWED: usize = 16;

#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Line {
    deadlines: [Option<Micros>; 2],
    /// Answers that have found no room, in order.
    owed: [u8; OWED],
    owed_length: u8,
}

impl Line {
    pub(crate) fn set_after(&mut self, link: &mut Context<'_>, timer: Timer, millis: i64) {
        let at = link.now() + Micros::from_millis(millis);
        self.set(link, timer, Some(at));
    }

    pub(crate) fn cancel(&mut self, link: &mut Context<'_>, timer: Timer) {
        self.set(link, timer, None);
    }

    pub(crate) fn is_set(&self, timer: Timer) -> bool {
        self.deadlines.get(timer as usize).is_some_and(Option::is_some)
    }

    fn set(&mut self, link: &mut Context<'_>, timer: Timer, at: Option<Micros>) {
        let Some(known) = self.deadlines.get_mut(timer as usize) else { return };
        if *known == at {
            return;
        }
        *known = at;
        match at {
            Some(at) => link.set_timer(timer as u8, at),
            None => link.cancel_timer(timer as u8),
        }
    }

    pub(crate) fn ran_out(&mut self, timer: Timer) {
        if let Some(known) = self.deadlines.get_mut(timer as usize) {
            *known = None;
        }
    }

    pub(crate) fn set_timers(&self, link: &mut Context<'_>) {
        for (id, at) in (0..).zip(self.deadlines) {
            if let Some(at) = at {
                link.set_timer(id, at);
            }
        }
    }

    /// Sends an answer; what finds no room waits for it, before all else.
    pub(crate) fn say(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        for byte in bytes {
            if self.owes_nothing() && link.transmit_room() > 0 {
                link.transmit(&[*byte]);
            } else if let Some(place) = self.owed.get_mut(usize::from(self.owed_length)) {
                *place = *byte;
                self.owed_length += 1;
            }
        }
    }

    pub(crate) fn owes_nothing(&self) -> bool {
        self.owed_length == 0
    }

    /// Nobody waits for an answer any more.
    pub(crate) fn forget_owed(&mut self) {
        self.owed_length = 0;
    }

    /// There is room again.
    pub(crate) fn pay(&mut self, link: &mut Context<'_>) {
        while !self.owes_nothing() && link.transmit_room() > 0 {
            link.transmit(&[self.owed[0]]);
            self.owed.rotate_left(1);
            self.owed_length -= 1;
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        for at in self.deadlines {
            state.deadline(at);
        }
        state.u8(self.owed_length);
        state.bytes(self.owed.get(..usize::from(self.owed_length)).unwrap_or_default());
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        let mut line =
            Self { deadlines: core::array::from_fn(|_| state.deadline()), ..Self::default() };
        line.owed_length = state.u8();
        let Some(owed) = line.owed.get_mut(..usize::from(line.owed_length)) else {
            return Err(StateError::DAMAGED);
        };
        softplug_plugin::copy(owed, state.bytes(usize::from(line.owed_length)));
        Ok(line)
    }
}
