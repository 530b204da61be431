//! Looking at what passes on a line, live.

use softplug_abi::{LineErrorKind, Micros, ModemLines};
use std::sync::mpsc::{SyncSender, TrySendError};

/// Somebody who looks. The lane never waits: what finds the channel full is
/// dropped and counted in the lane's status.
#[derive(Debug)]
pub struct Watch {
    /// Where to.
    pub to: SyncSender<Seen>,
}

impl Watch {
    /// Whether it was taken; `None` if nobody looks any more.
    pub(super) fn show(&self, seen: Seen) -> Option<bool> {
        match self.to.try_send(seen) {
            Ok(()) => Some(true),
            Err(TrySendError::Full(_)) => Some(false),
            Err(TrySendError::Disconnected(_)) => None,
        }
    }
}

/// Something that passed on the line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Seen {
    /// When, on the lane's clock.
    pub at: Micros,
    /// What.
    pub what: WatchEvent,
}

/// What passed on the line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum WatchEvent {
    /// Bytes from the machine.
    Heard(Vec<u8>),
    /// Bytes to the machine, as the port took them.
    Sent(Vec<u8>),
    /// A damaged character, an overrun, a break.
    LineError {
        /// Which kind.
        kind: LineErrorKind,
        /// The character, if there was one.
        byte: Option<u8>,
    },
    /// The modem lines: which there are, and those that are on.
    ModemLines(ModemLines, ModemLines),
    /// The plug-in holds what is to be sent.
    Held,
    /// It no longer does.
    Released,
    /// The plug-in's state.
    State(String),
}
