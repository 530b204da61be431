//! The line: answers that wait for room, timers.

use crate::packet::Packet;
use crate::terms::Terms;
use softplug_plugin::{Context, Micros, StateError, StateReader, StateWriter, copy};

/// What time is kept for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Timer {
    /// The transfer: the next packet, character or answer.
    Transfer,
    /// The answer to the first packet of a job, or the job that was granted.
    Begin,
}

impl Timer {
    pub(crate) fn from_id(id: u8) -> Option<Self> {
        [Self::Transfer, Self::Begin].get(usize::from(id)).copied()
    }
}

/// Characters of answers that may wait for room.
const OWED: usize = 160;

#[derive(Copy, Clone, Debug)]
pub(crate) struct Line {
    deadlines: [Option<Micros>; 2],
    /// Answers that have found no room, in order.
    owed: [u8; OWED],
    owed_length: u8,
}

impl Line {
    pub(crate) const fn new() -> Self {
        Self { deadlines: [None; 2], owed: [0; OWED], owed_length: 0 }
    }

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

    /// Sends an answer; what finds no room waits for it, before all else. One that cannot wait as
    /// a whole is not sent.
    pub(crate) fn say(
        &mut self,
        link: &mut Context<'_>,
        terms: &Terms,
        kind: u8,
        number: u8,
        data: &[u8],
    ) {
        let mut packet = Packet::new();
        packet.clear();
        packet.push(data);
        packet.finish(kind, number, terms.check, crate::packet::SHORT);
        let mut answer = [terms.pad; OWED];
        let padding = usize::from(terms.padding);
        let packet = packet.as_slice();
        let end = padding + packet.len();
        copy(answer.get_mut(padding..).unwrap_or_default(), packet);
        copy(answer.get_mut(end..).unwrap_or_default(), &[terms.end]);
        let place = usize::from(self.owed_length);
        if let Some(own) = self.owed.get_mut(place..place + end + 1) {
            copy(own, answer.get(..end + 1).unwrap_or_default());
            self.owed_length += (end + 1) as u8;
        }
        self.pay(link);
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
        let count = usize::from(self.owed_length).min(link.transmit_room() as usize);
        if count > 0 {
            link.transmit(self.owed.get(..count).unwrap_or_default());
            self.owed.rotate_left(count);
            self.owed_length -= count as u8;
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
            Self { deadlines: core::array::from_fn(|_| state.deadline()), ..Self::new() };
        line.owed_length = state.u8();
        let Some(owed) = line.owed.get_mut(..usize::from(line.owed_length)) else {
            return Err(StateError::DAMAGED);
        };
        copy(owed, state.bytes(usize::from(line.owed_length)));
        Ok(line)
    }
}
