//! The data of a packet: pulled, encoded, given to the control, and kept until it is
//! known to have come through.

use super::message::HEAD;
use super::{DAT, EOD, RemoteBuffer, Stage, WAT};
use crate::tape::Encoder;
use crate::{PACKET, Settings, set_timer};
use softplug_plugin::{Context, Micros};

impl RemoteBuffer {
    /// Answers GTD as soon as a packet is full or the data is at its end.
    pub(super) fn fill(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        encoder: &mut Encoder,
    ) {
        if !self.is_asked {
            return;
        }
        let most = settings.packet_size as usize;
        while self.filled < most && self.stage != Stage::Closed {
            let stage = self.stage;
            let mut sink = |byte| self.push(byte);
            let encoded = if encoder.is_waiting() {
                encoder.next(settings, &mut sink)
            } else if stage == Stage::Closing {
                let finished = encoder.finish(settings, &mut sink);
                if !encoder.is_waiting() {
                    self.stage = Stage::Closed;
                }
                finished
            } else if encoder.is_ended() {
                self.stage = Stage::Closing;
                Ok(())
            } else {
                return self.ask(link, settings, encoder, (most - self.filled) as u32);
            };
            if let Err(failure) = encoded {
                return self.fail(link, failure);
            }
        }
        self.give(link, settings);
    }

    /// Asks for as much data as fits, whatever it grows to; while it is waited for
    /// the control must hear something.
    fn ask(&mut self, link: &mut Context<'_>, settings: &Settings, encoder: &Encoder, free: u32) {
        if self.wanted > 0 {
            return;
        }
        let growth = if encoder.will_wait() { free } else { encoder.growth(settings) };
        self.wanted = free.checked_div(growth).unwrap_or_default().max(1);
        link.want(self.job, self.wanted);
        let at = link.now() + Micros::from_millis(settings.poll_time / 2);
        set_timer(link, PACKET, &mut self.until, Some(at));
    }

    /// A byte from the encoder, behind what is in the buffer.
    pub(super) fn push(&mut self, byte: u8) {
        if let Some(place) = self.buffer.get_mut(self.filled) {
            *place = byte;
            self.filled += 1;
        }
    }

    /// Gives the control what there is.
    pub(super) fn give(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.is_asked = false;
        let room = (link.transmit_room() as usize).saturating_sub(HEAD + 1);
        self.packet = self.filled.min(settings.packet_size as usize).min(room);
        let answer = if self.packet > 0 {
            DAT
        } else if self.stage == Stage::Closed && self.filled == 0 {
            self.stage = Stage::Ending;
            EOD
        } else {
            WAT
        };
        self.say(link, settings, answer);
    }

    /// What was sent is not needed again.
    pub(super) fn confirm(&mut self) {
        let rest = self.filled.saturating_sub(self.packet);
        for at in 0..rest {
            let byte = self.buffer.get(at + self.packet).copied().unwrap_or_default();
            if let Some(place) = self.buffer.get_mut(at) {
                *place = byte;
            }
        }
        self.filled = rest;
        self.packet = 0;
    }
}
