//! What lanes tell.

use softplug_abi::{DeliveryId, Failure, JobId, LinkDownReason, Micros, NoteLevel, RequestId};
use std::os::fd::OwnedFd;
use std::path::PathBuf;

use super::endpoint::EndpointNews;
use super::fault::LaneFault;
use super::job_end::JobEnd;
use super::swap::SwapReport;
use crate::port::SettingDifference;
use crate::reservoir::ReservoirReader;

/// What a lane tells. Never about single bytes: these are in its
/// [status](super::LaneStatus) and, while somebody watches, in what is
/// [seen](super::Seen).
#[derive(Debug)]
pub enum Report {
    /// The port is open.
    Opened {
        /// The device, where there is one.
        path: Option<PathBuf>,
        /// Settings that it did not take, as far as it can be used so.
        differences: Vec<SettingDifference>,
    },
    /// The plug-in knows that the port is open.
    Up,
    /// The lane is closed, and this keeps its device open, as it is.
    HandedOver(OwnedFd),
    /// The port is lost, or could not be opened.
    Down {
        /// Why, as the plug-in is told.
        reason: LinkDownReason,
        /// Why, in words.
        detail: String,
        /// Settings that it did not take, if that is why.
        differences: Vec<SettingDifference>,
        /// When it is tried again.
        retry_in: Micros,
    },
    /// A job has ended.
    JobEnded(JobEnd),
    /// The job's check was good: its data is needed again, from the start.
    Rewind {
        /// The job.
        job: JobId,
    },
    /// Something comes from the machine.
    DeliveryBegun {
        /// The plug-in's id for it.
        delivery: DeliveryId,
        /// The job that it answers.
        job: Option<JobId>,
        /// The identity of the unit that has numbered it, and says it again until it is stored;
        /// `None`: it came on a port of this computer.
        unit: Option<u64>,
        /// Its bytes, to be put away. Reading makes room; dropping it drops what
        /// is still to come. It is stored when this is dropped.
        bytes: ReservoirReader,
    },
    /// Its name was found.
    DeliveryNamed {
        /// The delivery.
        delivery: DeliveryId,
        /// The name, as the machine gave it.
        name: String,
    },
    /// It is over.
    DeliveryEnded {
        /// The delivery.
        delivery: DeliveryId,
        /// `None`: complete.
        failure: Option<Failure>,
        /// The protocol's own code, 0 without.
        status: u16,
        /// How many bytes it has.
        bytes: u64,
    },
    /// The machine asks for something.
    Request {
        /// Its id, for the answer.
        request: RequestId,
        /// Place of its kind in the manifest.
        kind: u16,
        /// Its fields as value records.
        fields: Vec<u8>,
    },
    /// It no longer does.
    Withdrawn {
        /// Its id.
        request: RequestId,
    },
    /// The plug-in says something. Some are left out if there are too many; the
    /// status counts them.
    Note {
        /// How grave it is.
        level: NoteLevel,
        /// Its code in the manifest.
        code: u16,
        /// Its text.
        text: String,
    },
    /// The state that the plug-in is in. Some are left out if there are too many,
    /// never the latest for long.
    State(String),
    /// A watchdog, or its end.
    Alarm(Alarm),
    /// What came of a swap.
    Swapped(SwapReport),
    /// The plug-in has ended. The port stays open, nothing is read or sent.
    Fault(Box<LaneFault>),
    /// From the endpoint.
    Endpoint(EndpointNews),
    /// The lane has ended, its port is closed.
    Removed,
}

/// A watchdog has struck, or what it complained of is over.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Alarm {
    /// Which.
    pub kind: AlarmKind,
    /// Raised, or over.
    pub raised: bool,
}

/// What a watchdog watches.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum AlarmKind {
    /// Nothing comes from the line.
    NoBytes,
    /// A job does not get on.
    NoProgress,
    /// The partner holds us.
    StuckHeld,
}

impl AlarmKind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::NoBytes, Self::NoProgress, Self::StuckHeld];

    /// Its name, as metrics and interfaces have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoBytes => "no-bytes",
            Self::NoProgress => "no-progress",
            Self::StuckHeld => "stuck-held",
        }
    }
}
