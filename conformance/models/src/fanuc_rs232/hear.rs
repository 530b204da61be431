//! What the control says, and what comes of it.

use super::Fanuc;
use super::control::{Context, Control};
use super::punch::{Punch, With};
use super::rules::Code;
use softplug_abi::{Failure, Micros, ModemLines};

impl Fanuc {
    pub(super) fn punch(&mut self) -> (&mut Punch, With<'_>) {
        let Self { rules, punch, room, requests, demands, .. } = self;
        (punch, With { rules, room, requests, demands })
    }

    /// Where characters stand that come now.
    pub(super) fn context(&self) -> Context {
        if !self.punch.is_idle() {
            return Context::of(self.punch.code());
        }
        // Outside a capture the code is the one that is sent; the page does not say so.
        match self.rules.code {
            Code::Iso => Context::Iso,
            Code::Eia if self.rules.plain_codes && self.feed.is_transfer() => Context::PlainEia,
            Code::Eia => Context::Eia,
        }
    }

    /// A character that came whole.
    pub(super) fn hear(&mut self, at: Micros, byte: u8) {
        let control = self.context().control(byte, &self.rules);
        let was_idle = self.punch.is_idle();
        self.punch.was_heard(at);
        match control {
            Some(Control::Dc1) => self.dc1(at),
            Some(Control::Dc2) => self.dc2(at),
            Some(Control::Dc3) if !self.punch.is_idle() => self.feed.take_dc1_back(),
            Some(Control::Dc3) => self.feed.dc3(at, &mut self.wire, &mut self.demands),
            Some(Control::Dc4) => {
                let (punch, mut with) = self.punch();
                punch.dc4(at, &mut with);
            }
            Some(Control::Syn) => {
                self.partner_ends(at, Failure::PartnerReset, "fanuc-rs232.punch.reset");
            }
            Some(Control::Nak) => {
                self.partner_ends(at, Failure::PartnerAlarm, "fanuc-rs232.punch.alarm");
            }
            None if !self.punch.is_idle() => {
                let (punch, mut with) = self.punch();
                punch.whole(at, byte, &mut with);
            }
            // In a transfer a `%` can be one of ours that comes back, also while it is held.
            None if !self.rules.need_dc2 && !self.feed.is_transfer() && !self.is_deaf(at) => {
                let (punch, mut with) = self.punch();
                punch.begin_without_dc2(at, byte, &mut with);
                if !self.punch.is_idle() {
                    // As DC2 does it.
                    self.feed.take_dc1_back();
                }
            }
            None => {}
        }
        if was_idle && control.is_none() {
            self.hear_silence(at);
        }
        self.look_at_job(at);
    }

    /// Our own characters can come back behind a job's end, and those of a capture that
    /// was given up still come: until the line was silent, no `%` begins a capture. The
    /// page does not say so.
    pub(super) fn is_deaf(&self, at: Micros) -> bool {
        self.punch.deaf.is_some_and(|since| since + self.rules.end_quiet > at)
    }

    /// A character breaks that silence.
    pub(super) fn hear_silence(&mut self, at: Micros) {
        self.punch.deaf = self.is_deaf(at).then_some(at);
    }

    /// The control is stopped where room is short.
    pub(super) fn stop_if_short(&mut self) {
        if !self.punch.is_idle() {
            let (room, code) = (self.room.known(), self.punch.code());
            self.flow.look(room, code, &self.rules, &mut self.wire, &mut self.demands);
        }
    }

    pub(super) fn dc1(&mut self, at: Micros) {
        let is_wanted = self.feed.is_waiting() || self.feed.is_held();
        let ends = is_wanted || self.punch.is_leaving();
        if !self.punch.is_idle() && !ends {
            return;
        }
        self.stop_if_short();
        let (punch, mut with) = self.punch();
        punch.end(at, None, "fanuc-rs232.punch.while-waiting", &mut with);
        self.feed.dc1(&mut self.wire);
        self.end_output();
    }

    /// A control that reads puts nothing out.
    pub(super) fn end_output(&mut self) {
        if self.feed.is_reading() {
            self.flow.end(&self.rules, &mut self.wire, &mut self.demands);
        }
    }

    pub(super) fn dc2(&mut self, at: Micros) {
        if self.punch.is_idle() && self.feed.is_reading() {
            return;
        }
        self.feed.take_dc1_back();
        // Behind the closing `%` it begins the next capture; the page does not say so.
        if self.punch.is_ended() || self.punch.is_leaving() {
            self.stop_if_short();
            let (punch, mut with) = self.punch();
            punch.end(at, None, "fanuc-rs232.punch.after-dc4", &mut with);
        }
        if self.punch.is_idle() {
            self.punch.begin(at, &self.rules);
        }
        self.stop_if_short();
        self.flow.dc2(self.room.known(), &self.rules, &mut self.wire);
    }

    /// SYN or NAK.
    pub(super) fn partner_ends(&mut self, at: Micros, failure: Failure, clause: &'static str) {
        self.feed.take_dc1_back();
        self.feed.partner_ends(failure, &mut self.wire, &mut self.demands);
        if !self.punch.is_idle() {
            self.stop_if_short();
            let (punch, mut with) = self.punch();
            punch.end(at, Some(failure), clause, &mut with);
        }
    }

    pub(super) fn modem_lines(&mut self, at: Micros, named: ModemLines, on: ModemLines) {
        if !named.contains(ModemLines::DSR) {
            return;
        }
        let Some(dsr) = &mut self.dsr else { return };
        let was_on = std::mem::replace(dsr, on.contains(ModemLines::DSR));
        if was_on && !*dsr && self.rules.watch_dsr {
            let failure = Failure::PartnerGone;
            // The page does not say that it takes a DC1 back.
            self.feed.take_dc1_back();
            self.feed.partner_ends(failure, &mut self.wire, &mut self.demands);
            let (punch, mut with) = self.punch();
            punch.end(at, Some(failure), "fanuc-rs232.punch.dsr", &mut with);
            self.look_at_job(at);
        }
    }

    pub(super) fn abort_capture(&mut self, at: Micros) {
        if !self.punch.is_idle() {
            let (punch, mut with) = self.punch();
            punch.end(at, Some(Failure::Aborted), "fanuc-rs232.punch.abort", &mut with);
            self.punch.deaf = Some(at);
        }
        self.flow.go(&self.rules, &mut self.wire, &mut self.demands);
    }

    /// A transfer may have ended.
    pub(super) fn look_at_job(&mut self, at: Micros) {
        if std::mem::take(&mut self.feed.has_ended) {
            self.punch.deaf = Some(at);
        }
    }

    /// The host may have made room.
    pub(super) fn look_at_room(&mut self, at: Micros) {
        if self.room.grows() {
            let room = self.room.known();
            let goes_on = self.flow.has_grown(room, &self.rules, &mut self.wire, &mut self.demands);
            if goes_on {
                self.punch.was_heard(at);
            }
        }
    }
}
