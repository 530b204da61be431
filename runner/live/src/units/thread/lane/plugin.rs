//! The plug-in that a unit is to run: downloaded, opened, swapped.

use softplug_abi::{LinkDownReason, Micros};
use softplug_unit_protocol::{Digest, SlotState, SwapOutcome, ToUnit, WhenCode};

use super::{AGAIN, Around, UnitLane};
use crate::reactor::{LaneFault, Probation, Report, SwapReport, When};
use crate::recorder::Recording;
use crate::text::plain_text;
use crate::units::headway::Headway;
use crate::units::{UnitPlugin, longest_fields, pairs, piece};

/// A plug-in on its way into the unit.
pub(super) struct Change {
    pub(super) plugin: UnitPlugin,
    /// `None`: it is the link's first one, or has other settings.
    pub(super) swap: Option<(When, Probation)>,
    pub(super) is_ordered: bool,
    pub(super) headway: Headway,
}

impl Change {
    pub(super) fn to(plugin: UnitPlugin, swap: Option<(When, Probation)>) -> Self {
        Self { plugin, swap, is_ordered: false, headway: Headway::default() }
    }
}

impl UnitLane {
    pub(in crate::units) fn slot(&mut self, link: u8, slot: u8, state: SlotState, digest: Digest) {
        // The link itself follows, and says by its name which one it is.
        if self.number.is_none_or(|number| number == link)
            && let Some(place) = self.slots.get_mut(usize::from(slot))
        {
            *place = (state, digest);
        }
    }

    /// Has the unit take the plug-in that it is to run: downloads it if it is not there.
    pub(super) fn order(&mut self, around: &mut Around<'_>) {
        let Some(link) = self.number.filter(|_| self.foreign_job.is_none()) else { return };
        let slots = self.slots;
        let runs = self.runs;
        let Some(change) = self.change.as_mut().filter(|change| !change.is_ordered) else { return };
        (change.is_ordered, change.headway) = (true, Headway::default());
        let UnitPlugin { ref module, digest, ref signature, ref settings } = change.plugin;
        let is_there = digest == runs
            || slots.iter().any(|(state, there)| {
                *there == digest
                    && matches!(
                        state,
                        SlotState::Written | SlotState::OnTrial | SlotState::Confirmed
                    )
            });
        if !is_there {
            let signature = signature.as_deref().unwrap_or_default();
            let length = module.len() as u32;
            if signature.len() > piece(around.outbox) {
                self.not_taken("it takes no message as long as a signature", around);
                return;
            }
            around.say(&ToUnit::Download { link, length, digest, signature });
            return;
        }
        let settings = &pairs(settings);
        let most = longest_fields(around.outbox);
        if settings.len() > most {
            let text = format!("its settings have {} bytes; {most} are the most", settings.len());
            self.not_taken(&text, around);
            return;
        }
        match change.swap {
            None => around.say(&ToUnit::Open { link, digest, settings }),
            Some((when, probation)) => {
                let when = match when {
                    When::Now => WhenCode::Now,
                    When::Idle => WhenCode::Idle,
                    When::NowOrIdle => WhenCode::NowOrIdle,
                };
                let (events, span) = (probation.events, probation.span.0.max(0) as u64);
                around.say(&ToUnit::Swap { link, digest, when, events, span, settings });
            }
        }
    }

    pub(super) fn downloaded(&mut self, until: u32, around: &mut Around<'_>) {
        let (Some(link), Some(change)) = (self.number, &mut self.change) else { return };
        change.headway.take(until);
        if change.headway.is_none() {
            self.not_taken("it answers, and the download goes no further", around);
            return;
        }
        let module = &change.plugin.module;
        let rest = module.get(until as usize..).unwrap_or_default();
        if rest.is_empty() {
            around.say(&ToUnit::Install { link });
        } else {
            let bytes = &rest[..rest.len().min(piece(around.outbox))];
            around.say(&ToUnit::Piece { link, at: until, bytes });
        }
    }

    pub(super) fn installed(&mut self, slot: u8, around: &mut Around<'_>) {
        let Some(change) = &mut self.change else { return };
        if let Some(place) = self.slots.get_mut(usize::from(slot)) {
            *place = (SlotState::Written, change.plugin.digest);
        }
        change.is_ordered = false;
        self.order(around);
    }

    /// The unit does not take the plug-in.
    pub(super) fn not_taken(&mut self, why: &str, around: &mut Around<'_>) {
        let Some(change) = &mut self.change else { return };
        if change.swap.is_some() {
            self.change = None;
            let sentence = format!("the unit does not take it: {why}");
            self.report(Report::Swapped(SwapReport::Refused { sentence }), around);
            return;
        }
        change.is_ordered = false;
        // What its slots hold is of no use, whatever they say: it is downloaded again then.
        let digest = change.plugin.digest;
        for place in self.slots.iter_mut().filter(|(_, there)| *there == digest) {
            *place = (SlotState::Empty, [0; 32]);
        }
        self.runs = [0; 32];
        self.again_at = Some(around.thread.clock.now() + AGAIN);
        let detail = format!("the unit does not take the plug-in: {why}");
        self.down(LinkDownReason::Failed, detail, AGAIN, around.thread);
    }

    pub(super) fn cancel_swap(&mut self, around: &mut Around<'_>) {
        let is_ordered =
            self.change.as_ref().map(|change| (change.swap.is_some(), change.is_ordered));
        match is_ordered {
            Some((true, true)) => self.plain(|link| ToUnit::CancelSwap { link }, around),
            Some((true, false)) => {
                self.change = None;
                let sentence = "it was given up".to_owned();
                self.report(Report::Swapped(SwapReport::Refused { sentence }), around);
            }
            Some((false, _)) | None => {}
        }
    }

    pub(super) fn swapped(
        &mut self,
        outcome: SwapOutcome,
        pause: Micros,
        why: &str,
        around: &mut Around<'_>,
    ) {
        let has_probation = self
            .change
            .as_ref()
            .and_then(|change| change.swap)
            .is_some_and(|(_, probation)| probation != Probation::default());
        let report = match outcome {
            SwapOutcome::Waiting => SwapReport::Waiting,
            SwapOutcome::DoneWithState | SwapOutcome::Done => {
                if let Some(change) = self.change.take() {
                    self.runs = change.plugin.digest;
                    self.former = Some(std::mem::replace(&mut self.setup.plugin, change.plugin));
                }
                let with_state = outcome == SwapOutcome::DoneWithState;
                let on_probation = with_state && has_probation;
                SwapReport::Done { pause, with_state, on_probation }
            }
            SwapOutcome::Refused => {
                self.change = None;
                SwapReport::Refused { sentence: plain_text(why) }
            }
            SwapOutcome::Kept => {
                self.former = None;
                SwapReport::Kept
            }
            SwapOutcome::Reverted => {
                if let Some(former) = self.former.take() {
                    self.runs = former.digest;
                    self.setup.plugin = former;
                }
                SwapReport::Reverted(Box::new(fault(why, true)))
            }
        };
        self.report(Report::Swapped(report), around);
    }
}

pub(super) fn fault(sentence: &str, on_probation: bool) -> LaneFault {
    LaneFault {
        event: None,
        sentence: plain_text(sentence),
        last_words: None,
        recording: Recording::default(),
        on_probation,
    }
}
