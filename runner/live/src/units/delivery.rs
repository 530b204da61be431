//! What a unit's machine sends, on its way to be put away.

use std::collections::BTreeMap;

use softplug_abi::{DeliveryId, Failure, JobId};
use softplug_unit_protocol::ToUnit;
use softplug_unit_uplink::Outbox;
use std::task::Waker;

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
#[derive(Default)]
pub(super) struct Arrivals {
    arriving: BTreeMap<DeliveryId, Arriving>,
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
}

impl Arrivals {
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
        let mut reports = Vec::new();
        let arriving = self.arriving.entry(delivery).or_insert_with(|| {
            let room = room as usize;
            let (writer, bytes) = reservoir(room, 0, room);
            writer.wake_with(waker.clone());
            reports.push(Report::DeliveryBegun { delivery, job, bytes });
            Arriving {
                writer,
                waiting: Vec::new(),
                came: at,
                from: at,
                name: String::new(),
                told: at,
                end: None,
            }
        });
        // In another session what was told counts anew.
        arriving.told = arriving.told.min(at);
        if name != arriving.name {
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
        let mut reports = Vec::new();
        self.arriving.retain(|&delivery, arriving| {
            let taken = arriving.writer.write(&arriving.waiting);
            arriving.waiting.drain(..taken);
            let stored = arriving.from + arriving.writer.consumed();
            // Nobody will read it: it is dropped.
            let is_dropped = arriving.writer.is_abandoned();
            let stored = if is_dropped { arriving.came } else { stored };
            let is_whole = arriving.waiting.is_empty() || is_dropped;
            if let Some((failure, status, size)) = arriving.end
                && is_whole
                && stored == arriving.came
            {
                arriving.writer.finish();
                let (until, is_whole) = (stored, true);
                outbox.push(&ToUnit::Stored { link, delivery: delivery.0, until, is_whole }, false);
                // What was stored before this process began is not here.
                let failure = if arriving.from > 0 {
                    failure.or(Some(Failure::Interrupted))
                } else {
                    failure
                };
                let bytes = size - arriving.from.min(size);
                reports.push(Report::DeliveryEnded { delivery, failure, status, bytes });
                return false;
            }
            if stored > arriving.told {
                arriving.told = stored;
                let (until, is_whole) = (stored, false);
                outbox.push(&ToUnit::Stored { link, delivery: delivery.0, until, is_whole }, false);
            }
            if arriving.writer.level() > 0 {
                arriving.writer.wake_at(0);
            }
            true
        });
        reports
    }

    /// The unit was started anew, or is given up: what has not come whole never will.
    pub(super) fn interrupted(&mut self) -> Vec<Report> {
        std::mem::take(&mut self.arriving)
            .into_iter()
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
