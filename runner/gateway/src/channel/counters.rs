//! What a channel counts.

use softplug_abi::{LineErrorKind, Micros};

use crate::port::Input;

/// Counts since the link was opened.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Counters {
    /// Good bytes received.
    pub bytes_in: u64,
    /// Bytes that the port took.
    pub bytes_out: u64,
    /// Line errors, by [`LineErrorKind`] in the order of their codes.
    pub line_errors: [u64; LineErrorKind::ALL.len()],
    /// How often the transmit queue was held.
    pub holds: u64,
    /// How long it was held in all.
    pub held: Micros,
    /// Characters in flight, beyond recall, when it was held: in all.
    pub after_hold: u64,
    /// The most at one time.
    pub after_hold_most: u64,
    /// Since when it has been held.
    held_since: Option<Micros>,
}

impl Counters {
    /// Whether the transmit queue is held.
    pub fn is_held(&self) -> bool {
        self.held_since.is_some()
    }

    /// The counts at `now`, a hold that is under way included.
    pub(crate) fn at(mut self, now: Micros) -> Self {
        if let Some(since) = self.held_since {
            self.held = self.held + (now - since);
        }
        self
    }

    pub(crate) fn count_input(&mut self, input: &Input<'_>) {
        match input {
            Input::Bytes(bytes) => self.bytes_in += bytes.len() as u64,
            Input::LineError { kind, .. } => {
                self.line_errors[usize::from(kind.code()) - 1] += 1;
            }
        }
    }

    pub(crate) fn hold(&mut self, now: Micros, in_flight: u64) {
        if self.held_since.is_none() {
            self.after_hold += in_flight;
            self.after_hold_most = self.after_hold_most.max(in_flight);
            self.holds += 1;
            self.held_since = Some(now);
        }
    }

    pub(crate) fn release(&mut self, now: Micros) {
        if let Some(since) = self.held_since.take() {
            self.held = self.held + (now - since);
        }
    }
}
