//! What changes, as it happens; and what passes on a line.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{CellView, JobView, JournalEntry, LinkView};

/// Something has changed.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(tag = "change", rename_all = "kebab-case")]
pub enum Change {
    /// A link; at most a few times a second for each.
    Link(Box<LinkView>),
    /// A link is gone from the configuration.
    LinkRemoved {
        /// Its name.
        name: String,
    },
    /// A job.
    Job(Box<JobView>),
    /// A cell: somebody in it goes on, waits, or has an axis.
    Cell(Box<CellView>),
    /// A new entry of the journal.
    Journal(JournalEntry),
    /// The programs: list them again.
    Programs,
    /// The receptions of a link: list them again.
    Receptions {
        /// The link.
        link: String,
    },
    /// The library: list it again.
    Plugins,
    /// The gateway stops.
    Stopping,
}

/// What passes on a watched line, or what the plug-in made of it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct Seen {
    /// When, in microseconds on the link's clock.
    pub at_us: i64,
    /// What.
    #[serde(flatten)]
    pub what: SeenWhat,
    /// How much was not shown before this, because the watcher was too slow.
    pub dropped: u64,
}

/// What was seen.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(tag = "seen", rename_all = "kebab-case")]
pub enum SeenWhat {
    /// Bytes from the machine.
    Received {
        /// In hex, without gaps.
        hex: String,
    },
    /// Bytes to the machine, as the port took them.
    Sent {
        /// In hex, without gaps.
        hex: String,
    },
    /// A damaged character or a break.
    LineError {
        /// parity, framing, overrun or break.
        kind: String,
        /// The character as it was read, in hex.
        hex: Option<String>,
    },
    /// The plug-in stopped or let go its transmit queue.
    Held {
        /// Whether it stands.
        is_held: bool,
    },
    /// The modem lines.
    ModemLines {
        /// Those that are on.
        on: Vec<String>,
    },
    /// The plug-in says which state it is in.
    State {
        /// Its name.
        name: String,
    },
    /// The plug-in says something.
    Note {
        /// error, warning, info or debug.
        level: String,
        /// What.
        text: String,
    },
    /// Something else that the link did.
    Other {
        /// In a few words.
        text: String,
    },
}
