//! Messages that wait until the session has room for them.

use std::collections::VecDeque;

use softplug_unit_protocol::{Encode, Encoded, PAYLOAD, Session};

/// Most messages that wait. What is said beyond them is said again in the next session, or is
/// something that only people read.
const MOST: usize = 512;
/// Past so many messages the other side asks for more than it takes.
const FLOOD: usize = 8_192;

/// Messages that wait until the session has room for them.
///
/// ```
/// use softplug_unit_protocol::{Identity, Role, Session, ToUnit};
/// use softplug_unit_uplink::Outbox;
///
/// let mut outbox = Outbox::default();
/// outbox.push(&ToUnit::Query {}, false);
/// let mut session = Session::<4, 256>::new(Role::Server, Identity(1));
/// // There is no session yet: it waits.
/// outbox.pump(&mut session);
/// assert!(!outbox.is_empty());
/// ```
#[derive(Debug)]
pub struct Outbox {
    waiting: VecDeque<Box<[u8]>>,
    longest: usize,
}

impl Default for Outbox {
    fn default() -> Self {
        Self { waiting: VecDeque::new(), longest: PAYLOAD }
    }
}

impl Outbox {
    /// A session has begun, in which the other side takes messages of so many bytes, head included. What waits means
    /// nothing any more.
    pub fn begin(&mut self, longest: usize) {
        self.clear();
        self.longest = longest.min(PAYLOAD);
    }

    /// The most bytes of a message, its head included.
    pub fn longest(&self) -> usize {
        self.longest
    }

    /// Forgets what waits: in another session it means nothing.
    pub fn clear(&mut self) {
        self.waiting.clear();
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Whether so many wait that the session had better end: the other side asks, and takes nothing.
    pub fn is_flooded(&self) -> bool {
        self.waiting.len() > FLOOD
    }

    /// How many messages wait.
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Appends a message; with `may_be_left_out`, not if many wait.
    pub fn push(&mut self, message: &impl Encode, may_be_left_out: bool) {
        if may_be_left_out && self.waiting.len() >= MOST {
            return;
        }
        let mut buffer = [0; PAYLOAD];
        match message.encode(&mut buffer[..self.longest]) {
            Ok(length) => self.waiting.push_back(buffer[..length].into()),
            Err(error) => tracing::error!(%error, "a message is longer than a frame"),
        }
    }

    /// Gives the session what it has room for.
    pub fn pump<const SLOTS: usize, const BYTES: usize>(
        &mut self,
        session: &mut Session<SLOTS, BYTES>,
    ) {
        while let Some(message) = self.waiting.front()
            && session.has_room(message.len())
        {
            match session.send(&Encoded(message)) {
                Ok(()) => drop(self.waiting.pop_front()),
                Err(error) => {
                    tracing::error!(%error, "a message cannot be sent");
                    return;
                }
            }
        }
    }
}
