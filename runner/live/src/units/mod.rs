//! Links whose plug-ins run in front-end units: the gateway's end of the unit protocol.
//!
//! To whoever uses it, a link of a unit is a lane as those of a [reactor](crate::reactor) are: it is
//! [added](Units::add), [told](Units::tell) commands and tells [reports](Report); job data
//! and deliveries go through [reservoirs](crate::reservoir). What differs is that its plug-in comes
//! as a module, and that its port is the unit's.
//!
//! One thread drives all units; it never waits for one of them. Where units hang on one bus, its
//! [scheduler](softplug_unit_bus) says whose job data may leave next.

mod address;
mod client;
mod delivery;
mod find;
mod headway;
mod job;
mod thread;

pub use address::{UnitAddress, UnitPlace};
pub use client::{UnitClient, UnitClientError, UnitLinkSurvey, UnitSlotSurvey, UnitSurvey};
pub use find::units_on_can;
pub use softplug_unit_bus::{BusFigures, BusRates};
pub use softplug_unit_protocol::SlotState;
use softplug_unit_uplink::Outbox;
pub use softplug_unit_uplink::{
    CanAddress, NoTlsKey, TlsError, TlsKeyError, TlsKeys, TlsPrivateKey, TlsPublicKey,
};

use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use softplug_abi::{DeliveryId, Failure, JobId, RequestId};
use softplug_unit_protocol::Session;

use crate::error::PortError;
use crate::reactor::{Backoff, Feed, LaneId, LaneStatus, Probation, Report, When};
use crate::reservoir::ReservoirReader;
use thread::{Driver, Shown, ThreadCommand};

/// The gateway's end of a session with a unit.
type ServerSession = Session<16, 1024>;

/// Bytes of data, of a module or of an answer in one message, at most.
const PIECE: usize = 960;
/// Bytes of a message beside those, with room to spare.
const HEAD: usize = 64;

/// Bytes of data, of a module or of an answer in one message that the other end takes.
fn piece(outbox: &Outbox) -> usize {
    PIECE.min(outbox.longest().saturating_sub(HEAD))
}

/// The longest fields of a job, and settings, in bytes: they must fit into a message.
const LONGEST_FIELDS: usize = 900;

/// The longest ones that the other end takes.
fn longest_fields(outbox: &Outbox) -> usize {
    LONGEST_FIELDS.min(piece(outbox))
}

/// Each text ended by a byte 00.
fn pairs(settings: &[(String, String)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in settings.iter().flat_map(|(name, value)| [name, value]) {
        bytes.extend_from_slice(text.as_bytes());
        bytes.push(0);
    }
    bytes
}

/// A plug-in as a unit takes it.
#[derive(Clone, Debug)]
pub struct UnitPlugin {
    /// The module.
    pub module: Arc<[u8]>,
    /// SHA-256 of it.
    pub digest: [u8; 32],
    /// Id of the key, and signature: 96 bytes; `None`: it is not signed.
    pub signature: Option<Box<[u8]>>,
    /// Its settings, as people write them.
    pub settings: Vec<(String, String)>,
}

/// A link of a unit to drive.
#[derive(Debug)]
pub struct UnitSetup {
    /// Which.
    pub address: UnitAddress,
    /// The gateway's key and the unit's, over TCP; `None`: without TLS.
    pub tls: Option<TlsKeys>,
    /// The plug-in that it is to run.
    pub plugin: UnitPlugin,
    /// Bytes of deliveries that may wait to be put away.
    pub delivery_room: u32,
    /// The last delivery of this link that is stored, if one is known: a unit says again what it has
    /// not heard of.
    pub stored: Option<StoredDelivery>,
    /// How often to try again for a connection.
    pub reopen: Backoff,
    /// The [bus](Units::set_buses) whose scheduler says when its job data may leave; `None`, or a
    /// name that is no bus: whenever the unit has room.
    pub bus: Option<String>,
}

/// A delivery that a unit has numbered, and with it all that came from that unit before.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct StoredDelivery {
    /// The unit's identity: new at each of its starts, as its numbers are.
    pub unit: u64,
    /// Its number.
    pub delivery: DeliveryId,
}

impl StoredDelivery {
    /// Whether `other` is it, or came before it from that unit.
    pub fn covers(self, other: Self) -> bool {
        self.unit == other.unit && other.delivery <= self.delivery
    }
}

/// A bus, over which many units are fed.
#[derive(Clone, PartialEq, Debug)]
pub struct BusSetup {
    /// Its name.
    pub name: String,
    /// What it carries.
    pub rates: BusRates,
}

/// A bus, as it is shown.
#[derive(Clone, PartialEq, Debug)]
pub struct BusSurvey {
    /// What it is planned to be.
    pub setup: BusSetup,
    /// What was measured.
    pub figures: BusFigures,
    /// The links that it feeds, in the order of their turns.
    pub lanes: Vec<LaneId>,
    /// The link whose turn it is.
    pub serves: Option<LaneId>,
}

/// A link of a unit, as it is shown beside its [status](Units::status).
#[derive(Clone, PartialEq, Debug)]
pub struct UnitLinkFigures {
    /// Slots A and B for plug-ins, as far as the unit has told.
    pub slots: [UnitSlotFigures; 2],
    /// SHA-256 of the plug-in that runs.
    pub runs: Option<[u8; 32]>,
    /// Bytes of the unit's buffer; 0 before the first job.
    pub buffer: u64,
    /// The most data bits per second that the machine took; `None`: it was not fed for long enough.
    pub consumes: Option<f64>,
}

/// A slot of a unit's link, as it is shown.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct UnitSlotFigures {
    /// What it holds.
    pub state: SlotState,
    /// SHA-256 of the plug-in in it.
    pub digest: Option<[u8; 32]>,
}

/// What a link of a unit may be told; as the [commands](crate::reactor::Command) of a lane.
#[derive(Debug)]
pub enum UnitCommand {
    /// Begin a job.
    Begin(Feed),
    /// Ask for a pause of the job.
    Pause(JobId),
    /// End the pause.
    Resume(JobId),
    /// Abort the job, or, with [`JobId::NONE`], the delivery under way.
    Abort(JobId),
    /// Go on although the machine holds the line.
    ForceResume,
    /// The data of the job from the start, after [`Report::Rewind`].
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
    Swap {
        /// Which.
        plugin: UnitPlugin,
        /// When.
        when: When,
        /// How long it is on trial.
        probation: Probation,
    },
    /// Give up a swap that waits.
    CancelSwap,
    /// Put a plug-in in the place of one that has ended by a fault.
    Replace(UnitPlugin),
    /// End the plug-in at once, whatever it is doing; it is told as at fault, with this sentence.
    Halt(String),
    /// Close the unit's port and open it again.
    Reopen,
    /// End the lane. The unit keeps its port and its plug-in.
    Close,
}

/// Drives links of units. Dropping it ends them all at once; the units go on.
#[derive(Debug)]
pub struct Units {
    commands: Sender<ThreadCommand>,
    waker: Arc<mio::Waker>,
    statuses: Mutex<std::collections::HashMap<LaneId, Arc<LaneStatus>>>,
    shown: Arc<Mutex<Shown>>,
    thread: Option<JoinHandle<()>>,
}

impl Units {
    /// Without links. `identity` is new at each start of this process, at random. What happens is
    /// told to `reports`, on the thread of the units: it must only pass it on.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        identity: u64,
        reports: impl Fn(LaneId, Report) + Send + Sync + 'static,
    ) -> Result<Self, PortError> {
        let (driver, commands, waker) = Driver::new(identity, Box::new(reports))?;
        let shown = driver.shown();
        let thread = std::thread::Builder::new()
            .name("softplug-units".to_owned())
            .spawn(move || driver.run())
            .map_err(|error| PortError::io("start a thread", error))?;
        let statuses = Mutex::default();
        Ok(Self { commands, waker, statuses, shown, thread: Some(thread) })
    }

    /// Adds a link. An id that is taken already is not added.
    pub fn add(&self, id: LaneId, setup: UnitSetup) {
        let status = Arc::new(LaneStatus::default());
        let mut statuses = self.statuses.lock().unwrap_or_else(PoisonError::into_inner);
        if statuses.contains_key(&id) {
            return;
        }
        statuses.insert(id, Arc::clone(&status));
        self.give(ThreadCommand::Add(id, Box::new(setup), status));
    }

    /// Tells a link something; one that is no more is told nothing.
    pub fn tell(&self, id: LaneId, command: UnitCommand) {
        self.give(ThreadCommand::Tell(id, command));
    }

    /// Ends a link at once; [`Report::Removed`] follows. Its status is forgotten.
    pub fn remove(&self, id: LaneId) {
        self.statuses.lock().unwrap_or_else(PoisonError::into_inner).remove(&id);
        self.give(ThreadCommand::Remove(id));
    }

    /// What the link is doing; it stays readable after its end.
    pub fn status(&self, id: LaneId) -> Option<Arc<LaneStatus>> {
        self.statuses.lock().unwrap_or_else(PoisonError::into_inner).get(&id).map(Arc::clone)
    }

    /// The buses that there are from now on. One that is gone serves the links that it has until
    /// they are removed.
    pub fn set_buses(&self, buses: Vec<BusSetup>) {
        self.give(ThreadCommand::SetBuses(buses));
    }

    /// All buses, as they were a moment ago.
    pub fn buses(&self) -> Vec<BusSurvey> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).buses.clone()
    }

    /// A link, as it was a moment ago.
    pub fn figures(&self, id: LaneId) -> Option<UnitLinkFigures> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).links.get(&id).cloned()
    }

    fn give(&self, command: ThreadCommand) {
        if self.commands.send(command).is_ok() {
            let _ = self.waker.wake();
        }
    }
}

impl Drop for Units {
    fn drop(&mut self) {
        self.give(ThreadCommand::Stop);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
