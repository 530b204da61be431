//! The journal as it is shown.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::TimeMs;

/// An entry of the journal.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct JournalEntry {
    /// Its number, rising.
    pub number: u64,
    /// When.
    pub at_ms: TimeMs,
    /// What it is about.
    pub kind: JournalKind,
    /// The link.
    pub link: Option<String>,
    /// The job.
    pub job: Option<u32>,
    /// How much it matters.
    #[serde(default)]
    pub weight: JournalWeight,
    /// What happened, in a sentence.
    pub text: String,
}

/// How much an entry of the journal matters.
#[derive(
    Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum JournalWeight {
    /// As it should be.
    #[default]
    Normal,
    /// Somebody should look at it.
    Warning,
    /// Somebody must look at it.
    Alarm,
}

/// What an entry of the journal is about.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum JournalKind {
    /// The gateway started, stopped, or took a new configuration.
    Gateway,
    /// A port came, went, or has other settings than asked for.
    Port,
    /// A job changed its state.
    Job,
    /// Channels of a cell went on, waited for each other or handed an axis over.
    Cell,
    /// Something was received.
    Reception,
    /// A machine asked for something.
    Request,
    /// A plug-in was swapped.
    Swap,
    /// A plug-in failed, was started again or went into quarantine.
    Fault,
    /// A watchdog barked.
    Alarm,
    /// A plug-in or a program was added or removed.
    Library,
    /// A plug-in said something that matters.
    Note,
}

/// Which entries of the journal to list.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, IntoParams, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub struct JournalFilter {
    /// Of this link only.
    pub link: Option<String>,
    /// Of this kind only.
    #[param(inline)]
    pub kind: Option<JournalKind>,
    /// That matter at least so much; all if nothing is said.
    #[param(inline)]
    pub at_least: Option<JournalWeight>,
    /// Of this job only.
    #[param(format = "uint32", maximum = 4_294_967_295_u32)]
    pub job: Option<u32>,
    /// Only entries that have this in their text or their link's name; capital letters count as
    /// small ones.
    pub find: Option<String>,
    /// Written at this time or later, in milliseconds since 1970.
    #[param(format = "uint64")]
    pub since_ms: Option<u64>,
    /// Written before this time, in milliseconds since 1970.
    #[param(format = "uint64")]
    pub until_ms: Option<u64>,
    /// Only entries with a lower number than this one: the next page.
    #[param(format = "uint64")]
    pub before: Option<u64>,
    /// At most so many, the newest first; 100 if nothing is said, 1,000 at most.
    #[param(maximum = 1000)]
    pub limit: Option<u32>,
}
