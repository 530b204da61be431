//! Sees the plug-in's actions on their way to the host: what concerns the port
//! is kept for it, what is counted is counted.

use softplug_abi::{Action, JobId, Micros, ModemLines};
use softplug_link::{LinkHost, Supply};

use super::{ChannelHost, Counters};
use crate::pacer::Pacer;
use crate::port::Input;

pub(super) struct Tap<'a> {
    host: &'a mut dyn ChannelHost,
    counters: &'a mut Counters,
    pacer: &'a Pacer,
    /// Lines to set: which, and which of them on.
    pub(super) modem_lines: Option<(ModemLines, ModemLines)>,
    /// A job has failed: what it still had on the way is wanted no more.
    pub(super) has_failed: bool,
}

impl<'a> Tap<'a> {
    pub(super) fn new(
        host: &'a mut dyn ChannelHost,
        counters: &'a mut Counters,
        pacer: &'a Pacer,
    ) -> Self {
        Self { host, counters, pacer, modem_lines: None, has_failed: false }
    }

    pub(super) fn heard(&mut self, now: Micros, input: &Input<'_>) {
        self.counters.count_input(input);
        self.host.heard(now, input);
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for Tap<'_> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        match action {
            Action::Hold => self.counters.hold(now, self.pacer.in_flight(now)),
            Action::Release => self.counters.release(now),
            Action::JobFailed { .. } => self.has_failed = true,
            Action::ModemLines { mask, on } => {
                let (set, set_on) = self.modem_lines.unwrap_or_default();
                let on = ModemLines((set_on.0 & !mask.0) | on.0);
                self.modem_lines = Some((set.union(*mask), on));
            }
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::DeliveryBegin { .. }
            | Action::Deliver { .. }
            | Action::DeliveryName { .. }
            | Action::DeliveryEnd { .. }
            | Action::JobDone { .. }
            | Action::CheckResult { .. }
            | Action::Request { .. }
            | Action::Withdraw { .. }
            | Action::Note { .. }
            | Action::State { .. }
            | Action::Saved { .. } => {}
        }
        self.host.handle(now, action);
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        self.host.supply(job, buffer)
    }

    fn rewind(&mut self, job: JobId) {
        self.host.rewind(job);
    }

    fn drained(&mut self) -> u32 {
        self.host.drained()
    }
}
