//! Messages that wait until the session has room for them.

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use softplug_unit_protocol::{Encode, Encoded, Session};

/// Frames that may be under way to the server.
pub(crate) const FRAMES: usize = 4;
/// Bytes of payload of a frame, both ways.
pub(crate) const PAYLOAD_BYTES: usize = 1_024;

/// Most messages that wait. What only people read is left out beyond them.
const MOST: usize = 16;
/// Past so many messages the other side asks for more than it takes.
const FLOOD: usize = 64;

/// Messages that wait, and whether there is anybody to tell.
#[derive(Default)]
pub(crate) struct Outbox {
    waiting: VecDeque<Box<[u8]>>,
    pub(crate) is_up: bool,
}

impl Outbox {
    /// A new session, or none: what waits means nothing any more.
    pub(crate) fn begin_anew(&mut self, is_up: bool) {
        self.waiting.clear();
        self.is_up = is_up;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    pub(crate) fn is_flooded(&self) -> bool {
        self.waiting.len() > FLOOD
    }

    /// Whether what only people read would be left out.
    pub(crate) fn is_busy(&self) -> bool {
        self.waiting.len() >= MOST
    }

    pub(crate) fn say(&mut self, message: &impl Encode) {
        if !self.is_up {
            return;
        }
        let mut buffer = [0; PAYLOAD_BYTES];
        // Texts and fields are cut to what fits before they come here.
        if let Ok(length) = message.encode(&mut buffer) {
            self.waiting.push_back(buffer[..length].into());
        }
    }

    pub(crate) fn remark(&mut self, message: &impl Encode) {
        if !self.is_busy() {
            self.say(message);
        }
    }

    /// Gives the session what it has room for.
    pub(crate) fn pump(&mut self, session: &mut Session<FRAMES, PAYLOAD_BYTES>) {
        while let Some(message) = self.waiting.front()
            && session.has_room(message.len())
            && session.send(&Encoded(message)).is_ok()
        {
            self.waiting.pop_front();
        }
    }
}
