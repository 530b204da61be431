//! Why a link's plug-in was ended.

use core::error::Error;
use softplug_abi::{DeliveryId, Event, EventKind, JobId, Malformed, RequestId, limits};
use thiserror::Error;

/// The plug-in on this link has ended, or did not take an event.
///
/// ```
/// use softplug_abi::{Event, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::EventKind;
/// use softplug_link::{Link, LinkFault, LinkOptions, Recorder, RuleBroken};
///
/// # type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
/// # struct Plugin(Act, Vec<u8>);
/// # impl Instance for Plugin {
/// #     type Fault = NoSpace;
/// #     fn input_capacity(&self) -> usize {
/// #         512
/// #     }
/// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
/// #         self.1.resize(1_024, 0);
/// #         let mut actions = ActionWriter::new(&mut self.1);
/// #         (self.0)(event, &mut actions)?;
/// #         let length = actions.len();
/// #         Ok(Output { actions: &self.1[..length], more: false })
/// #     }
/// # }
/// # fn plugin(act: Act) -> Plugin {
/// #     Plugin(act, Vec::new())
/// # }
/// // Transmits without looking at the room.
/// let flood = plugin(|event, actions| match event {
///     Event::Received(_) => actions.transmit(b"too much"),
///     _ => Ok(()),
/// });
/// let mut link = Link::new(flood, LinkOptions { transmit_room: 4, ..LinkOptions::default() });
/// let mut host = Recorder::default();
/// link.open(Micros(0), &mut host)?;
/// let fault = link.received(Micros(1_000), b"?", &mut host).unwrap_err();
/// let LinkFault::Rule { event, source } = fault else { panic!("{fault}") };
/// assert_eq!(event, EventKind::Received);
/// assert_eq!(source, RuleBroken::TransmitRoom { asked: 8, room: 4 });
/// assert!(link.has_ended());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Error)]
pub enum LinkFault<F: Error + 'static> {
    /// The instance trapped, spent its budget or refused the event.
    #[error("the plug-in failed on the event \"{event}\": {source}")]
    Instance {
        /// The event that did it.
        event: EventKind,
        /// What the instance says.
        #[source]
        source: F,
    },
    /// An action does not follow the ABI's encoding.
    #[error("the plug-in's answer to the event \"{event}\" cannot be read: {source}")]
    Malformed {
        /// The event that it answers.
        event: EventKind,
        /// What is wrong.
        #[source]
        source: Malformed,
    },
    /// An action breaks a rule of the ABI.
    #[error("the plug-in's answer to the event \"{event}\" breaks a rule: {source}")]
    Rule {
        /// The event that it answers.
        event: EventKind,
        /// Which rule.
        #[source]
        source: RuleBroken,
    },
    /// The plug-in has ended before; replace it.
    #[error("the plug-in has ended before and takes no more events")]
    Ended,
}

impl<F: Error + 'static> LinkFault<F> {
    pub(crate) fn instance(event: &Event<'_>, source: F) -> Self {
        Self::Instance { event: event.kind(), source }
    }
}

/// The rule of the ABI that an action breaks.
///
/// The example of [`LinkFault`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum RuleBroken {
    /// It transmitted more than it had room for.
    #[error("it transmits {asked} bytes where there is room for {room}")]
    TransmitRoom {
        /// Bytes transmitted.
        asked: u32,
        /// Bytes of room.
        room: u32,
    },
    /// It delivered more than it had room for.
    #[error("it delivers {asked} bytes where there is room for {room}")]
    DeliveryRoom {
        /// Bytes delivered.
        asked: u32,
        /// Bytes of room.
        room: u32,
    },
    /// Too many urgent bytes wait.
    #[error("more than {} urgent bytes wait", limits::URGENT_BYTES)]
    UrgentFull,
    /// Too many marks are outstanding.
    #[error("more than {} marks are outstanding", limits::MARKS)]
    TooManyMarks,
    /// It named a job that is not under way.
    #[error("job {0} is not under way")]
    NoSuchJob(JobId),
    /// It carried out a job that is only to be checked.
    #[error("job {0} is only being checked")]
    OnlyChecked(JobId),
    /// It gave a check result for a job that is not being checked.
    #[error("job {0} is not being checked")]
    NotChecked(JobId),
    /// A second delivery began before the first ended.
    #[error("delivery {0} begins before the one before it has ended")]
    DeliveryUnderWay(DeliveryId),
    /// It named a delivery that is not under way.
    #[error("delivery {0} is not under way")]
    NoSuchDelivery(DeliveryId),
    /// Too many requests are unanswered.
    #[error("more than {} requests are unanswered", limits::REQUESTS)]
    TooManyRequests,
    /// A request has an id that is in use.
    #[error("request {0} is already waiting for its answer")]
    RequestTwice(RequestId),
    /// The fields of a request are not whole value records in ascending order.
    #[error("the fields of request {0} are not value records in ascending order")]
    RequestFields(RequestId),
    /// It acted on settings, or while it saved or restored.
    #[error("settings, saving and restoring are answered by nothing else but notes")]
    ActedOnState,
    /// It gave saved state without being asked.
    #[error("nobody asked for its state")]
    StateUnasked,
    /// The pieces of the saved state do not follow each other.
    #[error("the pieces of its state do not follow each other")]
    StatePieces,
    /// Output without end.
    #[error("its output does not end after {} rounds", limits::OUTPUT_ROUNDS)]
    OutputWithoutEnd,
    /// Steps without end at one instant.
    #[error("it keeps time from going on: {} events at one instant", limits::STEPS_PER_INSTANT)]
    TimeStandsStill,
}
