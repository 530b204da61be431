//! The line: parity, single characters, the control's hold, timers.

use crate::settings::{Parity, Settings};
use softplug_plugin::{Context, Micros, StateError, StateReader, StateWriter};

/// What time is kept for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Timer {
    /// Silence inside a frame.
    Character,
    /// The answer to a block.
    Answer,
    /// The next block.
    Block,
    /// The job for a request, or the request for a job.
    Job,
}

impl Timer {
    pub(crate) fn from_id(id: u8) -> Option<Self> {
        [Self::Character, Self::Answer, Self::Block, Self::Job].get(usize::from(id)).copied()
    }
}

/// Answers that may wait for room.
const OWED: usize = 16;

#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Line {
    held: bool,
    deadlines: [Option<Micros>; 4],
    /// Answers that have found no room, in order.
    owed: [u8; OWED],
    owed_length: u8,
}

impl Line {
    pub(crate) fn is_held(&self) -> bool {
        self.held
    }

    pub(crate) fn hold(&mut self, link: &mut Context<'_>) {
        if !self.held {
            self.held = true;
            link.hold();
        }
    }

    pub(crate) fn release(&mut self, link: &mut Context<'_>) {
        if self.held {
            self.held = false;
            link.release();
        }
    }

    pub(crate) fn set_after(&mut self, link: &mut Context<'_>, timer: Timer, millis: i64) {
        let at = link.now() + Micros::from_millis(millis);
        self.set(link, timer, Some(at));
    }

    pub(crate) fn cancel(&mut self, link: &mut Context<'_>, timer: Timer) {
        self.set(link, timer, None);
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

    /// Sends a single character; one that finds no room waits for it, before all else.
    pub(crate) fn say(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        if self.owes_nothing() && link.transmit_room() > 0 {
            link.transmit(&[spoken(settings, byte)]);
        } else {
            self.owe(byte);
        }
    }

    /// The control asks again for what is missed even here.
    pub(crate) fn owe(&mut self, byte: u8) {
        if let Some(place) = self.owed.get_mut(usize::from(self.owed_length)) {
            *place = byte;
            self.owed_length += 1;
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
    pub(crate) fn pay(&mut self, link: &mut Context<'_>, settings: &Settings) {
        while !self.owes_nothing() && link.transmit_room() > 0 {
            link.transmit(&[spoken(settings, self.owed[0])]);
            self.owed.rotate_left(1);
            self.owed_length -= 1;
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.bool(self.held);
        for at in self.deadlines {
            state.deadline(at);
        }
        state.u8(self.owed_length);
        state.bytes(self.owed.get(..usize::from(self.owed_length)).unwrap_or_default());
    }

    /// Before format 3 answers did not wait.
    pub(crate) fn restore(format: u16, state: &mut StateReader<'_>) -> Result<Self, StateError> {
        let mut line = Self {
            held: state.bool(),
            deadlines: core::array::from_fn(|_| state.deadline()),
            ..Self::default()
        };
        let owed = if format < 3 { 0 } else { usize::from(state.u8()) };
        if owed > OWED {
            return Err(StateError::DAMAGED);
        }
        for byte in state.bytes(owed) {
            line.owe(*byte);
        }
        Ok(line)
    }
}

/// The seven bits of a character; `None` if its parity is wrong.
pub(crate) fn heard(settings: &Settings, byte: u8) -> Option<u8> {
    let is_good = match settings.parity {
        Parity::Port => byte < 0x80,
        Parity::Even => byte.count_ones().is_multiple_of(2),
    };
    is_good.then_some(byte & 0x7F)
}

/// A character as it goes on the line.
pub(crate) fn spoken(settings: &Settings, byte: u8) -> u8 {
    let is_odd = settings.parity == Parity::Even && !byte.count_ones().is_multiple_of(2);
    byte | if is_odd { 0x80 } else { 0 }
}
