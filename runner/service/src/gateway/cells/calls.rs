//! The handle's calls that concern cells.

use softplug_cell::{AxisId, ChannelId, Event, Mode, Setup, Stop};

use super::super::Gateway;
use super::{ChannelOf, Control};
use crate::Refusal;
use crate::jobs::Data;
use crate::view::{CellMode, CellView};

/// Cells.
impl Gateway {
    /// All cells, in the order of their names.
    pub fn cells(&self) -> Result<Vec<CellView>, Refusal> {
        self.shared.ask(|control| Ok(control.cell_views()))
    }

    /// One cell.
    pub fn cell(&self, name: &str) -> Result<CellView, Refusal> {
        let name = name.to_owned();
        self.shared.ask(move |control| control.cell_view(&name).ok_or_else(|| no_cell(&name)))
    }

    /// Gives an axis to a channel, whoever has it. Who loses it is interrupted, and gets it back first.
    pub fn force_axis(&self, cell: &str, axis: &str, channel: &str) -> Result<CellView, Refusal> {
        let (axis, channel) = (axis.to_owned(), channel.to_owned());
        self.on_cell(cell, move |setup| {
            let axis = axis_of(setup, &axis)?;
            Ok(Event::Force { axis, channel: channel_of(setup, &channel)? })
        })
    }

    /// Makes an axis neutral, whoever has it: the next in its queue gets it.
    pub fn release_axis(&self, cell: &str, axis: &str) -> Result<CellView, Refusal> {
        let axis = axis.to_owned();
        self.on_cell(cell, move |setup| Ok(Event::Free { axis: axis_of(setup, &axis)? }))
    }

    /// Chooses the mode of a group.
    pub fn set_mode(&self, cell: &str, group: &str, mode: CellMode) -> Result<CellView, Refusal> {
        let group = group.to_owned();
        self.on_cell(cell, move |setup| {
            let found = setup.group_named(&group).ok_or_else(|| {
                let known = setup.groups().map(|(_, name, _)| name);
                unknown("group", &group, known)
            })?;
            Ok(Event::Mode { group: found, mode: mode.into() })
        })
    }

    /// Somebody has looked at the machines after a crash: programs may begin again.
    pub fn clear_cell(&self, cell: &str) -> Result<CellView, Refusal> {
        self.on_cell(cell, |_| Ok(Event::Clear))
    }

    /// The words in a program that is for this link, if it is a channel of a cell.
    pub(in super::super) fn words_of(
        &self,
        link: &str,
        data: Data,
    ) -> Result<(Data, Vec<Stop>), Refusal> {
        match self.channel_of(link)? {
            Some(channel) => channel.read(&self.shared, data),
            None => Ok((data, Vec::new())),
        }
    }

    pub(in super::super) fn channel_of(&self, link: &str) -> Result<Option<ChannelOf>, Refusal> {
        let link = link.to_owned();
        self.shared.ask(move |control| Ok(control.channel_of(&link)))
    }

    fn on_cell(
        &self,
        cell: &str,
        event: impl FnOnce(&Setup) -> Result<Event, Refusal> + Send + 'static,
    ) -> Result<CellView, Refusal> {
        let name = cell.to_owned();
        self.shared.ask(move |control| {
            let state = control.cells.by_name.get(&name).ok_or_else(|| no_cell(&name))?;
            let event = event(&state.config.setup)?;
            control.asked_of_cell(&name, event)?;
            control.cell_view(&name).ok_or_else(|| no_cell(&name))
        })
    }
}

impl Control {
    fn asked_of_cell(&mut self, name: &str, event: Event) -> Result<(), Refusal> {
        self.carry_out_pending(name);
        self.step(name, Some(event), None)?;
        self.begin_waiting(name);
        Ok(())
    }
}

impl From<CellMode> for Mode {
    fn from(mode: CellMode) -> Self {
        match mode {
            CellMode::Auto => Self::Auto,
            CellMode::JogInAuto => Self::JogInAuto,
            CellMode::Mda => Self::Mda,
            CellMode::Jog => Self::Jog,
        }
    }
}

fn axis_of(setup: &Setup, name: &str) -> Result<AxisId, Refusal> {
    let known = || setup.axes().map(|axis| setup.axis_name(axis));
    setup.axis(name).ok_or_else(|| unknown("axis", name, known()))
}

fn channel_of(setup: &Setup, name: &str) -> Result<ChannelId, Refusal> {
    let known = || setup.channels().map(|channel| setup.channel_name(channel));
    setup.channel(name).ok_or_else(|| unknown("channel", name, known()))
}

fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str>) -> Refusal {
    let hint = crate::config::of_names("it has", name, known);
    Refusal::NotFound(format!("the cell has no {what} \"{}\"; {hint}", name.escape_debug()))
}

fn no_cell(name: &str) -> Refusal {
    Refusal::NotFound(format!("there is no cell \"{}\"", name.escape_debug()))
}
