//! What blocks carry and a host asks for: plain data, or what a layer on top says.

use super::{data, host, length};
use crate::dice::Dice;
use crate::model::{HostRequest, Proposal};
use crate::r3964::Station;
use crate::r3964::frame::DLE;
use crate::r3964::room::Room;
use crate::r3964::rules::Procedure;
use softplug_abi::Micros;

/// The longest data that a job has.
const LONGEST: usize = 64 * 1_024;

/// What stands on the procedure.
pub(crate) trait Upper {
    /// The next job.
    fn job(&self, station: &Station, dice: &mut Dice) -> HostRequest;
    /// One whose blocks may be sent hundreds of times, if it is not like any other.
    fn short_job(&self, _: &Station, _: &mut Dice) -> Option<HostRequest> {
        None
    }
    /// The last id of a job.
    fn last_job(&self, station: &Station) -> u32;
    /// The room for deliveries.
    fn room<'a>(&'a self, station: &'a Station) -> &'a Room;
    /// Data of a block of the partner; `is_faulty`: perhaps such that it must not send.
    fn block(&self, station: &Station, is_faulty: bool, dice: &mut Dice) -> Vec<u8>;
    /// What it does in idle, if it says so, after about so many µs.
    fn in_idle(&self, now: Micros, wait: i64, dice: &mut Dice) -> Option<Vec<Proposal>>;
    /// What the host does whatever the procedure is at.
    fn meanwhile(&self, now: Micros, dice: &mut Dice) -> Option<Vec<Proposal>>;
    /// Whether blocks are data of any length.
    fn is_plain(&self) -> bool {
        false
    }
    /// One session of so many has something very long; 0: none.
    fn long_ones(&self, station: &Station) -> u64;
    /// Begins it.
    fn begin_long(&self, station: &Station, dice: &mut Dice) -> Proposal;
    /// Whether it is under way.
    fn is_long_under_way(&self, station: &Station) -> bool;
    /// What it needs in idle to go on.
    fn go_on(&self, station: &Station, dice: &mut Dice) -> Proposal;
    /// The partner's next block in it.
    fn good_block(&self, station: &Station, dice: &mut Dice) -> Vec<u8>;
}

/// Nothing: blocks are data.
pub(crate) struct Plain;

impl Upper for Plain {
    fn job(&self, station: &Station, dice: &mut Dice) -> HostRequest {
        let parameters = &station.parameters;
        let longest = match dice.below(200) {
            0 => LONGEST,
            1..=10 => 5_000,
            _ => parameters.block_size * if parameters.split { 4 } else { 1 },
        };
        let length = length(parameters.block_size, longest.min(60 * parameters.block_size), dice);
        let data = data(length, dice);
        let id = station.jobs + 1;
        if station.parameters.procedure == Procedure::Rk512 && dice.one_in(4) {
            return of_the_layer(id, dice);
        }
        HostRequest::Job { id, kind: "send".into(), fields: Vec::new(), data }
    }

    fn short_job(&self, station: &Station, dice: &mut Dice) -> Option<HostRequest> {
        let data = data(dice.below(4) as usize, dice);
        let id = station.jobs + 1;
        Some(HostRequest::Job { id, kind: "send".into(), fields: Vec::new(), data })
    }

    fn last_job(&self, station: &Station) -> u32 {
        station.jobs
    }

    fn room<'a>(&'a self, station: &'a Station) -> &'a Room {
        &station.room
    }

    fn block(&self, station: &Station, is_faulty: bool, dice: &mut Dice) -> Vec<u8> {
        let limit = station.limit();
        let longest = if is_faulty { 3 * limit + 3 } else { limit };
        let length = length(limit, longest, dice);
        data(length, dice)
    }

    fn in_idle(&self, _: Micros, _: i64, _: &mut Dice) -> Option<Vec<Proposal>> {
        None
    }

    fn meanwhile(&self, _: Micros, _: &mut Dice) -> Option<Vec<Proposal>> {
        None
    }

    fn is_plain(&self) -> bool {
        true
    }

    fn long_ones(&self, station: &Station) -> u64 {
        // About every tenth session has these settings.
        let is_possible = station.parameters.split && station.parameters.block_size >= 1_000;
        if is_possible { 16 } else { 0 }
    }

    fn begin_long(&self, station: &Station, dice: &mut Dice) -> Proposal {
        let is_doubled = station.parameters.doubling && dice.one_in(2);
        // Each DLE goes twice.
        let (length, byte) = if is_doubled {
            (dice.between(33_000, 70_000), DLE)
        } else {
            (dice.between(66_000, 140_000), dice.byte())
        };
        let data = vec![byte; length as usize];
        let id = station.jobs + 1;
        host(1, HostRequest::Job { id, kind: "send".into(), fields: Vec::new(), data })
    }

    fn is_long_under_way(&self, station: &Station) -> bool {
        station.job.is_some()
    }

    fn go_on(&self, station: &Station, _: &mut Dice) -> Proposal {
        host(1, HostRequest::Resume(station.jobs))
    }

    fn good_block(&self, station: &Station, dice: &mut Dice) -> Vec<u8> {
        self.block(station, false, dice)
    }
}

/// A job that needs the layer, which is off.
fn of_the_layer(id: u32, dice: &mut Dice) -> HostRequest {
    let mut fields = vec![("area", "DB"), ("block", "5"), ("offset", "10")];
    let (kind, data) = if dice.one_in(2) {
        ("write", vec![0x12, 0x34])
    } else {
        fields.push(("count", "7"));
        ("read", Vec::new())
    };
    let named = |(name, value): (&str, &str)| (name.to_owned(), value.to_owned());
    let fields = fields.into_iter().map(named).collect();
    HostRequest::Job { id, kind: kind.to_owned(), fields, data }
}
