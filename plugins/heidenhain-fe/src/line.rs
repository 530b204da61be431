//! The line: parity, single characters, the control's hold, timers.

use crate::settings::{Parity, Settings};
use softplug_plugin::{Context, Micros, StateReader, StateWriter};

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

#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Line {
    held: bool,
    deadlines: [Option<Micros>; 4],
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

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.bool(self.held);
        for at in self.deadlines {
            state.deadline(at);
        }
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        let held = state.bool();
        Self { held, deadlines: core::array::from_fn(|_| state.deadline()) }
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

/// Sends a single character; what finds no room is missed by the control, which asks again.
pub(crate) fn say(link: &mut Context<'_>, settings: &Settings, byte: u8) {
    if link.transmit_room() > 0 {
        link.transmit(&[spoken(settings, byte)]);
    }
}
