//! The reception of a program that the control sends.

use crate::frame::Text;
use crate::settings::{LineEnd, Settings};
use softplug_plugin::{Context, DeliveryId, Failure, JobId, State};

#[derive(Copy, Clone, Debug, Default, State)]
pub(crate) struct Receiver {
    delivery: DeliveryId,
    /// How often the block under way has been refused.
    refusals: u32,
    /// ETX has come.
    at_end: bool,
    /// A good line for which there was no room.
    waiting: Text,
    /// It found room in the middle of a block: the answer waits for that one's end.
    owes_ack: bool,
}

impl Receiver {
    pub(crate) fn begin(&mut self, link: &mut Context<'_>, name: &[u8]) {
        *self = Self { delivery: self.delivery.next(), ..Self::default() };
        link.delivery_begin(self.delivery, JobId::NONE);
        if !name.is_empty() {
            link.delivery_name_ascii(self.delivery, name);
        }
    }

    /// Delivers a line; `false` if there is no room for it: it waits.
    pub(crate) fn take(&mut self, link: &mut Context<'_>, settings: &Settings, text: Text) -> bool {
        self.waiting = text;
        self.at_end = false;
        let text = text.as_slice();
        let end = match settings.line_end {
            LineEnd::Lf => b"\n".as_slice(),
            LineEnd::CrLf => b"\r\n",
        };
        let has_room = text.len() + end.len() <= link.delivery_room() as usize;
        if has_room {
            self.refusals = 0;
            if !text.is_empty() {
                link.deliver(self.delivery, text);
            }
            link.deliver(self.delivery, end);
        }
        has_room
    }

    /// Delivers the line that waits; `false` if there is no room for it yet.
    pub(crate) fn take_waiting(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        self.take(link, settings, self.waiting)
    }

    /// The answer to the line that waited follows the block that is under way.
    pub(crate) fn owe_ack(&mut self) {
        self.owes_ack = true;
    }

    /// Whether an answer is owed; it is no more.
    pub(crate) fn pay_ack(&mut self) -> bool {
        core::mem::take(&mut self.owes_ack)
    }

    /// Whether a line is the one that waited.
    pub(crate) fn is_latest(&self, text: &Text) -> bool {
        self.waiting.as_slice() == text.as_slice()
    }

    /// Whether a bad block may be asked for once more.
    pub(crate) fn refuses(&mut self, most: i64) -> bool {
        self.refusals += 1;
        self.at_end = false;
        i64::from(self.refusals) <= most
    }

    /// ETX: it ends nothing behind a block that was refused, or that has no answer yet.
    pub(crate) fn at_end(&mut self) {
        self.at_end = self.refusals == 0 && !self.owes_ack;
    }

    /// Whether EOT now ends the whole program.
    pub(crate) fn is_whole(&self) -> bool {
        self.at_end
    }

    pub(crate) fn end(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        link.delivery_end(self.delivery, failure, 0);
    }
}
