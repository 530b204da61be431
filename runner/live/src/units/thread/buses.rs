//! Buses over which many units are fed, one after the other.

use std::collections::HashMap;

use softplug_abi::Micros;
use softplug_unit_bus::{Bus, Grant, Step, Unit};

use super::Thread;
use super::connection::Connection;
use crate::reactor::LaneId;
use crate::units::{BusSetup, BusSurvey, PIECE};

/// A lane that was to send and could not is asked again after this span.
const AGAIN: Micros = Micros::from_millis(5);

/// All buses of a gateway.
#[derive(Default)]
pub(super) struct Buses {
    driven: Vec<Driven>,
}

struct Driven {
    setup: BusSetup,
    bus: Bus,
    /// Its lanes in the order of their turns; none where one has left.
    places: Vec<Option<LaneId>>,
    /// When it is to be looked at again at the latest.
    due: Option<Micros>,
    /// It is still in the configuration.
    is_wanted: bool,
}

impl Buses {
    pub(super) fn set(&mut self, setups: Vec<BusSetup>, now: Micros) {
        for driven in &mut self.driven {
            driven.is_wanted = false;
        }
        for setup in setups {
            let known = self.driven.iter_mut().find(|driven| driven.setup.name == setup.name);
            if let Some(driven) = known {
                driven.bus.set_rates(now.as_secs_f64(), setup.rates);
                (driven.setup, driven.is_wanted, driven.due) = (setup, true, Some(now));
            } else {
                let bus = Bus::new(setup.rates, now.as_secs_f64());
                let places = Vec::new();
                self.driven.push(Driven { setup, bus, places, due: None, is_wanted: true });
            }
        }
        self.clear_away();
    }

    /// A lane is fed over this bus from now on. Whether there is such a bus.
    pub(super) fn join(&mut self, name: &str, lane: LaneId) -> bool {
        let known = self.driven.iter_mut().find(|driven| driven.setup.name == name);
        let Some(driven) = known else { return false };
        match driven.places.iter_mut().find(|place| place.is_none()) {
            Some(place) => *place = Some(lane),
            None => driven.places.push(Some(lane)),
        }
        true
    }

    pub(super) fn leave(&mut self, lane: LaneId) {
        for place in self.driven.iter_mut().flat_map(|driven| &mut driven.places) {
            if *place == Some(lane) {
                *place = None;
            }
        }
        self.clear_away();
    }

    fn clear_away(&mut self) {
        self.driven.retain(|driven| driven.is_wanted || driven.lanes().next().is_some());
    }

    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        self.driven.iter().filter_map(|driven| driven.due).min()
    }

    /// Lets leave what may, in pieces.
    pub(super) fn serve(
        &mut self,
        connections: &mut [Option<Connection>],
        numbers: &HashMap<LaneId, usize>,
        thread: &Thread,
    ) {
        if self.driven.is_empty() {
            return;
        }
        for driven in &mut self.driven {
            driven.serve(connections, numbers, thread);
        }
        for connection in connections.iter_mut().flatten() {
            let Some((name, bits)) = connection.take_bits() else { continue };
            let bus = self.driven.iter_mut().find(|driven| driven.setup.name == name);
            if let Some(driven) = bus {
                driven.bus.carried(bits as f64);
            }
        }
    }

    pub(super) fn survey(&self, now: Micros) -> Vec<BusSurvey> {
        let one = |driven: &Driven| BusSurvey {
            setup: driven.setup.clone(),
            figures: driven.bus.figures(now.as_secs_f64()),
            lanes: driven.lanes().collect(),
            serves: driven.bus.serves().and_then(|place| *driven.places.get(place)?),
        };
        self.driven.iter().map(one).collect()
    }
}

impl Driven {
    fn lanes(&self) -> impl Iterator<Item = LaneId> {
        self.places.iter().copied().flatten()
    }

    fn serve(
        &mut self,
        connections: &mut [Option<Connection>],
        numbers: &HashMap<LaneId, usize>,
        thread: &Thread,
    ) {
        let fair = self.setup.rates.payload() / self.lanes().count().max(1) as f64;
        loop {
            let demand = |place: &Option<LaneId>| {
                let lane = place.and_then(|lane| connection_of(lane, connections, numbers));
                lane.map_or(Unit::ABSENT, |(lane, connection)| {
                    connection.demand(lane, fair, thread)
                })
            };
            let units: Vec<Unit> = self.places.iter().map(demand).collect();
            let now = thread.clock.now();
            self.due = match self.bus.poll(now.as_secs_f64(), &units) {
                Step::Send(Grant { unit, bits }) => {
                    let most = ((bits / 8.0) as u64).min(PIECE as u64);
                    let lane = self.places[unit]
                        .and_then(|lane| connection_of(lane, connections, numbers));
                    let sent =
                        lane.map_or(0, |(lane, connection)| connection.feed(lane, most, thread));
                    if sent > 0 {
                        self.bus.sent(now.as_secs_f64(), 8.0 * sent as f64);
                        continue;
                    }
                    Some(now + AGAIN)
                }
                Step::Wait { until } | Step::Rest { until } => micros(until),
            };
            return;
        }
    }
}

fn connection_of<'a>(
    lane: LaneId,
    connections: &'a mut [Option<Connection>],
    numbers: &HashMap<LaneId, usize>,
) -> Option<(LaneId, &'a mut Connection)> {
    Some((lane, connections.get_mut(*numbers.get(&lane)?)?.as_mut()?))
}

/// A time on the thread's clock, rounded up; `None`: never.
fn micros(seconds: f64) -> Option<Micros> {
    seconds.is_finite().then(|| Micros((seconds * 1e6).ceil() as i64))
}
