//! The receiver: accepts a set-up, takes the block, acknowledges or refuses it.

use crate::cause::*;
use crate::frame::{DLE, NAK, STX, Step};
use crate::machine::{LARGEST_DATA, Machine, NEVER, after};
use crate::phase::Phase;
use crate::{Layer, frame::Decoder};
use softplug_plugin::{Context, JobId};

/// How often a free buffer is looked for, in ms.
const BUFFER_POLL: i64 = 50;

impl Machine {
    /// STX came: for a new block, or for the repetition of the one before.
    pub(crate) fn set_up_asked(&mut self, link: &mut Context<'_>, is_repetition: bool) {
        if !is_repetition {
            self.refused = 0;
            self.first_error.0 = None;
        }
        self.withdrew = false;
        self.is_faulty = false;
        self.block.clear();
        self.decoder = Decoder::default();
        self.heard = 0;
        self.departure.forget();
        if !self.options.handshake {
            // The block follows at once: it can only be refused at its end.
            self.phase = Phase::Receiving;
            self.wait(link, self.options.zvz);
            if !self.has_buffer(link) {
                self.fault(link, NO_BUFFER);
            }
            return;
        }
        self.phase = Phase::BufferWait;
        self.buffer_until = after(link, self.options.buffer_wait);
        self.look_for_buffer(link);
    }

    pub(crate) fn look_for_buffer(&mut self, link: &mut Context<'_>) {
        if self.has_buffer(link) {
            self.grant(link);
            self.departure.watch();
            self.phase = Phase::Receiving;
            self.deadline = NEVER;
        } else if link.now() >= self.buffer_until {
            self.put(link, NAK);
            self.end_reception(link, NO_BUFFER);
        } else {
            self.deadline = self.buffer_until.min(after(link, BUFFER_POLL));
        }
    }

    /// The partner sends without our DLE, which would now acknowledge its block:
    /// what comes is passed over until there is silence, then refused.
    pub(crate) fn not_waiting(&mut self, link: &mut Context<'_>) {
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
            if good == Some(STX) {
                // The same set-up once more: our DLE is still on its way.
                return;
            }
            // Where it can still be taken back, nobody takes it for an acknowledgement.
            self.take_grant_back(link);
            self.fault(link, TOO_EARLY);
        }
        self.departure.forget();
        self.wait(link, self.options.zvz);
        if good.is_none() {
            self.fault(link, DAMAGED);
        }
        let Some(byte) = raw else { return };
        self.heard = self.heard.saturating_add(1);
        match self.decoder.take(&self.options, &mut self.block, self.limit, byte) {
            Step::Inside => {}
            Step::LoneDle => {
                self.fault(link, LONE_DLE);
            }
            Step::TooLong => {
                self.put(link, NAK);
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
        self.first_error.0.get_or_insert(cause);
        self.is_faulty = true;
    }

    fn end_of_block(&mut self, link: &mut Context<'_>) {
        if !self.is_faulty {
            self.put(link, DLE);
            self.idle();
            match self.options.layer {
                Layer::None => self.deliver(link, None),
                Layer::Rk512 => self.telegram(link),
            }
            return;
        }
        self.put(link, NAK);
        self.refused = self.refused.saturating_add(1);
        let refused = i64::from(self.refused);
        let is_last = refused >= self.options.transmission_attempts;
        if is_last || self.options.bwz == 0 {
            self.end_reception(link, WRONG_BCC);
        } else {
            self.warn(link, NAK_SENT);
            self.phase = Phase::RepetitionWait;
            self.deadline = NEVER;
            self.departure.watch();
        }
    }

    /// ZVZ has run out in a block.
    pub(crate) fn silence(&mut self, link: &mut Context<'_>) {
        self.put(link, NAK);
        // Both sides withdrew: each answered the other's STX, and nothing follows.
        if self.withdrew && self.heard == 1 && self.decoder.is_after_dle() {
            self.first_error.0 = Some(BOTH_LOW);
            self.end_reception(link, BOTH_LOW);
            // Our STX may wait for the port still.
            self.drop_queue(link);
            self.end_block(link, BOTH_LOW);
        } else {
            self.end_reception(link, SILENCE);
        }
    }

    /// Gives the reception up, for its first error or else for this one.
    pub(crate) fn end_reception(&mut self, link: &mut Context<'_>, cause: Cause) {
        let cause = *self.first_error.0.get_or_insert(cause);
        self.warn(link, cause.status());
        if cause == NO_BUFFER {
            self.block.clear();
        }
        self.idle();
        if self.options.layer == Layer::None {
            self.deliver(link, Some(cause));
        }
    }

    pub(crate) fn deliver(&mut self, link: &mut Context<'_>, cause: Option<Cause>) {
        self.last_delivery = self.last_delivery.next();
        let id = self.last_delivery;
        link.delivery_begin(id, JobId::NONE);
        let room = link.delivery_room() as usize;
        let bytes = self.block.as_slice();
        let bytes = bytes.get(..bytes.len().min(room)).unwrap_or_default();
        if !bytes.is_empty() {
            link.deliver(id, bytes);
        }
        link.delivery_end(id, cause.map(Cause::failure), cause.map_or(0, Cause::status));
    }
}
