//! What a unit's machine sends, on its way to be put away.

use std::collections::BTreeMap;

use softplug_abi::{DeliveryId, Failure, JobId};
use softplug_unit_protocol::ToUnit;
use softplug_unit_uplink::Outbox;
use std::task::Waker;

use super::StoredDelivery;
use crate::reactor::Report;
use crate::reservoir::{ReservoirWriter, reservoir};

/// Bytes that a unit may have under way beside those that are stored, with room to spare.
const UNDER_WAY: usize = 16 << 10;
/// Most deliveries that are not whole: a unit sends one after the other.
const MOST: usize = 16;

/// A unit sends more than it may.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Flood;

/// Deliveries of a link, by the unit's number.
pub(super) struct Arrivals {
    /// The identity of the unit that numbers them; `None` until there is a session.
    unit: Option<u64>,
    arriving: BTreeMap<DeliveryId, Arriving>,
    /// The last one that is stored whole, and with it all that the unit numbered before.
    stored: Option<StoredDelivery>,
}

struct Arriving {
    writer: ReservoirWriter,
    /// Bytes that have come for which the buffer had no room yet.
    waiting: Vec<u8>,
    /// The position behind the last byte that has come.
    came: u64,
    /// The position at which it began here.
    from: u64,
    name: String,
    told: u64,
    end: Option<(Option<Failure>, u16, u64)>,
    /// Its end is reported, and it is being put away.
    is_over: bool,
    /// It is stored already, and the unit has not heard of that: nobody is told of it again.
    is_known: bool,
}

impl Arrivals {
    pub(super) fn new(stored: Option<StoredDelivery>) -> Self {
        Self { unit: None, arriving: BTreeMap::new(), stored }
    }

    /// A session has begun with this unit.
    pub(super) fn session_began(&mut self, unit: u64) {
        self.unit = Some(unit);
    }

    /// It is announced, for the first time or again. What is to be reported.
    pub(super) fn announced(
        &mut self,
        delivery: DeliveryId,
        job: Option<JobId>,
        at: u64,
        name: &str,
        room: u32,
        waker: &Waker,
    ) -> Result<Vec<Report>, Flood> {
        if self.arriving.len() >= MOST && !self.arriving.contains_key(&delivery) {
            return Err(Flood);
        }
        let unit = self.unit;
        let said = unit.map(|unit| StoredDelivery { unit, delivery });
        let is_known = self.stored.zip(said).is_some_and(|(last, said)| last.covers(said));
        let mut reports = Vec::new();
        let arriving = self.arriving.entry(delivery).or_insert_with(|| {
            let room = room as usize;
            let (writer, bytes) = reservoir(room, 0, room);
            writer.wake_with(waker.clone());
            if !is_known {
                reports.push(Report::DeliveryBegun { delivery, job, unit, bytes });
            }
            Arriving {
                writer,
                waiting: Vec::new(),
                came: at,
                from: at,
                name: String::new(),
                told: at,
                end: None,
                is_over: false,
                is_known,
            }
        });
        // In another session what was told counts anew.
        arriving.told = arriving.told.min(at);
        if name != arriving.name && !arriving.is_known {
            name.clone_into(&mut arriving.name);
            reports.push(Report::DeliveryNamed { delivery, name: name.to_owned() });
        }
        Ok(reports)
    }

    pub(super) fn data(
        &mut self,
        delivery: DeliveryId,
        at: u64,
        bytes: &[u8],
    ) -> Result<(), Flood> {
        let Some(arriving) = self.arriving.get_mut(&delivery) else { return Ok(()) };
        // What came already comes again behind a session that has ended.
        let known = arriving.came.saturating_sub(at).min(bytes.len() as u64) as usize;
        if at.checked_add(known as u64) != Some(arriving.came) {
            return Ok(());
        }
        let new = &bytes[known..];
        if arriving.waiting.len() + new.len() > UNDER_WAY {
            return Err(Flood);
        }
        arriving.came += new.len() as u64;
        arriving.waiting.extend_from_slice(new);
        Ok(())
    }

    pub(super) fn ended(
        &mut self,
        delivery: DeliveryId,
        failure: Option<Failure>,
        status: u16,
        size: u64,
    ) {
        if let Some(arriving) = self.arriving.get_mut(&delivery) {
            arriving.end = Some((failure, status, size));
        }
    }

    /// Moves what has come on, and tells the unit what has been put away.
    pub(super) fn pump(&mut self, link: u8, outbox: &mut Outbox) -> Vec<Report> {
        let (mut reports, unit) = (Vec::new(), self.unit);
        let Self { arriving, stored, .. } = self;
        arriving.retain(|&delivery, arriving| {
            let taken = arriving.writer.write(&arriving.waiting);
            arriving.waiting.drain(..taken);
            // Whoever reads it has put it away, or dropped it.
            let is_gone = arriving.writer.is_abandoned();
            if is_gone {
                arriving.waiting.clear();
            }
            if let Some(end) = arriving.end
                && arriving.waiting.is_empty()
                && !arriving.is_over
            {
                arriving.writer.finish();
                arriving.is_over = true;
                reports.extend(arriving.ended(delivery, end));
            }
            if is_gone && arriving.is_over {
                let until = arriving.came;
                let message = ToUnit::Stored { link, delivery: delivery.0, until, is_whole: true };
                outbox.push(&message, false);
                if let Some(unit) = unit {
                    let said = StoredDelivery { unit, delivery };
                    *stored = stored.filter(|last| last.covers(said)).or(Some(said));
                }
                return false;
            }
            let until =
                if is_gone { arriving.came } else { arriving.from + arriving.writer.consumed() };
            if until > arriving.told {
                arriving.told = until;
                let message = ToUnit::Stored { link, delivery: delivery.0, until, is_whole: false };
                outbox.push(&message, false);
            }
            if arriving.writer.level() > 0 {
                arriving.writer.wake_at(0);
            }
            true
        });
        reports
    }

    /// The link is given up: what has come ends there, and its unit says the rest to whoever drives
    /// the link next.
    pub(super) fn given_up(&mut self) {
        for (_, mut arriving) in std::mem::take(&mut self.arriving) {
            arriving.writer.write(&arriving.waiting);
        }
    }

    /// The unit was started anew: what has not come whole never will.
    pub(super) fn interrupted(&mut self) -> Vec<Report> {
        std::mem::take(&mut self.arriving)
            .into_iter()
            .filter(|(_, arriving)| !arriving.is_over && !arriving.is_known)
            .map(|(delivery, mut arriving)| {
                arriving.writer.write(&arriving.waiting);
                arriving.writer.finish();
                let failure = Some(Failure::Interrupted);
                let bytes = arriving.came - arriving.from;
                Report::DeliveryEnded { delivery, failure, status: 0, bytes }
            })
            .collect()
    }
}

impl Arriving {
    /// What is reported of its end.
    fn ended(
        &self,
        delivery: DeliveryId,
        (failure, status, size): (Option<Failure>, u16, u64),
    ) -> Option<Report> {
        // What was stored before this process began is not here.
        let is_cut = self.from > 0;
        let failure = if is_cut { failure.or(Some(Failure::Interrupted)) } else { failure };
        let bytes = size - self.from.min(size);
        let report = Report::DeliveryEnded { delivery, failure, status, bytes };
        (!self.is_known).then_some(report)
    }
}
