//! What stands at the other end of the line where that is no plug-in.

mod control;
mod reader;
mod tnc;
mod transmitter;
mod unjudged;

pub(crate) use control::Control;
pub(crate) use reader::Reader;
pub(crate) use tnc::Tnc;
pub(crate) use unjudged::Unjudged;

use crate::end::Told;
use crate::hash::Hash128;
use crate::promise::{Breach, Wrong};
use softplug_abi::{LineErrorKind, Micros};
use std::sync::Arc;

/// A machine at the other end: a small state machine that can be copied, and that holds what
/// the plug-in does against what it did itself.
pub(crate) trait Partner: Send {
    fn fork(&self) -> Box<dyn Partner>;

    /// All that decides what it does from `now` on, with times as they are ahead.
    fn hash(&self, now: Micros, state: &mut Hash128);

    /// When it does something by itself.
    fn next(&self) -> Option<Micros>;

    /// Does what is due.
    fn tick(&mut self, now: Micros) -> Sent;

    /// A character arrives, or one that is damaged.
    fn receive(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) -> Sent;

    /// The plug-in's host begins a job with this data.
    fn begins(&mut self, data: &Arc<[u8]>);

    /// A character begins to leave the plug-in, whatever becomes of it; its stop bit ends at
    /// `end`.
    fn leaves(&mut self, end: Micros, byte: u8) -> Option<Breach>;

    /// A character that it sent arrives at the plug-in, or another one in its place.
    fn arrives(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>);

    /// The plug-in's timers up to `now` have run out: what arrives at this instant comes after
    /// them.
    fn timers_ran(&mut self, now: Micros) {
        let _ = now;
    }

    /// The plug-in's host goes on although this partner holds it.
    fn is_forced(&mut self) {}

    /// The plug-in's port was gone and is back.
    fn port_is_back(&mut self);

    /// The plug-in tells its host something.
    fn told(&mut self, told: &Told, wrong: &Wrong) -> Option<Breach>;

    /// Nothing will happen any more: what is wrong with that.
    fn at_rest(&self, wrong: &Wrong) -> Option<Breach>;
}

/// What a partner does at one instant.
#[derive(Debug, Default)]
pub(crate) struct Sent {
    /// Each character with the time at which its stop bit ends.
    pub(crate) left: Vec<(Micros, u8)>,
}
