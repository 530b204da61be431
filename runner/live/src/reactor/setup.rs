//! What a lane is made with, and what it may be told.

use softplug_abi::manifest::SettingValues;
use softplug_abi::{Failure, JobId, Micros, RequestId};
use softplug_link::Job;
use std::fmt;

use super::endpoint::LaneEndpoint;
use super::swap::Swap;
use super::watch::Watch;
use crate::channel::StationOptions;
use crate::port::{PortOptions, PortSpec};
use crate::reservoir::ReservoirReader;

/// Which lane; chosen by whoever adds it, and never used twice.
#[derive(Copy, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub struct LaneId(pub u32);

impl fmt::Display for LaneId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "lane {}", self.0)
    }
}

/// A link to drive. Its port is opened by the reactor, and again whenever it is
/// lost; the plug-in's link opens when the port first does.
#[derive(Debug)]
pub struct LaneSetup<I> {
    /// Which port.
    pub port: PortSpec,
    /// How to open it.
    pub port_options: PortOptions,
    /// Settings of the plug-in, pacing and rooms.
    pub station: StationOptions,
    /// The plug-in.
    pub instance: I,
    /// Where other software comes in.
    pub endpoint: Option<LaneEndpoint>,
    /// After what to raise an alarm.
    pub watchdogs: Watchdogs,
    /// How often to try again for a port.
    pub reopen: Backoff,
    /// Bytes of flight recording that are kept.
    pub recorder_bytes: usize,
}

/// After what a lane raises an alarm; `None`: never.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Watchdogs {
    /// Nothing has come from the line for so long.
    pub no_bytes: Option<Micros>,
    /// A job is under way, and for so long nothing of it was taken and nothing has
    /// left.
    pub no_progress: Option<Micros>,
    /// The partner has held us for so long without a break.
    pub stuck_held: Option<Micros>,
}

/// Spans between attempts: the first, then twice as long each time, up to the
/// longest.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Backoff {
    /// After the first failure.
    pub first: Micros,
    /// Never longer than this.
    pub longest: Micros,
}

impl Default for Backoff {
    /// From a quarter of a second to ten seconds.
    fn default() -> Self {
        Self { first: Micros::from_millis(250), longest: Micros::from_millis(10_000) }
    }
}

impl Backoff {
    /// How long to wait after so many failures in a row, from 1.
    pub fn after(&self, failures: u32) -> Micros {
        let doubled = failures.saturating_sub(1).min(32);
        let span = self.first.0.max(1_000).saturating_mul(1_i64 << doubled);
        Micros(span.min(self.longest.0.max(self.first.0)))
    }
}

/// What a lane may be told. Nothing of it is answered at once; what comes of it
/// is in the [reports](super::Report).
#[derive(Debug)]
pub enum Command<I> {
    /// Begin a job.
    Begin(Feed),
    /// Ask for a pause of the job.
    Pause(JobId),
    /// End the pause.
    Resume(JobId),
    /// Abort the job, or, with [`JobId::NONE`], the delivery under way.
    Abort(JobId),
    /// Go on although the partner holds the line.
    ForceResume,
    /// The data of the job from the start, after [`Report::Rewind`](super::Report::Rewind).
    Refill {
        /// The job.
        job: JobId,
        /// Its data.
        source: ReservoirReader,
    },
    /// Answer a request: with data, or with why it is refused.
    Answer {
        /// The request.
        request: RequestId,
        /// The answer.
        answer: Result<Vec<u8>, Failure>,
    },
    /// Put another plug-in in the place of the running one.
    Swap(Swap<I>),
    /// Give up a swap that waits: it is told as refused. Without one nothing happens.
    CancelSwap,
    /// End the plug-in at once, whatever it is doing: it is called no more, and told as at fault,
    /// with this sentence. The port stays open, nothing is read or sent.
    Halt(String),
    /// Put a plug-in in the place of one that has ended by a fault. The port
    /// stays open.
    Replace {
        /// The plug-in.
        instance: I,
        /// A value for every setting of it.
        settings: SettingValues,
    },
    /// Show, or no longer show, what passes on the line.
    Watch(Option<Watch>),
    /// Close the port and open it again.
    Reopen,
    /// Let what was given to the port leave, then close and end the lane.
    Close {
        /// How long that may take.
        patience: Micros,
        /// Another process is to open the port next:
        /// [`Report::HandedOver`](super::Report::HandedOver) keeps a device open meanwhile.
        hand_over: bool,
    },
}

/// A job and where its data comes from.
#[derive(Debug)]
pub struct Feed {
    /// The job; its id is below [`ENDPOINT_JOBS`](super::ENDPOINT_JOBS).
    pub job: Job,
    /// Its data.
    pub source: ReservoirReader,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_double_up_to_the_longest() {
        let backoff = Backoff::default();
        let spans = [1, 2, 3, 6, 7, 1_000].map(|failures| backoff.after(failures).0 / 1_000);
        assert_eq!(spans, [250, 500, 1_000, 8_000, 10_000, 10_000]);
    }
}
