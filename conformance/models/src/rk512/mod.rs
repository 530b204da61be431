//! RK512 on top of 3964R or 3964, as the page tells it.
//!
//! A [`Layer`] stands on the station of [`r3964`](crate::r3964): blocks go down, and
//! telegrams come up. `commands` has what it does with SEND and FETCH of the host, `serve`
//! with those of the partner. Where the page leaves a choice the model goes all
//! [`ways`] until it sees which one the plug-in went.

mod awaited;
mod commands;
mod fields;
mod job;
mod layer;
mod procedure;
mod profile;
mod propose;
mod reactions;
mod series;
mod serve;
mod telegram;
mod ways;

pub(crate) use profile::PROFILE;

use crate::dice::Dice;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Proposal};
use crate::r3964::{Partner, Station};
use layer::Layer;
use propose::Telegrams;
use softplug_abi::Micros;
use std::cell::RefCell;
use ways::Worlds;

/// One station with RK512, and its partner.
#[derive(Clone, Debug)]
struct Rk512 {
    worlds: Worlds<Layer>,
    partner: RefCell<Partner>,
    /// The number of a long session.
    long: Option<u64>,
}

fn start(conditions: &Conditions) -> Option<Box<dyn Model>> {
    match conditions.settings.name("layer", "") {
        "rk512" => {}
        "none" => return Some(Box::new(Station::without_layer(conditions)?)),
        _ => return None,
    }
    // The header of a WRITE tells the size.
    if !conditions.has_sizes {
        return None;
    }
    let worlds = Worlds::new(Layer::new(conditions)?);
    let partner = RefCell::new(Partner::new(conditions));
    Some(Box::new(Rk512 { worlds, partner, long: conditions.long }))
}

impl Model for Rk512 {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        // A telegram may end in the middle of what came.
        if let LineInput::Bytes(bytes) = input {
            for byte in bytes {
                let input = LineInput::Bytes(vec![*byte]);
                self.worlds.each(|layer| layer.line(at, &input));
            }
        } else {
            self.worlds.each(|layer| layer.line(at, input));
        }
    }

    fn left(&mut self, at: Micros, byte: u8) {
        self.worlds.each(|layer| layer.left(at, byte));
    }

    fn due(&mut self, at: Micros) {
        self.worlds.each(|layer| layer.due(at));
    }

    fn host(&mut self, at: Micros, request: &HostRequest) {
        self.worlds.each(|layer| layer.host(at, request));
    }

    fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken> {
        self.worlds.check(|layer| layer.seen(at, effect))
    }

    fn settled(&mut self, at: Micros) -> Result<(), Broken> {
        self.worlds.check(|layer| layer.settled(at))
    }

    fn next(&self) -> Option<Micros> {
        self.worlds.all().filter_map(Layer::next).min()
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let layer = self.worlds.first();
        self.partner.borrow_mut().propose(&layer.station, &Telegrams(layer, self.long), now, dice)
    }

    fn is_filled(&self) -> bool {
        self.partner.borrow().is_filling()
    }
}
