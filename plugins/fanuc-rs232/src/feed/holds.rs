//! What the control says to the feed: DC1 and DC3, their times, and its end.

use super::{Feed, Stage, WAIT};
use crate::code::Control;
use crate::tape::Setup;
use softplug_plugin::{Context, Failure, NoteLevel};

impl Feed {
    /// A code of the control.
    pub(crate) fn control(&mut self, link: &mut Context<'_>, settings: &Setup, code: Control) {
        match code {
            Control::Dc1 => {
                self.set_ready(link, settings, true);
            }
            Control::Dc3 if self.is_read && self.is_busy() => {
                self.end(link);
            }
            Control::Dc3 => {
                self.set_ready(link, settings, false);
            }
            Control::Syn => {
                self.lost(link, Failure::PartnerReset);
            }
            Control::Nak => {
                self.lost(link, Failure::PartnerAlarm);
            }
            Control::Dc2 | Control::Dc4 => {}
        }
    }

    /// DC1 and DC3 that say nothing new change nothing, timers included.
    fn set_ready(&mut self, link: &mut Context<'_>, settings: &Setup, is_ready: bool) {
        if self.is_ready == is_ready {
            return;
        }
        self.is_ready = is_ready;
        if !matches!(self.stage, Stage::Idle | Stage::Checking | Stage::Waiting | Stage::Stopping) {
            self.is_started |= is_ready;
            self.update_hold(link);
            self.watch(link, settings);
        }
    }

    /// The control was reset, has an alarm or is gone: what it reads is over. A
    /// job that it has not begun to read stays.
    pub(crate) fn lost(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.is_started {
            self.stop(link, failure);
        }
        self.is_ready = false;
    }

    /// The port is gone, and with it what is in the queue.
    pub(crate) fn link_down(&mut self, link: &mut Context<'_>) {
        self.stop(link, Failure::LinkDown);
        self.is_ready = false;
    }

    /// Goes on as after DC1.
    pub(crate) fn force_resume(&mut self, link: &mut Context<'_>, settings: &Setup) {
        if self.is_busy() {
            self.set_ready(link, settings, true);
        }
    }

    pub(crate) fn set_paused(&mut self, link: &mut Context<'_>, is_paused: bool) {
        self.is_paused = is_paused;
        self.update_hold(link);
    }

    /// Nothing leaves before DC1, after DC3 and in a pause.
    pub(crate) fn update_hold(&mut self, link: &mut Context<'_>) {
        let is_active = !matches!(self.stage, Stage::Idle | Stage::Checking);
        let is_holding = is_active && (!self.is_ready || self.is_paused);
        if is_holding != self.is_holding {
            self.is_holding = is_holding;
            if is_holding { link.hold() } else { link.release() }
        }
    }

    /// Times what the feed waits for now.
    pub(super) fn watch(&mut self, link: &mut Context<'_>, settings: &Setup) {
        let span = match self.stage {
            Stage::Waiting => settings.end_wait,
            Stage::Feeding | Stage::Closing | Stage::Trailing | Stage::Draining
                if !self.is_ready =>
            {
                if self.is_started {
                    settings.held_timeout
                } else {
                    settings.dc1_timeout
                }
            }
            _ => 0,
        };
        if span > 0 {
            self.timer.start(link, WAIT, span);
        } else {
            self.timer.stop(link, WAIT);
        }
    }

    pub(crate) fn set_timers(&self, link: &mut Context<'_>) {
        self.timer.resume(link, WAIT);
    }

    /// What the feed waited for has not come.
    pub(crate) fn timer(&mut self, link: &mut Context<'_>) {
        self.timer.has_run_out();
        if self.stage == Stage::Waiting {
            link.note(NoteLevel::Warning, 0, "no DC3 after the end");
            self.end(link);
        } else {
            let failure = if self.is_started { Failure::HeldTooLong } else { Failure::NoAnswer };
            self.stop(link, failure);
        }
    }
}
