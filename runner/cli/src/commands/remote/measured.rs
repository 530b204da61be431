//! What a gateway has measured on a bus, for the planner.

use softplug_live::plain_text;
use softplug_plan::Measured;
use softplug_service::view::BusView;

use super::Remote;
use super::client::Client;
use crate::failure::Failure;

/// Of the bus with this name, or of the only one.
pub(crate) fn measured(remote: &Remote, name: Option<&str>) -> Result<Measured, Failure> {
    let client = Client { named_by: "--from", ..Client::new(remote)? };
    let buses: Vec<BusView> = client.get("/buses")?;
    let names: Vec<_> = buses.iter().map(|bus| plain_text(&bus.name)).collect();
    let names = names.join(", ");
    let bus = match (name, &buses[..]) {
        (Some(name), _) => buses.iter().find(|bus| bus.name == name).ok_or_else(|| {
            let known = if buses.is_empty() { "none".to_owned() } else { names };
            Failure::usage(format_args!("the gateway has no bus \"{name}\"; it has {known}"))
        })?,
        (None, [bus]) => bus,
        (None, []) => return Err(Failure::usage("the gateway has no bus")),
        (None, _) => {
            let what = format_args!("the gateway has several buses: {names}");
            return Err(Failure::usage(what).hint("name one of them with --bus"));
        }
    };
    let consumes = bus.units.iter().filter_map(|unit| Some((unit.link.clone(), unit.consumes?)));
    Ok(Measured {
        efficiency: bus.measured.efficiency,
        switch: bus.measured.switch_seconds,
        consumes: consumes.collect(),
    })
}
