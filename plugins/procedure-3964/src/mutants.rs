//! What mutants need beyond a condition. Without the feature `mutants` all of this
//! changes nothing and is left out.

use crate::Priority;
use crate::cause::{DAMAGED, SET_UP_REFUSED, STOPPED, WRONG_BCC};
use crate::frame::{DLE, Decoder, NAK, STX};
use crate::machine::{Machine, NEVER, put};
use crate::phase::Phase;
use core::sync::atomic::{AtomicBool, Ordering};
use softplug_plugin::{Context, Micros, Opening, Parity, mutant};

/// A reception that a mutant takes over a closed link.
static RECEPTION: AtomicBool = AtomicBool::new(false);

impl Machine {
    /// Before the link closes.
    #[inline]
    pub(crate) fn mutate_closed(&self) {
        if mutant!("r3964.line.close/reception-goes-on") {
            RECEPTION.store(self.phase == Phase::Receiving, Ordering::Relaxed);
        }
    }

    /// Behind the opening, or the taking over, of a link.
    #[inline]
    pub(crate) fn mutate_opening(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if mutant!("r3964.line.start-nak/when-taking-over") && opening.resumed {
            put(link, NAK);
        }
        if mutant!("r3964.line.close/reception-goes-on") && RECEPTION.load(Ordering::Relaxed) {
            self.phase = Phase::Receiving;
        }
        if mutant!("r3964.line.any-format/check-needs-parity")
            && opening.line.parity == Parity::None
        {
            self.options.bcc = false;
        }
        if mutant!("r3964.line.any-format/slow-without-a-rate") && opening.line.baud == 0 {
            self.options.qvz = 20_000;
        }
        if mutant!("r3964.rx.too-long/room-of-the-host-ignored") {
            self.limit = self.options.block_size as u16;
        }
        if mutant!("rk512.line.telegram/size-as-set") {
            self.limit = self.limit.min(self.options.block_size as u16);
        }
    }

    /// Behind the beginning of QVZ.
    #[inline]
    pub(crate) fn mutate_qvz(&mut self) {
        let is_late = mutant!("r3964.tx.qvz/tick-late")
            || (mutant!("3964.tx.qvz/tick-late") && !self.options.bcc);
        self.deadline.0 += i64::from(is_late);
        self.deadline.0 -= i64::from(mutant!("r3964.tx.qvz/tick-early"));
        if mutant!("r3964.tx.qvz/not-at-the-end") && self.phase == Phase::AcknowledgementWait {
            self.deadline = NEVER;
        }
    }

    /// Behind each new beginning of ZVZ in a block.
    #[inline]
    pub(crate) fn mutate_zvz(&mut self, link: &Context<'_>, before: Micros) {
        if mutant!("r3964.rx.zvz/not-begun-anew") && before != NEVER {
            self.deadline = before;
        }
        if mutant!("r3964.rx.zvz/acknowledgement-delay-instead") {
            self.wait(link, 2_000);
        }
        self.deadline.0 += i64::from(mutant!("r3964.rx.zvz/tick-late"));
        self.deadline.0 -= i64::from(mutant!("r3964.rx.zvz/tick-early"));
    }

    /// Whether a first byte of data is taken for something else.
    #[inline]
    pub(crate) fn is_mutant_first(&mut self, good: Option<u8>) -> bool {
        let is_first = self.block.is_empty() && !self.decoder.is_after_dle();
        if mutant!("r3964.rx.transparent/first-nak-ends") && is_first && good == Some(NAK) {
            self.idle();
            return true;
        }
        let is_lost = mutant!("r3964.rx.second-stx/ever-repeated")
            || (mutant!("r3964-simplified.rx.no-handshake/stx-in-the-data-lost")
                && !self.options.handshake);
        is_lost && is_first && good == Some(STX)
    }

    /// Whether a damaged character is taken as it was read.
    #[inline]
    pub(crate) fn is_mutant_damage(&self, raw: Option<u8>) -> bool {
        mutant!("r3964.rx.line-error/taken")
            || (mutant!("r3964.rx.line-error/overrun-passed-over") && raw.is_none())
            || (mutant!("3964.rx.repetition/damaged-taken") && !self.options.bcc)
    }

    /// Whether a good block is not acknowledged.
    #[inline]
    pub(crate) fn is_mutant_silent(&self) -> bool {
        mutant!("r3964.rx.deliver/not-acknowledged")
            || mutant!("r3964-simplified.rx.set-up/block-not-acknowledged")
            || (mutant!("3964.rx.acknowledge/not-acknowledged") && !self.options.bcc)
    }

    /// Whether a bad block is not refused.
    #[inline]
    pub(crate) fn is_mutant_silent_on_error(&self) -> bool {
        (mutant!("r3964.rx.bcc/not-answered") && self.first_error == Some(WRONG_BCC))
            || (mutant!("r3964.rx.line-error/not-answered") && self.first_error == Some(DAMAGED))
            || (mutant!("3964.rx.repetition/not-answered") && !self.options.bcc)
            || mutant!("r3964-simplified.rx.one-attempt/not-answered")
    }

    /// Whether a block is passed over as the repetition of the one before, which the
    /// place of a job's block remembers.
    #[inline]
    pub(crate) fn is_mutant_repeated(&mut self) -> bool {
        let is_suspicious = mutant!("r3964.rx.at-least-once/passed-over")
            || mutant!("r3964-simplified.rx.at-least-once/passed-over");
        if !is_suspicious || self.has_job() {
            return false;
        }
        let is_known = self.job.block.as_slice() == self.block.as_slice();
        self.job.block.clear();
        self.job.block.extend(self.block.as_slice());
        is_known
    }

    /// How much longer a job's block counts than it is.
    #[inline]
    pub(crate) fn mutant_length(&self) -> i64 {
        let doubled = self.job.block.as_slice().iter().filter(|byte| **byte == DLE);
        let doubled =
            if mutant!("r3964.tx.too-long/doubled-counted") { doubled.count() } else { 0 };
        doubled as i64 + i64::from(mutant!("r3964.tx.too-long/one-less"))
            - i64::from(mutant!("r3964.tx.too-long/one-more"))
    }

    /// Whether a job begins though the line is not idle.
    #[inline]
    pub(crate) fn is_mutant_impatient(&self) -> bool {
        match self.phase {
            Phase::Receiving => mutant!("r3964.tx.waits/not-for-the-block"),
            Phase::RepetitionWait => mutant!("r3964.tx.waits/not-for-the-repetition"),
            Phase::BufferWait => mutant!("r3964.tx.waits/not-for-the-buffer"),
            Phase::Garbage => mutant!("r3964.tx.waits/not-for-the-silence"),
            _ => false,
        }
    }

    /// Low priority: whether the partner's STX is not given way to.
    #[inline]
    pub(crate) fn is_mutant_firm(&mut self, link: &mut Context<'_>) -> bool {
        if mutant!("r3964.conflict.low/job-dropped") {
            self.fail_job(link, SET_UP_REFUSED);
        }
        mutant!("3964.conflict.low/insists") && !self.options.bcc
    }

    /// Behind the restoring of what was saved.
    #[inline]
    pub(crate) fn mutate_restored(&mut self) {
        if mutant!("r3964.line.swap/delay-forgotten") {
            self.deadline = NEVER;
        }
        if mutant!("r3964.line.swap/half-pair-forgotten") {
            self.decoder.forget_dle();
        }
        if mutant!("r3964.line.swap/check-character-begun-anew") {
            self.decoder = Decoder::default();
        }
        if mutant!("r3964.line.swap/refusals-forgotten") {
            self.refused = 0;
        }
        if mutant!("r3964.line.swap/set-ups-forgotten") {
            self.setups = 1;
        }
    }

    /// A character in any state: whether a mutant took it.
    #[inline]
    pub(crate) fn is_mutant_character(
        &mut self,
        link: &mut Context<'_>,
        good: Option<u8>,
        raw: Option<u8>,
    ) -> bool {
        match self.phase {
            Phase::Idle => self.is_mutant_in_idle(link, good, raw),
            Phase::Garbage | Phase::Disturbed => self.is_mutant_in_noise(link, good),
            Phase::RepetitionWait => {
                let is_set_up = mutant!("r3964.rx.repetition/any-character-begins")
                    || (mutant!("r3964.rx.repetition/damaged-stx-begins") && raw == Some(STX));
                if is_set_up {
                    self.set_up_asked(link, true);
                }
                is_set_up
            }
            Phase::DleWait => self.is_mutant_awaiting(link, good, raw),
            Phase::Sending => self.is_mutant_interrupted(link, good),
            Phase::AcknowledgementWait => {
                let is_false = (mutant!("r3964.tx.no-false-success/nak") && good == Some(NAK))
                    || (mutant!("r3964.tx.no-false-success/stx") && good == Some(STX))
                    || (mutant!("r3964.tx.no-false-success/damaged-dle")
                        && good.is_none()
                        && raw == Some(DLE));
                if is_false {
                    self.acknowledged(link);
                }
                is_false
            }
            Phase::BufferWait | Phase::Receiving => false,
        }
    }

    /// A character in idle: whether a mutant took it.
    #[inline]
    fn is_mutant_in_idle(
        &mut self,
        link: &mut Context<'_>,
        good: Option<u8>,
        raw: Option<u8>,
    ) -> bool {
        if mutant!("r3964.rx.ignored/damaged-stx-taken") && good.is_none() && raw == Some(STX) {
            self.set_up_asked(link, false);
            return true;
        }
        let is_garbage = (mutant!("r3964.rx.ignored/nak-is-garbage") && good == Some(NAK))
            || (mutant!("r3964.rx.ignored/damaged-is-garbage") && good.is_none());
        if is_garbage {
            self.garbage(link);
        }
        is_garbage
    }

    /// A character where silence is awaited: whether a mutant took it.
    #[inline]
    fn is_mutant_in_noise(&mut self, link: &mut Context<'_>, good: Option<u8>) -> bool {
        if self.phase == Phase::Disturbed {
            if mutant!("r3964.tx.stop-on-other/nak-ends-the-silence") && good == Some(NAK) {
                self.repeat_block(link, STOPPED);
                return true;
            }
            return mutant!("r3964.tx.stop-on-other/silence-not-begun-anew");
        }
        if mutant!("r3964.rx.garbage/stx-taken") && good == Some(STX) {
            self.set_up_asked(link, false);
            return true;
        }
        mutant!("r3964.rx.garbage/silence-not-begun-anew")
    }

    /// While DLE is awaited: whether a mutant took the character.
    #[inline]
    fn is_mutant_awaiting(
        &mut self,
        link: &mut Context<'_>,
        good: Option<u8>,
        raw: Option<u8>,
    ) -> bool {
        let is_conflict = good == Some(STX) && self.options.priority != Priority::None;
        if is_conflict && self.options.priority == Priority::High {
            if mutant!("r3964.conflict.high/delay-begun-anew") {
                self.wait(link, 2_000);
            }
            if mutant!("r3964.conflict.high/refuses") {
                put(link, NAK);
            }
        }
        if is_conflict {
            return false;
        }
        if self.departure.is_pending() {
            let is_accepted = mutant!("r3964.tx.late-dle/begins-the-block") && good == Some(DLE);
            if is_accepted {
                self.send_block();
            }
            let is_refused = mutant!("r3964.tx.late-dle/noise-uses-up-an-attempt");
            if is_refused {
                self.repeat_set_up(link, SET_UP_REFUSED);
            }
            return is_accepted || is_refused;
        }
        let is_accepted = (mutant!("r3964.tx.set-up-refused/nak-taken-for-dle")
            && good == Some(NAK))
            || (mutant!("r3964.tx.set-up-refused/damaged-dle-taken") && raw == Some(DLE));
        if is_accepted {
            self.send_block();
            return true;
        }
        match good {
            Some(DLE) => false,
            Some(NAK) => mutant!("r3964.tx.set-up-refused/nak-ignored"),
            Some(_) => mutant!("r3964.tx.set-up-refused/other-ignored"),
            None => mutant!("r3964.tx.set-up-refused/damaged-ignored"),
        }
    }

    /// A character in our block: whether a mutant took it.
    #[inline]
    fn is_mutant_interrupted(&mut self, link: &mut Context<'_>, good: Option<u8>) -> bool {
        let is_early = (mutant!("r3964.tx.late-dle/acknowledges") && self.encoder.is_at_end())
            || mutant!("r3964-simplified.tx.late-dle/acknowledges")
            || (mutant!("r3964-simplified.tx.no-handshake/early-dle-acknowledges")
                && !self.options.handshake);
        if is_early && good == Some(DLE) {
            self.acknowledged(link);
            return true;
        }
        if good != Some(NAK) {
            if mutant!("r3964.tx.stop-on-other/silence-not-awaited") {
                self.drop_queue(link);
                self.repeat_block(link, STOPPED);
                return true;
            }
            return mutant!("r3964.tx.stop-on-other/ignored");
        }
        if mutant!("r3964.tx.stop-on-nak/rest-sent") {
            self.departure.forget();
            self.repeat_block(link, STOPPED);
            return true;
        }
        if mutant!("r3964.tx.stop-on-nak/silence-awaited") {
            self.drop_queue(link);
            self.phase = Phase::Disturbed;
            self.wait(link, self.options.zvz);
            return true;
        }
        mutant!("r3964.tx.stop-on-nak/ignored")
    }
}

/// All but the last of several bytes.
#[inline]
pub(crate) fn without_last(bytes: &[u8]) -> &[u8] {
    match bytes {
        [most @ .., _] if !most.is_empty() => most,
        _ => bytes,
    }
}
