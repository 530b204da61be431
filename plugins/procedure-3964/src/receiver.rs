//! The receiver: accepts a set-up, takes the block, acknowledges or refuses it.

use crate::cause::*;
use crate::frame::{DLE, NAK, STX, Step};
use crate::machine::{Machine, NEVER, after, put};
use crate::phase::Phase;
use crate::rk512::LARGEST_DATA;
use crate::{Layer, frame::Decoder};
use softplug_plugin::{Context, mutant};

/// How often a free buffer is looked for, in ms.
const BUFFER_POLL: i64 = 50;

impl Machine {
    /// STX came: for a new block, or for the repetition of the one before.
    pub(crate) fn set_up_asked(&mut self, link: &mut Context<'_>, is_repetition: bool) {
        if !is_repetition {
            if !mutant!("r3964.rx.attempts/not-begun-anew") {
                self.refused = 0;
            }
            self.first_error = None;
        }
        if mutant!("r3964.rx.attempts/begun-anew-by-stx") {
            self.refused = 0;
        }
        self.withdrew = false;
        if !(mutant!("r3964.rx.repetition/error-kept") && is_repetition) {
            self.is_faulty = false;
        }
        if !(mutant!("r3964.rx.repetition/bad-block-kept") && is_repetition) {
            self.block.clear();
        }
        self.decoder = Decoder::default();
        self.departure.forget();
        if !self.options.handshake {
            // The block follows at once: it can only be refused at its end.
            self.phase = Phase::Receiving;
            self.wait(link, self.options.zvz);
            if mutant!("r3964-simplified.rx.no-handshake/stx-answered") {
                put(link, DLE);
            }
            if mutant!("r3964-simplified.rx.no-handshake/delay-not-begun") {
                self.deadline = NEVER;
            }
            if !self.has_buffer(link) {
                self.fault(link, NO_BUFFER);
            }
            return;
        }
        self.phase = Phase::BufferWait;
        self.buffer_until = after(link, self.options.buffer_wait);
        self.buffer_until.0 += i64::from(mutant!("r3964.rx.no-buffer/tick-late"));
        self.look_for_buffer(link);
    }

    pub(crate) fn look_for_buffer(&mut self, link: &mut Context<'_>) {
        if self.has_buffer(link) || mutant!("r3964.rx.no-buffer/accepted") {
            let is_refused = mutant!("r3964.rx.set-up/refused");
            if !mutant!("r3964-simplified.rx.set-up/stx-not-answered") {
                put(link, if is_refused { NAK } else { DLE });
            }
            self.departure.watch();
            self.phase = Phase::Receiving;
            self.deadline = NEVER;
        } else if link.now() >= self.buffer_until {
            if !mutant!("r3964.rx.no-buffer/not-answered") {
                put(link, NAK);
            }
            self.end_reception(link, NO_BUFFER);
        } else {
            self.deadline = self.buffer_until.min(after(link, BUFFER_POLL));
        }
    }

    /// The partner sends without our DLE, which would now acknowledge its block:
    /// what comes is passed over until there is silence, then refused.
    pub(crate) fn not_waiting(&mut self, link: &mut Context<'_>) {
        if mutant!("r3964.rx.no-buffer/characters-passed-over") {
            return;
        }
        self.fault(link, TOO_EARLY);
        self.decoder.close();
        self.phase = Phase::Receiving;
        self.wait(link, self.options.zvz);
    }

    /// A buffer is what the host has room for.
    fn has_buffer(&self, link: &Context<'_>) -> bool {
        let needed = match self.options.layer {
            Layer::None => self.limit.into(),
            Layer::Rk512 if self.is_reading() => LARGEST_DATA.into(),
            Layer::Rk512 => 0,
        };
        link.delivery_room() >= needed
    }

    pub(crate) fn receive(&mut self, link: &mut Context<'_>, good: Option<u8>, raw: Option<u8>) {
        if self.departure.is_pending() {
            if good == Some(STX) && !mutant!("r3964.rx.second-stx/is-another-character") {
                // The same set-up once more: our DLE is still on its way.
                return;
            }
            // Where it can still be taken back, nobody takes it for an acknowledgement.
            if !mutant!("r3964.rx.not-waiting/dle-not-taken-back") {
                self.drop_queue(link);
            }
            if !mutant!("r3964.rx.not-waiting/taken") {
                self.fault(link, TOO_EARLY);
            }
        }
        if self.is_mutant_first(good) {
            return;
        }
        self.departure.forget();
        let deadline = self.deadline;
        self.wait(link, self.options.zvz);
        self.mutate_zvz(link, deadline);
        if good.is_none() && !self.is_mutant_damage(raw) {
            self.fault(link, DAMAGED);
            if mutant!("r3964.rx.line-error/answered-at-once") {
                put(link, NAK);
                self.end_reception(link, DAMAGED);
                return;
            }
        }
        let Some(byte) = raw else { return };
        let limit = self.limit + u16::from(mutant!("r3964.rx.too-long/one-more"))
            - u16::from(mutant!("r3964.rx.too-long/one-less"));
        match self.decoder.take(&self.options, &mut self.block, limit, byte) {
            Step::Inside => {}
            Step::LoneDle => {
                if mutant!("3964.rx.repetition/lone-dle-taken") {
                    return;
                }
                self.fault(link, LONE_DLE);
                if mutant!("r3964.rx.dle-error/answered-at-once") {
                    put(link, NAK);
                    self.end_reception(link, LONE_DLE);
                }
            }
            Step::TooLong => {
                if mutant!("r3964.rx.too-long/answered-at-the-end") {
                    self.fault(link, BLOCK_TOO_LONG);
                    return;
                }
                put(link, NAK);
                self.end_reception(link, BLOCK_TOO_LONG);
            }
            Step::End(is_right) => {
                if !is_right {
                    self.fault(link, WRONG_BCC);
                }
                self.end_of_block(link);
            }
        }
    }

    /// Something is wrong with the block: it is taken to its end and refused.
    #[inline(never)]
    pub(crate) fn fault(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.warn(link, cause.status());
        self.first_error.get_or_insert(cause);
        self.is_faulty = true;
        if mutant!("r3964.rx.first-error/last-told") {
            self.first_error = Some(cause);
        }
    }

    fn end_of_block(&mut self, link: &mut Context<'_>) {
        if !self.is_faulty {
            if !self.is_mutant_silent() {
                put(link, DLE);
            }
            let deadline = self.deadline;
            self.idle();
            if mutant!("r3964.tx.waits/for-the-delay-too") {
                self.deadline = deadline;
            }
            if self.is_mutant_repeated() {
                return;
            }
            match self.options.layer {
                Layer::None => self.deliver(link, None),
                Layer::Rk512 => self.telegram(link),
            }
            return;
        }
        if !self.is_mutant_silent_on_error() {
            put(link, NAK);
        }
        self.refused = self.refused.saturating_add(1);
        let refused = i64::from(self.refused) + i64::from(mutant!("r3964.rx.attempts/one-less"))
            - i64::from(mutant!("r3964.rx.attempts/one-more"));
        let is_last = refused >= self.options.transmission_attempts;
        if is_last || self.options.bwz == 0 {
            self.end_reception(link, WRONG_BCC);
        } else {
            self.warn(link, NAK_SENT);
            if mutant!("r3964.rx.repetition/failed-all-the-same") {
                self.deliver(link, self.first_error);
            }
            self.phase = Phase::RepetitionWait;
            self.deadline = NEVER;
            self.departure.watch();
        }
    }

    /// ZVZ has run out in a block.
    pub(crate) fn silence(&mut self, link: &mut Context<'_>) {
        if mutant!("3964.rx.zvz/ends-the-block") {
            self.end_of_block(link);
            return;
        }
        let is_acknowledged = (mutant!("r3964.rx.dle-error/lone-dle-acknowledged")
            && self.decoder.is_after_dle())
            || mutant!("r3964-simplified.rx.zvz/acknowledged");
        if !mutant!("r3964.rx.zvz/not-answered") {
            put(link, if is_acknowledged { DLE } else { NAK });
        }
        // Both sides withdrew: each answered the other's STX, and nothing follows.
        let is_hidden = mutant!("r3964.conflict.both-low/not-told");
        if self.withdrew && self.block.is_empty() && self.decoder.is_after_dle() && !is_hidden {
            self.first_error = Some(BOTH_LOW);
            self.end_reception(link, BOTH_LOW);
            if !mutant!("r3964.conflict.both-low/job-begins-again") {
                self.end_block(link, BOTH_LOW);
            }
        } else {
            self.end_reception(link, SILENCE);
        }
    }

    /// Gives the reception up, for its first error or else for this one.
    pub(crate) fn end_reception(&mut self, link: &mut Context<'_>, cause: Cause) {
        let cause = *self.first_error.get_or_insert(cause);
        self.warn(link, cause.status());
        if cause == NO_BUFFER || mutant!("r3964.rx.first-error/without-data") {
            self.block.clear();
        }
        self.idle();
        if self.options.layer == Layer::None && !mutant!("r3964.rx.first-error/not-told") {
            self.deliver(link, Some(cause));
        }
    }

    pub(crate) fn deliver(&mut self, link: &mut Context<'_>, cause: Option<Cause>) {
        if mutant!("r3964.rx.deliver/last-byte-lost") {
            self.block.truncate(self.block.len().saturating_sub(1));
        }
        self.last_delivery = self.last_delivery.wrapping_add(1).max(1);
        let id = self.last_delivery;
        link.delivery_begin(id, 0);
        let room = link.delivery_room() as usize;
        let bytes = self.block.as_slice();
        let bytes = bytes.get(..bytes.len().min(room)).unwrap_or_default();
        if !bytes.is_empty() {
            link.deliver(id, bytes);
        }
        link.delivery_end(id, cause.map(Cause::failure), cause.map_or(0, Cause::status));
    }
}
