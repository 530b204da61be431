//! Gathers lines, delivers each to the host, and answers it.

use crate::buffer::Buffer;
use crate::{ACK, LF, NAK};
use softplug_plugin::{Context, MarkState, NoteLevel, StateError, StateReader, StateWriter};

/// Mark of every answer: it tells when one has left.
pub(crate) const ANSWER: u32 = 1;
/// Answers that may wait to leave at a time. The ABI allows 16 urgent bytes, and what comes from
/// the line must never make a plug-in break a rule.
const ANSWERS: u8 = 8;

#[derive(Debug)]
pub(crate) struct Receiver {
    line: Buffer,
    /// A character of the line is damaged, or it is too long.
    is_bad: bool,
    /// Answers that have not left yet.
    waiting: u8,
    /// Id of the latest delivery.
    delivery: u32,
}

impl Receiver {
    pub(crate) fn new() -> Self {
        Self {
            line: Buffer::new(),
            is_bad: false,
            waiting: 0,
            delivery: 0,
        }
    }

    /// A character of a line.
    pub(crate) fn take(&mut self, link: &mut Context<'_>, byte: u8) {
        if !self.line.push(byte) {
            self.is_bad = true;
        }
        if byte == LF {
            self.end(link);
            self.forget();
        }
    }

    /// One of the line's characters was damaged.
    pub(crate) fn damage(&mut self) {
        self.is_bad = true;
    }

    /// The line that has begun does not count.
    pub(crate) fn forget(&mut self) {
        self.line.clear();
        self.is_bad = false;
    }

    pub(crate) fn answer_left(&mut self, state: MarkState) {
        if state == MarkState::SurelyLeft {
            self.waiting -= 1;
        }
    }

    /// The line is whole: takes it if it is good and there is room.
    fn end(&mut self, link: &mut Context<'_>) {
        if self.waiting == ANSWERS {
            link.note(
                NoteLevel::Warning,
                0,
                "the other side does not wait for answers",
            );
            return;
        }
        let line = self.line.as_slice();
        let is_taken = !self.is_bad && line.len() <= link.delivery_room() as usize;
        if is_taken {
            self.delivery = self.delivery.wrapping_add(1).max(1);
            link.delivery_begin(self.delivery, 0);
            link.deliver(self.delivery, line);
            link.delivery_end(self.delivery, None, 0);
        }
        // Ahead of a line of ours that is on its way: the other side waits for it.
        link.transmit_urgent_marked(ANSWER, &[if is_taken { ACK } else { NAK }]);
        self.waiting += 1;
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        self.line.save(state);
        state.bool(self.is_bad);
        state.u8(self.waiting);
        state.u32(self.delivery);
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.line.restore(state)?;
        self.is_bad = state.bool();
        self.waiting = state.u8();
        self.delivery = state.u32();
        if self.waiting <= ANSWERS {
            Ok(())
        } else {
            Err(StateError::DAMAGED)
        }
    }
}
