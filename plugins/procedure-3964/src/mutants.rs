//! What mutants need beyond a condition. Without the feature `mutants` all of this
//! changes nothing and is left out.

use crate::cause::STOPPED;
use crate::frame::{DLE, Decoder, NAK, STX};
use crate::machine::{Machine, NEVER, put};
use crate::phase::Phase;
use softplug_plugin::{Context, Opening, Parity, mutant};

impl Machine {
    /// Behind the opening, or the taking over, of a link.
    #[inline]
    pub(crate) fn mutate_opening(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if mutant!("r3964.line.start-nak/when-taking-over") && opening.resumed {
            put(link, NAK);
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
    }

    /// A character where silence is awaited: whether a mutant took it.
    #[inline]
    pub(crate) fn is_mutant_in_noise(&mut self, link: &mut Context<'_>, good: Option<u8>) -> bool {
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

    /// Another character than DLE for our STX: whether a mutant took it.
    #[inline]
    pub(crate) fn is_mutant_refused(&mut self, good: Option<u8>, raw: Option<u8>) -> bool {
        let is_accepted = (mutant!("r3964.tx.set-up-refused/nak-taken-for-dle")
            && good == Some(NAK))
            || (mutant!("r3964.tx.set-up-refused/damaged-dle-taken") && raw == Some(DLE));
        if is_accepted {
            self.send_block();
            return true;
        }
        match good {
            Some(NAK) => mutant!("r3964.tx.set-up-refused/nak-ignored"),
            Some(_) => mutant!("r3964.tx.set-up-refused/other-ignored"),
            None => mutant!("r3964.tx.set-up-refused/damaged-ignored"),
        }
    }

    /// A character in our block: whether a mutant took it.
    #[inline]
    pub(crate) fn is_mutant_interrupted(
        &mut self,
        link: &mut Context<'_>,
        good: Option<u8>,
    ) -> bool {
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

/// Whether something else than a good DLE acknowledges our block.
#[inline]
pub(crate) fn is_false_acknowledgement(good: Option<u8>, raw: Option<u8>) -> bool {
    (mutant!("r3964.tx.no-false-success/nak") && good == Some(NAK))
        || (mutant!("r3964.tx.no-false-success/stx") && good == Some(STX))
        || (mutant!("r3964.tx.no-false-success/damaged-dle") && raw == Some(DLE))
}

/// All but the last of several bytes.
#[inline]
pub(crate) fn without_last(bytes: &[u8]) -> &[u8] {
    match bytes {
        [most @ .., _] if !most.is_empty() => most,
        _ => bytes,
    }
}
