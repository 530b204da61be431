//! The host side of a link, without I/O: in which order events reach a
//! plug-in, what its actions do, and what it may not do.
//!
//! A bench, a replay of traces and a gateway on live ports all drive the same
//! [`Link`]. Whoever drives it owns the clock and the port:
//!
//! 1. what came from the line: [`Link::received`], [`Link::line_error`],
//!    [`Link::modem_lines`], [`Link::link_down`], [`Link::link_up`];
//! 2. how far the port has sent: [`Link::left`];
//! 3. [`Link::handle_timeout`], which delivers progress, timers, room and data until
//!    nothing of this instant is left;
//! 4. host requests: [`Link::begin_job`], [`Link::abort`] and the like;
//! 5. [`Link::take`] for what the port may now send, then `handle_timeout` again if it
//!    took something;
//! 6. [`Link::poll_timeout`] for when to come back. Coming back early is harmless.
//!
//! [`VirtualLine`] does all that in virtual time, with a model of the UART.
//!
//! The plug-in of the examples is a function, made an instance like this:
//!
//! ```
//! use softplug_abi::{ActionWriter, Event, Instance, Micros, NoSpace, Output};
//! use softplug_link::{LinkOptions, Observed, Recorder, VirtualLine};
//!
//! type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
//!
//! struct Plugin(Act, Vec<u8>);
//!
//! impl Instance for Plugin {
//!     type Fault = NoSpace;
//!
//!     fn input_capacity(&self) -> usize {
//!         512
//!     }
//!
//!     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
//!         self.1.resize(1_024, 0);
//!         let mut actions = ActionWriter::new(&mut self.1);
//!         (self.0)(event, &mut actions)?;
//!         let length = actions.len();
//!         Ok(Output { actions: &self.1[..length], more: false })
//!     }
//! }
//!
//! fn plugin(act: Act) -> Plugin {
//!     Plugin(act, Vec::new())
//! }
//!
//! // It sends back what it receives: at 9,600 8N1, a character takes 1,042 µs.
//! let echo = plugin(|event, actions| match event {
//!     Event::Received(bytes) => actions.transmit(bytes),
//!     _ => Ok(()),
//! });
//! let mut line = VirtualLine::new(echo, LinkOptions::default(), 16);
//! let mut host = Recorder::default();
//! line.link.open(Micros(0), &mut host)?;
//! line.link.received(Micros(1_000), b"G1", &mut host)?;
//! line.transmit(Micros(1_000), &mut host)?;
//! let (first, second) = (Observed::Byte(b'G'), Observed::Byte(b'1'));
//! assert_eq!(host.observed, [(Micros(1_000), first), (Micros(2_042), second)]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod core;
mod fault;
mod fed;
mod job;
mod link;
mod marks;
mod queue;
mod recorder;
mod rerun;
mod timers;
mod virtual_line;
mod wire;

pub use crate::core::HoldState;
pub use fault::{LinkFault, RuleBroken};
pub use job::Job;
pub use link::{Link, LinkOptions, Reverted, SavedState, Spare, Successor, SwapError, UnderWay};
pub use queue::Taken;
pub use recorder::{Delivery, Observed, Recorder};
pub use rerun::Rerun;
pub use virtual_line::VirtualLine;
pub use wire::Wire;

use softplug_abi::{Action, JobId, Micros};

/// What a link needs from its surroundings while it runs.
///
/// ```
/// use softplug_abi::{Action, JobId, Micros};
/// use softplug_link::{LinkHost, Supply};
///
/// /// Supplies one program, and keeps the jobs that are done.
/// struct Host {
///     program: &'static [u8],
///     done: Vec<JobId>,
/// }
///
/// impl LinkHost for Host {
///     fn handle(&mut self, _now: Micros, action: &Action<'_>) {
///         if let Action::JobDone { job, .. } = action {
///             self.done.push(*job);
///         }
///     }
///     fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
///         let (now, later) = self.program.split_at(self.program.len().min(buffer.len()));
///         buffer[..now.len()].copy_from_slice(now);
///         self.program = later;
///         if now.is_empty() { Supply::End } else { Supply::Bytes(now.len()) }
///     }
/// }
///
/// let mut host = Host { program: b"G1X2", done: Vec::new() };
/// let mut buffer = [0; 3];
/// assert_eq!(host.supply(JobId(7), &mut buffer), Supply::Bytes(3));
/// assert_eq!(host.supply(JobId(7), &mut buffer), Supply::Bytes(1));
/// assert_eq!(host.supply(JobId(7), &mut buffer), Supply::End);
/// host.handle(Micros(4_167), &Action::JobDone { job: JobId(7), sent: 4 });
/// assert_eq!(host.done, [JobId(7)]);
/// ```
pub trait LinkHost {
    /// The plug-in did something that concerns the host: deliveries, ends of
    /// jobs, requests, notes, state names, hold and release, modem lines, and
    /// breaks at the moment they are to be sent.
    ///
    /// A [`Action::Deliver`] is now in the host's hands; its bytes count against
    /// the room until [`drained`](Self::drained) gives them back.
    fn handle(&mut self, now: Micros, action: &Action<'_>);

    /// Fills `buffer` with data of the job, as much as there is.
    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        let _ = (job, buffer);
        Supply::End
    }

    /// Starts the job's data over: its check pass was good.
    fn rewind(&mut self, job: JobId) {
        let _ = job;
    }

    /// Bytes of deliveries that the host has put away since it was last asked.
    fn drained(&mut self) -> u32 {
        0
    }
}

/// What a [`VirtualLine`] needs from its surroundings: what its link needs, and somebody who
/// sees when characters leave. On a real line nobody does.
///
/// ```
/// use softplug_abi::{Action, LineParameters, Micros};
/// use softplug_link::{LinkHost, WireHost};
///
/// /// What the partner has got, and when.
/// #[derive(Default)]
/// struct Partner(Vec<(Micros, u8)>);
///
/// impl LinkHost for Partner {
///     fn handle(&mut self, _now: Micros, _action: &Action<'_>) {}
/// }
///
/// impl WireHost for Partner {
///     fn off_wire(&mut self, end: Micros, byte: u8) {
///         self.0.push((end, byte));
///     }
/// }
///
/// let mut partner = Partner::default();
/// let end = LineParameters::new(9_600).characters(1);
/// partner.on_wire(Micros(0), b'G');
/// partner.off_wire(end, b'G');
/// assert_eq!(partner.0, [(Micros(1_042), b'G')]);
/// ```
pub trait WireHost: LinkHost {
    /// A character whose start bit leaves at `start`.
    fn on_wire(&mut self, start: Micros, byte: u8) {
        let _ = (start, byte);
    }

    /// That character's stop bit ends at `end`: it reaches the partner.
    fn off_wire(&mut self, end: Micros, byte: u8) {
        let _ = (end, byte);
    }
}

/// Answer of a job's source.
///
/// The example of [`LinkHost`] shows two.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Supply {
    /// So many bytes are in the buffer, at least one.
    Bytes(usize),
    /// Nothing now; run the link again when there is.
    Later,
    /// There is no more.
    End,
}
