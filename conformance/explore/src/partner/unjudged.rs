//! A partner that behaves as another and judges nothing: where settings make of what it gets and
//! sends something else, only the model judges.

use super::{Partner, Sent};
use crate::end::Told;
use crate::hash::Hash128;
use crate::promise::{Breach, Wrong};
use softplug_abi::{LineErrorKind, Micros};
use std::sync::Arc;

pub(crate) struct Unjudged(pub(crate) Box<dyn Partner>);

impl Partner for Unjudged {
    fn fork(&self) -> Box<dyn Partner> {
        Box::new(Self(self.0.fork()))
    }

    fn hash(&self, now: Micros, state: &mut Hash128) {
        self.0.hash(now, state);
    }

    fn next(&self) -> Option<Micros> {
        self.0.next()
    }

    fn tick(&mut self, now: Micros) -> Sent {
        self.0.tick(now)
    }

    fn receive(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) -> Sent {
        self.0.receive(now, byte, damage)
    }

    fn begins(&mut self, data: &Arc<[u8]>) {
        self.0.begins(data);
    }

    fn leaves(&mut self, _: Micros, _: u8) -> Option<Breach> {
        None
    }

    fn arrives(&mut self, _: Micros, _: u8, _: Option<LineErrorKind>) {}

    fn port_is_back(&mut self) {
        self.0.port_is_back();
    }

    fn told(&mut self, _: &Told, _: &Wrong) -> Option<Breach> {
        None
    }

    fn at_rest(&self, _: &Wrong) -> Option<Breach> {
        None
    }
}
