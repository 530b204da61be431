//! A job as it is shown, and as it is ordered.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::{IntoParams, ToSchema};

use super::TimeMs;

/// A job.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Its number; never used again.
    pub id: u32,
    /// The link.
    pub link: String,
    /// The kind, as the plug-in's manifest names it: `send`, `read`, `write` …; `receive` for what
    /// the machine sends of its own accord.
    pub kind: String,
    /// How far it is.
    pub state: JobState,
    /// Who wanted it.
    pub origin: JobOrigin,
    /// The program.
    pub program: Option<String>,
    /// The name that the program says of itself in its text, such as `O1234`, where it is another
    /// than its file's.
    #[serde(default)]
    pub named: Option<String>,
    /// Its fields.
    pub fields: BTreeMap<String, String>,
    /// Jobs of a higher priority come first.
    pub priority: i32,
    /// How far it is.
    #[serde(flatten)]
    pub progress: JobProgress,
    /// The byte of the program at which it begins.
    pub start_byte: u64,
    /// The block at which it begins, counted from 1; 1 is the program's first.
    pub start_block: u64,
    /// Bytes that have left for it on the line, as the plug-in counts; known when it has ended.
    pub sent: u64,
    /// The last block that has surely left as a whole.
    pub last_block: Option<u64>,
    /// When it was ordered.
    pub created_ms: TimeMs,
    /// When it began.
    pub started_ms: Option<TimeMs>,
    /// When it ended.
    pub ended_ms: Option<TimeMs>,
    /// Why it failed, as the ABI names it.
    pub failure: Option<String>,
    /// Why it failed in a sentence, with the protocol's own words.
    pub message: Option<String>,
    /// The fault that a check found in the program.
    pub check: Option<CheckFault>,
    /// The reception that holds what a job brought.
    pub answer: Option<String>,
    /// The job that this one is a restart of.
    pub restart_of: Option<u32>,
    /// It ended otherwise than done, and nobody has acknowledged that yet.
    pub is_unseen: bool,
}

/// How far a job is: the same numbers and words on the link, in the list of jobs, in what
/// happens, on the page and in the command.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct JobProgress {
    /// Bytes of data, if that is known.
    pub size: Option<u64>,
    /// Bytes of the program that the plug-in has taken, the ones before `start_byte` included.
    pub taken: u64,
    /// The program up to this byte has surely left.
    pub surely_left: u64,
    /// The program up to this byte may have left.
    pub maybe_left: u64,
    /// What has surely left, of a hundred.
    pub percent: Option<u8>,
    /// The machine holds the line in the middle of it. A job that somebody has paused is not held.
    pub is_held: bool,
    /// What the machine or its operator has to do before it goes on, in a sentence.
    pub awaits: Option<String>,
    /// Bytes that left in a second, over the last seconds; none while nothing moves.
    #[serde(default)]
    pub rate: Option<u64>,
    /// How long the rest takes at this rate, in microseconds; none while nobody knows.
    #[serde(default)]
    pub remaining_us: Option<u64>,
    /// The block of which not all has surely left: the one that is being sent.
    #[serde(default)]
    pub block: Option<BlockView>,
    /// All of this for people.
    pub text: String,
}

/// A block of a program: a line.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct BlockView {
    /// Its number, from 1.
    pub number: u64,
    /// How it begins.
    pub text: String,
}

/// A job in short, on its link.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobBrief {
    /// Its number.
    pub id: u32,
    /// The kind.
    pub kind: String,
    /// The program.
    pub program: Option<String>,
    /// How far it is.
    pub state: JobState,
    /// How far it is, in bytes and words.
    #[serde(flatten)]
    pub progress: JobProgress,
    /// Why it ended otherwise than done, in a sentence.
    pub message: Option<String>,
    /// When it ended.
    pub ended_ms: Option<TimeMs>,
}

/// How far a job is.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum JobState {
    /// It waits.
    Queued,
    /// It is being carried out.
    Running,
    /// Someone has paused it.
    Paused,
    /// Done: the last bit has left.
    Done,
    /// It has failed.
    Failed,
    /// Someone has aborted it.
    Aborted,
    /// The gateway, the plug-in or the port ended in the middle of it; it can be restarted at a block.
    Interrupted,
}

impl JobState {
    /// Its name, as in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Aborted => "aborted",
            Self::Interrupted => "interrupted",
        }
    }

    /// Whether nothing more happens to it by itself.
    pub const fn is_final(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Aborted | Self::Interrupted)
    }
}

/// Who wanted a job.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum JobOrigin {
    /// Someone at the API, the page or the command.
    #[default]
    Order,
    /// The operator at the machine's panel.
    Panel,
    /// The client of the link's endpoint.
    Endpoint,
    /// The machine, which sends of its own accord.
    Machine,
    /// Somebody who put a file into the link's drop folder.
    Drop,
}

/// A fault that a check found in a program.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CheckFault {
    /// Line, counted from 1; 0 if unknown.
    pub line: u32,
    /// Column, counted from 1; 0 if unknown.
    pub column: u32,
}

/// A job that is wanted.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JobOrder {
    /// The kind, as the plug-in's manifest names it; `send` if nothing is said.
    #[serde(default)]
    pub kind: Option<String>,
    /// The program, for kinds that send one.
    #[serde(default)]
    pub program: Option<String>,
    /// Fields of the job, as text.
    #[serde(default)]
    pub fields: BTreeMap<String, String>,
    /// Jobs of a higher priority come first; 0 if nothing is said.
    #[serde(default)]
    pub priority: i32,
    /// Begin at this block of the program, counted from 1.
    #[serde(default)]
    pub from_block: Option<u64>,
}

/// Which jobs to list.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, IntoParams, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub struct JobFilter {
    /// Of this link only.
    pub link: Option<String>,
    /// In this state only.
    #[param(inline)]
    pub state: Option<JobState>,
    /// Of this kind only, such as `send` or `receive`.
    pub kind: Option<String>,
    /// Only jobs whose program has this in its name; capital letters count as small ones.
    pub find: Option<String>,
    /// Ordered at this time or later, in milliseconds since 1970.
    #[param(format = "uint64")]
    pub since_ms: Option<u64>,
    /// Ordered before this time, in milliseconds since 1970.
    #[param(format = "uint64")]
    pub until_ms: Option<u64>,
    /// Only jobs with a lower number than this one: the next page.
    #[param(format = "uint32", maximum = 4_294_967_295_u32)]
    pub before: Option<u32>,
    /// At most so many, the newest first; 100 if nothing is said, 1,000 at most.
    #[param(maximum = 1000)]
    pub limit: Option<u32>,
}
