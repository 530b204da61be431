//! Buses, shown.

use softplug_host::Digest;
use softplug_live::units::{BusSurvey, SlotState, UnitLinkFigures};

use super::link::Link;
use super::{Control, Gateway};
use crate::Refusal;
use crate::view::{BusMeasuredView, BusUnitView, BusView, UnitSlotView};

impl Gateway {
    /// All buses of the configuration, with what was measured on them.
    pub fn buses(&self) -> Result<Vec<BusView>, Refusal> {
        self.shared.ask(|control| Ok(control.bus_views()))
    }
}

impl Control {
    fn bus_views(&self) -> Vec<BusView> {
        self.drivers.buses().iter().map(|bus| self.bus_view(bus)).collect()
    }

    fn bus_view(&self, bus: &BusSurvey) -> BusView {
        let BusSurvey { setup, figures, lanes, serves } = bus;
        let link_of = |lane| self.lanes.get(lane).and_then(|name| self.links.get(name));
        let unit = |lane| {
            let (link, figures) = (link_of(lane)?, self.drivers.unit_figures(*lane)?);
            Some(unit(link, &figures))
        };
        BusView {
            name: setup.name.clone(),
            rate: setup.rates.rate,
            efficiency: setup.rates.efficiency,
            switch_seconds: setup.rates.switch,
            measured: BusMeasuredView {
                load: figures.load,
                efficiency: figures.efficiency,
                switch_seconds: figures.switch,
            },
            serves: serves.and_then(|lane| self.lanes.get(&lane)).cloned(),
            units: lanes.iter().filter_map(unit).collect(),
        }
    }
}

fn unit(link: &Link, figures: &UnitLinkFigures) -> BusUnitView {
    let slot = |(name, at): (&str, usize)| {
        let slot = figures.slots[at];
        UnitSlotView {
            slot: name.to_owned(),
            state: state(slot.state).to_owned(),
            digest: slot.digest.map(|digest| Digest::from_bytes(digest).to_string()),
            runs: slot.digest.is_some() && slot.digest == figures.runs,
        }
    };
    BusUnitView {
        link: link.config.name.clone(),
        port: link.config.port.to_string(),
        level: link.status.read().level,
        buffer: figures.buffer,
        consumes: figures.consumes,
        slots: [("A", 0), ("B", 1)].map(slot).to_vec(),
    }
}

const fn state(state: SlotState) -> &'static str {
    match state {
        SlotState::Empty => "empty",
        SlotState::Writing => "being written",
        SlotState::Written => "written",
        SlotState::OnTrial => "on trial",
        SlotState::Confirmed => "confirmed",
        SlotState::Failed => "failed",
    }
}
