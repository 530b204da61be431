//! Which events fit a cell as it is.

use crate::cell::Cell;
use crate::event::{Event, Mode, Refused};
use crate::setup::{AxisId, ChannelId, ChannelSet, GroupId};
use crate::word::Word;

impl Cell {
    /// Whether an event fits.
    ///
    /// # Errors
    /// Why it does not.
    pub fn check(&self, event: &Event) -> Result<(), Refused> {
        match event {
            Event::Begin { channel, by_hand, .. } => {
                self.check_channel(*channel)?;
                self.check_begin(*channel, *by_hand)?;
                self.check_not_jogging(*channel)
            }
            Event::Reached { channel, word } => {
                self.check_runs(*channel)?;
                self.knows(word)?;
                if !self.of(*channel).deprived.is_empty() {
                    return Err(Refused::Interrupted(self.name(*channel)));
                }
                if self.waits(*channel) {
                    return Err(Refused::Waits(self.name(*channel)));
                }
                Ok(())
            }
            Event::Ended { channel, .. } => self.check_runs(*channel),
            Event::Unloaded { channel }
            | Event::Paused { channel, .. }
            | Event::Lost { channel, .. } => self.check_channel(*channel),
            Event::Mode { group, mode } => self.check_mode(*group, *mode),
            Event::Force { axis, channel } => {
                self.check_axis(*axis)?;
                self.check_channel(*channel)?;
                if self.runs(*channel) {
                    return Ok(());
                }
                let axis = self.setup.axis_name(*axis).to_owned();
                Err(Refused::NoUse { axis, channel: self.name(*channel) })
            }
            Event::Free { axis } => self.check_axis(*axis),
            Event::Restarted { cut_off, .. } => {
                cut_off.iter().try_for_each(|one| self.check_channel(one))
            }
            Event::Clear => Ok(()),
        }
    }

    pub(crate) fn check_begin(&self, channel: ChannelId, by_hand: bool) -> Result<(), Refused> {
        if self.state.is_stopped {
            return Err(Refused::Stopped);
        }
        if let Some(program) = &self.of(channel).program {
            let program = program.escape_debug().to_string();
            return Err(Refused::Runs { channel: self.name(channel), program });
        }
        let group = self.setup.group_of(channel);
        let mode = self.mode(group);
        let hint = match (mode, by_hand) {
            (Mode::Auto | Mode::JogInAuto, _) | (Mode::Mda, true) => return Ok(()),
            (Mode::Mda, false) => "the queue waits until it is in AUTO",
            (Mode::Jog, _) => "choose AUTO to begin a program",
        };
        Err(self.wrong_mode(group, hint))
    }

    /// What another channel starts stands until the axes are no longer moved by hand; all else is not begun
    /// before.
    fn check_not_jogging(&self, channel: ChannelId) -> Result<(), Refused> {
        let group = self.setup.group_of(channel);
        if self.mode(group) != Mode::JogInAuto {
            return Ok(());
        }
        Err(self.wrong_mode(group, "the queue waits until it is in AUTO"))
    }

    fn wrong_mode(&self, group: GroupId, hint: &'static str) -> Refused {
        let mode = self.mode(group).name();
        Refused::Mode { group: self.setup.group_name(group).to_owned(), mode, hint }
    }

    fn check_mode(&self, group: GroupId, mode: Mode) -> Result<(), Refused> {
        let Some((.., set)) = self.setup.groups().find(|(id, ..)| *id == group) else {
            return Err(Refused::Unknown(format!("group {}", group.0 + 1)));
        };
        // JOG in AUTO counts as AUTO: programs stay where they are.
        let is_auto = |mode: Mode| matches!(mode, Mode::Auto | Mode::JogInAuto);
        let running: ChannelSet = set.iter().filter(|one| self.runs(*one)).collect();
        let stays = mode == self.mode(group) || (is_auto(mode) && is_auto(self.mode(group)));
        if stays || running.is_empty() {
            return Ok(());
        }
        let group = self.setup.group_name(group).to_owned();
        Err(Refused::GroupRuns { group, running: self.setup.names(running) })
    }

    fn check_runs(&self, channel: ChannelId) -> Result<(), Refused> {
        self.check_channel(channel)?;
        if self.runs(channel) { Ok(()) } else { Err(Refused::Idle(self.name(channel))) }
    }

    fn check_channel(&self, channel: ChannelId) -> Result<(), Refused> {
        let is_there = usize::from(channel.0) < self.state.channels.len();
        if is_there { Ok(()) } else { Err(Refused::Unknown(channel.to_string())) }
    }

    fn check_axis(&self, axis: AxisId) -> Result<(), Refused> {
        let is_there = usize::from(axis.0) < self.state.axes.len();
        if is_there { Ok(()) } else { Err(Refused::Unknown(format!("axis {}", axis.0 + 1))) }
    }

    pub(crate) fn knows(&self, word: &Word) -> Result<(), Refused> {
        match word {
            Word::Wait { with, .. } => with.iter().try_for_each(|one| self.check_channel(one)),
            Word::Load { channel, .. } | Word::Start { channel } => self.check_channel(*channel),
            Word::Get { axis, .. } | Word::Release { axis } => self.check_axis(*axis),
        }
    }
}
