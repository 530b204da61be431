//! The host side of a link, without I/O: in which order events reach a
//! plug-in, what its actions do, and what it may not do.
//!
//! A bench, a replay of traces and a gateway on live ports all drive the same
//! [`Link`]. Whoever drives it owns the clock and the port:
//!
//! 1. what came from the line: [`Link::received`], [`Link::line_error`],
//!    [`Link::modem_lines`], [`Link::link_down`], [`Link::link_up`];
//! 2. how far the port has sent: [`Link::left`];
//! 3. [`Link::run`], which delivers progress, timers, room and data until
//!    nothing of this instant is left;
//! 4. host requests: [`Link::begin_job`], [`Link::abort`] and the like;
//! 5. [`Link::take`] for what the port may now send, then `run` again if it took
//!    something;
//! 6. [`Link::next_timer`] for when to come back. Coming back early is harmless.
//!
//! [`VirtualLine`] does all that in virtual time, with a model of the UART.
#![forbid(unsafe_code)]

mod core;
mod fault;
mod input;
mod job;
mod link;
mod marks;
mod probation;
mod queue;
mod recorder;
mod replace;
mod requests;
mod rerun;
mod saving;
mod swap;
mod timers;
mod under_way;
mod virtual_line;
mod wire;

pub use crate::core::HoldState;
pub use fault::{LinkFault, RuleBroken};
pub use job::Job;
pub use link::{Link, LinkOptions};
pub use probation::Reverted;
pub use queue::Taken;
pub use recorder::{Delivery, Observed, Recorder};
pub use rerun::Rerun;
pub use saving::SavedState;
pub use swap::{Spare, Successor, SwapError};
pub use under_way::UnderWay;
pub use virtual_line::VirtualLine;
pub use wire::Wire;

use softplug_abi::{Action, Micros};

/// What a link needs from its surroundings while it runs.
pub trait Outside {
    /// The plug-in did something that concerns the host: deliveries, ends of
    /// jobs, requests, notes, state names, hold and release, modem lines, and
    /// breaks at the moment they are to be sent.
    ///
    /// A [`Action::Deliver`] is now in the host's hands; its bytes count against
    /// the room until [`drained`](Self::drained) gives them back.
    fn handle(&mut self, now: Micros, action: &Action<'_>);

    /// Fills `buffer` with data of the job, as much as there is.
    fn supply(&mut self, job: u32, buffer: &mut [u8]) -> Supply {
        let _ = (job, buffer);
        Supply::End
    }

    /// Starts the job's data over: its check pass was good.
    fn rewind(&mut self, job: u32) {
        let _ = job;
    }

    /// Bytes of deliveries that the host has put away since it was last asked.
    fn drained(&mut self) -> u32 {
        0
    }

    /// Only in virtual time: a character whose start bit leaves at `start`.
    fn on_wire(&mut self, start: Micros, byte: u8) {
        let _ = (start, byte);
    }

    /// Only in virtual time: the same character, whose stop bit ends at `end`.
    /// That is when it reaches the partner.
    fn off_wire(&mut self, end: Micros, byte: u8) {
        let _ = (end, byte);
    }
}

/// Answer of a job's source.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Supply {
    /// So many bytes are in the buffer, at least one.
    Bytes(usize),
    /// Nothing now; run the link again when there is.
    Later,
    /// There is no more.
    End,
}
