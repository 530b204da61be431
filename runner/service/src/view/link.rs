//! A link as it is shown.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

use super::{JobBrief, PluginRef, ProbationView, SwapView, TimeMs};

/// A link: one machine's line with its plug-in.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, ToSchema)]
pub struct LinkView {
    /// Its name in `gateway.toml`.
    pub name: String,
    /// Where it stands, such as a hall or a cell: links of one group are shown together.
    #[serde(default)]
    pub group: Option<String>,
    /// What it is doing.
    pub state: LinkState,
    /// The state that the plug-in says it is in.
    pub condition: Option<String>,
    /// The port.
    pub port: PortView,
    /// The server endpoint, if it has one.
    pub endpoint: Option<EndpointView>,
    /// The plug-in that runs; none if none could be loaded.
    pub plugin: Option<PluginRef>,
    /// Settings as they were given; what is not here has its default.
    pub settings: BTreeMap<String, String>,
    /// The job that runs or is paused.
    pub job: Option<JobBrief>,
    /// The job that ended last; a reception is one, too.
    pub last: Option<JobBrief>,
    /// The newest of the jobs that ended otherwise than done and that nobody has acknowledged.
    pub unseen: Vec<JobBrief>,
    /// How many of these there are in all.
    pub unseen_count: u32,
    /// Jobs that wait behind it.
    pub queued: u32,
    /// What is being received.
    pub receiving: Option<ReceivingView>,
    /// Whether the machine holds the line, as far as is known: not while somebody has paused
    /// the job, nor before the machine has asked for it.
    pub is_held: bool,
    /// What was counted since the gateway started.
    pub counters: CountersView,
    /// The buffer between the server and the machine.
    pub buffer: BufferView,
    /// Why the port is down.
    pub down: Option<DownView>,
    /// What the watchdogs have found; empty if all is well.
    pub alarms: Vec<AlarmView>,
    /// The probation of the plug-in that runs.
    pub probation: Option<ProbationView>,
    /// The swap that waits, or the last one.
    pub swap: Option<SwapView>,
    /// Why the link is in quarantine.
    pub quarantine: Option<QuarantineView>,
    /// A change of the configuration that waits until the link is idle.
    pub is_change_waiting: bool,
    /// A plug-in that the configuration asks for and that was not taken.
    pub unapplied: Option<UnappliedView>,
    /// The folder whose files become jobs of the link, if it has one.
    pub drop: Option<DropView>,
    /// What is wrong with it, in sentences, the gravest first; empty if nothing is.
    pub trouble: Vec<String>,
}

/// What a link is doing.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinkState {
    /// The port is being opened for the first time.
    Opening,
    /// The port is open and nothing is under way.
    Idle,
    /// A job is being carried out.
    Sending,
    /// Something is being received.
    Receiving,
    /// The job is paused.
    Paused,
    /// The port is gone; it is tried again.
    Down,
    /// The plug-in has ended; it is started again.
    Restarting,
    /// The plug-in ended too often; someone has to look at it.
    Quarantined,
    /// It is being closed.
    Closing,
}

impl LinkState {
    /// Its name, as in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Opening => "opening",
            Self::Idle => "idle",
            Self::Sending => "sending",
            Self::Receiving => "receiving",
            Self::Paused => "paused",
            Self::Down => "down",
            Self::Restarting => "restarting",
            Self::Quarantined => "quarantined",
            Self::Closing => "closing",
        }
    }
}

/// A link's port.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct PortView {
    /// As it was written, such as `/dev/ttyUSB0` or `tcp://moxa:4001`.
    pub spec: String,
    /// The line, such as `19200 7E2`.
    pub line: String,
    /// What the port does by itself: `host`, `device`, `rts-cts`, `dsr-dtr` or `rs-485`.
    pub flow: String,
    /// What the port has set otherwise than it was asked to.
    pub differences: Vec<String>,
    /// The path at which the other side opens a `pty:` or where a simulated machine is.
    pub other_side: Option<String>,
}

/// A simulated lathe without a control.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct LatheView {
    /// The way of the tool and what is left of the blank, as an SVG document.
    pub picture: String,
    /// Where x stands, in mm of radius from where it began.
    pub x_mm: f64,
    /// Where z stands, in mm from where it began.
    pub z_mm: f64,
    /// Pulses that came, of both axes.
    pub pulses: u64,
    /// How often a period was missing inside a cut.
    pub gaps: u64,
    /// Pulses that were lost at a limit switch.
    pub lost_pulses: u64,
    /// Programs that have ended.
    pub programs: u32,
}

/// A link's server endpoint.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct EndpointView {
    /// Address on which it listens.
    pub listen: String,
    /// `raw` or `rfc2217`.
    pub kind: String,
    /// The client that is connected.
    pub client: Option<String>,
    /// Why it does not listen.
    pub failure: Option<String>,
}

/// A reception under way.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReceivingView {
    /// The name, as far as it is known.
    pub name: Option<String>,
    /// Bytes so far.
    pub bytes: u64,
    /// Since when.
    pub since_ms: TimeMs,
}

/// What a link counts.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct CountersView {
    /// Good bytes received.
    pub bytes_in: u64,
    /// Bytes that the port took.
    pub bytes_out: u64,
    /// Damaged characters, by kind: parity, framing, overrun, break, other.
    pub line_errors: BTreeMap<String, u64>,
    /// How often the machine has held the line.
    pub holds: u64,
    /// For how long in all.
    pub held_us: u64,
    /// How often the line stood still for a character or longer although bytes waited.
    pub gaps: u64,
    /// The longest of these times.
    pub longest_gap_us: u64,
    /// Characters that left after the machine had said stop.
    pub after_stop: u64,
    /// How often the buffer ran empty in the middle of a job.
    pub starved: u64,
    /// For how long in all.
    pub starved_us: u64,
    /// Events that the plug-in was given.
    pub events: u64,
    /// Units of fuel that it used for them.
    pub fuel: u64,
    /// How often the plug-in was started again after a fault.
    pub restarts: u64,
    /// How often the port was opened again.
    pub reopened: u64,
    /// Messages of the plug-in that were dropped because there were too many.
    pub notes_dropped: u64,
    /// What clients of the endpoint sent: jobs that have ended.
    pub endpoint_jobs: u64,
    /// Those of them that failed.
    pub endpoint_failed: u64,
    /// Bytes that the plug-in took of them.
    pub endpoint_bytes: u64,
}

/// The buffer between server and machine.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct BufferView {
    /// Bytes that it takes.
    pub size: u64,
    /// The low mark: under it the source is asked for more.
    pub low: u64,
    /// The high mark: up to it the source fills it.
    pub high: u64,
    /// Bytes in it.
    pub level: u64,
    /// The most that was ever in it.
    pub largest: u64,
    /// The least while a job ran and its source had more; none if none ran.
    pub smallest: Option<u64>,
}

/// Why a port is down.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct DownView {
    /// In a sentence.
    pub reason: String,
    /// Since when.
    pub since_ms: TimeMs,
    /// When it is tried again.
    pub retry_at_ms: Option<TimeMs>,
}

/// What a watchdog has found.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct AlarmView {
    /// `no-bytes`, `no-progress` or `stuck-held`.
    pub kind: String,
    /// In a sentence.
    pub text: String,
    /// Since when.
    pub since_ms: TimeMs,
}

/// A plug-in that the configuration asks for, on a link that goes on without it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct UnappliedView {
    /// As the configuration names it.
    pub plugin: String,
    /// Why it was not taken, in a sentence.
    pub text: String,
    /// Since when.
    pub since_ms: TimeMs,
}

/// A link's drop folder.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct DropView {
    /// Where it is.
    pub folder: String,
    /// Files that have not become jobs yet.
    pub waiting: u64,
    /// Files whose jobs have not ended yet.
    pub under_way: u64,
    /// What cannot be taken, as it is no file or may not be read.
    pub left_lying: u64,
    /// Why nothing is taken, or put away, in a sentence.
    pub trouble: Option<String>,
}

/// A fault of a plug-in.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultView {
    /// When.
    pub at_ms: TimeMs,
    /// The plug-in.
    pub plugin: PluginRef,
    /// The event that it was given.
    pub event: String,
    /// What it did, in a sentence.
    pub text: String,
    /// Its last words.
    pub last_words: Option<String>,
    /// The file with the trace that led there, for `softplug replay`.
    pub trace: Option<String>,
}

/// Why a link is in quarantine.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct QuarantineView {
    /// Since when.
    pub since_ms: TimeMs,
    /// The faults that led there, the last one last.
    pub faults: Vec<FaultView>,
    /// The plug-in that ran before the one that failed, and ran well.
    #[serde(default)]
    pub ran_well: Option<PluginRef>,
}
