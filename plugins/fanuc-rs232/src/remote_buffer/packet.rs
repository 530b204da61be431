//! The data of a packet: pulled, encoded, given to the control, and kept until it is
//! known to have come through.

use super::message::HEAD;
use super::{DAT, EOD, RemoteBuffer, Stage, WAT};
use crate::tape::{Encoder, Setup};
use softplug_plugin::{Context, JobId};

impl RemoteBuffer {
    /// Answers GTD as soon as a packet is full or the data is at its end.
    pub(super) fn fill(&mut self, link: &mut Context<'_>, settings: &Setup, encoder: &mut Encoder) {
        if !self.is_asked {
            return;
        }
        let most = settings.packet_size as usize;
        while encoder.output.len() < most && self.stage != Stage::Closed {
            let stage = self.stage;
            let encoded = if encoder.is_waiting() {
                encoder.next(settings)
            } else if stage == Stage::Closing {
                let finished = encoder.finish(settings);
                if !encoder.is_waiting() {
                    self.stage = Stage::Closed;
                }
                finished
            } else if encoder.is_ended() {
                self.stage = Stage::Closing;
                Ok(())
            } else {
                return self.ask(link, settings, encoder, (most - encoder.output.len()) as u32);
            };
            if let Err(failure) = encoded {
                return self.fail(link, failure);
            }
        }
        self.give(link, settings, encoder);
    }

    /// Asks for as much data as fits, whatever it grows to.
    fn ask(&mut self, link: &mut Context<'_>, settings: &Setup, encoder: &Encoder, free: u32) {
        if self.wanted > 0 {
            return;
        }
        let growth = if encoder.will_wait() { free } else { settings.growth() };
        self.wanted = free.checked_div(growth).unwrap_or_default().max(1);
        link.want(JobId(self.job), self.wanted);
    }

    /// Gives the control what there is.
    pub(super) fn give(&mut self, link: &mut Context<'_>, settings: &Setup, encoder: &Encoder) {
        self.is_asked = false;
        let room = (link.transmit_room() as usize).saturating_sub(HEAD + 1);
        let most = room.min(settings.packet_size as usize);
        self.packet = encoder.output.len().min(most) as u16;
        let answer = if self.packet > 0 {
            DAT
        } else if self.stage == Stage::Closed && encoder.output.len() == 0 {
            self.stage = Stage::Ending;
            EOD
        } else {
            WAT
        };
        self.say(link, settings, encoder, answer);
    }
}
