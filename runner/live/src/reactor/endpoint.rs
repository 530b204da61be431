//! Where other software reaches a lane: what the lane asks of an endpoint. The
//! endpoints themselves are in [`crate::endpoint`].

use mio::Registry;
use mio::event::Event;
use softplug_abi::{JobId, LineErrorKind, LineParameters, Micros, ModemLines};
use softplug_link::Supply;
use std::fmt::Debug;
use std::io;
use std::net::SocketAddr;
use std::ops::Range;

use super::job_end::JobOutcome;

/// Jobs with this id and above are an endpoint's.
pub const ENDPOINT_JOBS: JobId = JobId(0x8000_0000);

/// An endpoint on a lane.
#[derive(Debug)]
pub struct LaneEndpoint {
    /// The endpoint.
    pub endpoint: Box<dyn Endpoint>,
    /// Place in the manifest of the kind of job that what comes in becomes.
    pub job_kind: u16,
    /// That job's fields as value records.
    pub fields: Vec<u8>,
    /// Feed such a job once as a check. Only for an endpoint that keeps what it
    /// supplied and can [rewind](Endpoint::rewind).
    pub check: bool,
}

/// A listener and at most one client. A lane owns it and calls it on its own
/// thread; nothing here may block.
///
/// What the client sends becomes the data of jobs; what the plug-in delivers
/// goes to the client. All sources are registered edge-triggered: the endpoint
/// keeps for itself what it has not read or written to the end.
pub trait Endpoint: Debug + Send {
    /// Registers what it has. The tokens are its own; `tokens.start` for the
    /// listener, the others as it likes.
    fn attach(&mut self, registry: &Registry, tokens: Range<usize>) -> io::Result<()>;

    /// Takes back what it has registered and keeps it: it is attached again, on
    /// another thread.
    fn leave(&mut self, registry: &Registry);

    /// Something came for one of the tokens.
    fn ready(&mut self, registry: &Registry, event: &Event, now: Micros);

    /// When [`turn`](Self::turn) is to be called next, if nothing comes.
    fn poll_timeout(&self) -> Option<Micros> {
        None
    }

    /// Once in each turn of the lane: what waits to be written is written, spans
    /// that are over are noticed.
    fn turn(&mut self, registry: &Registry, now: Micros);

    /// What to tell; called until `None`.
    fn next_news(&mut self) -> Option<EndpointNews>;

    /// What the client asks of the port; called until `None`.
    fn next_request(&mut self) -> Option<EndpointRequest> {
        None
    }

    /// Whether data waits that no job has been begun for.
    fn wants_job(&self) -> bool;

    /// A job has been begun for it.
    fn job_begun(&mut self) {}

    /// Data of the job that was begun for it: straight from the socket where that
    /// can be. [`Supply::End`] ends the job's data.
    fn supply(&mut self, buffer: &mut [u8]) -> Supply;

    /// Whether [`supply`](Self::supply) would give something else than
    /// [`Supply::Later`].
    fn has_supply(&self) -> bool;

    /// Starts the job's data over: its check was good.
    fn rewind(&mut self) {}

    /// The job has ended. Data that it did not take is for the next one, or
    /// dropped, as the endpoint's set-up says.
    fn job_ended(&mut self, outcome: &JobOutcome);

    /// Whether a client is there to deliver to. Asked when a delivery begins;
    /// that one then goes to it as a whole.
    fn takes_deliveries(&self) -> bool;

    /// Bytes of a delivery, to be sent at once if they can. They fit: the sum of
    /// what was delivered and is not [drained](Self::drained) never passes the
    /// lane's room for deliveries.
    fn deliver(&mut self, bytes: &[u8]);

    /// The delivery is over.
    fn delivery_ended(&mut self) {}

    /// Bytes of deliveries that the client has taken, or that were dropped with
    /// it, since it was last asked.
    fn drained(&mut self) -> u32;

    /// What the client may want to know of the line.
    fn line_news(&mut self, news: &LineNews) {
        let _ = news;
    }

    /// Ends the client's connection and the listener.
    fn detach(&mut self, registry: &Registry);
}

/// What happens on the lane's line, for an endpoint's client.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum LineNews {
    /// The port is open with these characters and these modem lines.
    Up(LineParameters, Option<(ModemLines, ModemLines)>),
    /// The port is lost.
    Down,
    /// The modem lines: which there are, and those that are on.
    ModemLines(ModemLines, ModemLines),
    /// A damaged character, an overrun, a break.
    LineError(LineErrorKind),
    /// The partner holds us, or no longer does.
    Held(bool),
}

/// What an endpoint tells.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum EndpointNews {
    /// A client has come.
    Connected(SocketAddr),
    /// The client is gone.
    Disconnected(SocketAddr),
    /// A second client came and was sent away.
    Busy(SocketAddr),
    /// What came in could not be sent.
    JobFailed(JobOutcome),
    /// The endpoint does not work, and why.
    Failed(String),
}

/// What an endpoint's client asks of the lane's port; done where the port can.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum EndpointRequest {
    /// Modem lines: which, and those of them on.
    ModemLines(ModemLines, ModemLines),
    /// A break, on or off.
    Break(bool),
    /// That the job under way be aborted and what waits be dropped.
    Purge,
}
