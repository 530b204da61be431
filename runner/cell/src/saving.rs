//! A cell as it is written down, and read again.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::cell::{Cell, State};
use crate::event::Mode;
use crate::setup::{AxisId, ChannelId, Setup};
use crate::word::Word;

/// What is saved has this shape.
const FORMAT: u8 = 1;

/// A cell as it is saved.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Saved {
    format: u8,
    channels: Vec<String>,
    axes: Vec<String>,
    groups: Vec<String>,
    state: State,
}

/// Why what was saved is not taken.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum RestoreError {
    /// Another version wrote it.
    #[error("the cell was saved in format {0}, and this version reads format {FORMAT}")]
    Format(u8),
    /// Channels, axes or groups are others now, and something was under way.
    #[error(
        "the cell's channels, axes or groups were changed while programs ran or axes were owned"
    )]
    OtherSetup,
    /// It names what there is not, or contradicts itself.
    #[error("what was saved of the cell is damaged")]
    Damaged,
}

impl Saved {
    /// The names of its channels.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }
}

impl Cell {
    /// As it is, to be written down.
    pub fn save(&self) -> Saved {
        let (channels, axes, groups) = self.names();
        Saved { format: FORMAT, channels, axes, groups, state: self.state.clone() }
    }

    /// A cell as it was saved.
    ///
    /// # Errors
    /// Another version saved it, it is damaged, or the setup is another one and something was
    /// under way. If nothing was, the cell begins anew; one that was stopped, or of which a group was
    /// not in AUTO, is stopped.
    pub fn restore(setup: Setup, saved: Saved) -> Result<Self, RestoreError> {
        if saved.format != FORMAT {
            return Err(RestoreError::Format(saved.format));
        }
        let fresh = Self::new(setup);
        if fresh.names() != (saved.channels, saved.axes, saved.groups) {
            let is_idle = saved.state.channels.iter().all(|one| one.program.is_none())
                && saved.state.axes.iter().all(|axis| axis.owner.is_none());
            // Somebody is at the machines: nothing begins before they say so.
            let is_manned = saved.state.modes.iter().any(|mode| *mode != Mode::Auto);
            return match (is_idle, is_manned || saved.state.is_stopped) {
                (true, false) => Ok(fresh),
                (true, true) => Ok(Self::stopped(fresh.setup)),
                (false, _) => Err(RestoreError::OtherSetup),
            };
        }
        let cell = Self { state: saved.state, ..fresh };
        if cell.is_sound() { Ok(cell) } else { Err(RestoreError::Damaged) }
    }

    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        let setup = &self.setup;
        (
            setup.channels().map(|one| setup.channel_name(one).to_owned()).collect(),
            setup.axes().map(|axis| setup.axis_name(axis).to_owned()).collect(),
            setup.groups().map(|(_, name, set)| format!("{name}: {}", setup.names(set))).collect(),
        )
    }

    /// What holds between any two events.
    fn is_sound(&self) -> bool {
        let (channels, axes) = (self.setup.channels().count(), self.setup.axes().count());
        let state = &self.state;
        let is_channel = |one: &ChannelId| usize::from(one.0) < channels;
        let sizes = state.channels.len() == channels
            && state.axes.len() == axes
            && state.modes.len() == self.setup.groups().count();
        if !sizes || !state.order.iter().all(is_channel) {
            return false;
        }
        let words = state.channels.iter().filter_map(|one| one.waits.as_ref());
        let words = words.map(|waiting| waiting.word.clone()).all(|word| self.knows(&word).is_ok());
        let axes_are_known = state
            .axes
            .iter()
            .all(|axis| axis.owner.iter().all(is_channel) && axis.queue.iter().all(is_channel));
        if !words || !axes_are_known {
            return false;
        }
        self.setup.channels().all(|one| {
            let is_in_order = state.order.iter().filter(|other| **other == one).count();
            let in_queues = self.setup.axes().filter(|axis| self.axis(*axis).1.contains(&one));
            let wanted = self.setup.axes().filter(|axis| self.wants(one, *axis));
            is_in_order == usize::from(self.waits(one))
                && (self.runs(one) || (!self.waits(one) && self.of(one).deprived.is_empty()))
                && in_queues.eq(wanted)
        })
    }

    /// Whether a channel is in an axis' queue, by what it waits for.
    fn wants(&self, channel: ChannelId, axis: AxisId) -> bool {
        let state = self.of(channel);
        let asked = state.waits.as_ref().map(|waiting| &waiting.word);
        state.deprived.contains(&axis)
            || matches!(asked, Some(Word::Get { axis: asked, .. }) if *asked == axis)
    }
}
