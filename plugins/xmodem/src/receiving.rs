//! A file comes: what a sender says, and what it is answered.

use crate::Timer;
use crate::Xmodem;
use crate::block::{ACK, CALL, CAN, EOT, Heard, NAK, SOH, STX};
use crate::stage::Stage;
use softplug_plugin::{Context, Failure};

impl Xmodem {
    /// A character where no job is on the line.
    pub(crate) fn hear(&mut self, link: &mut Context<'_>, byte: u8) {
        match (self.stage, byte) {
            (Stage::Idle, EOT) if self.receiver.lingers => {
                self.answers.say(link, &[ACK]);
                self.rest(link);
            }
            // It answers our call, though a job has come meanwhile.
            (Stage::Idle, SOH | STX) if self.receiver.has_called() => self.begin_block(link, byte),
            // Nobody has asked for it: what is in it is no call either.
            (Stage::Idle, SOH | STX) if self.sender.is_waiting() => {
                self.receiver.lingers = false;
                self.purge(link);
            }
            // A call is that of somebody else who wants a file.
            (Stage::Idle | Stage::NoRoom, _) | (Stage::Calling, CALL | NAK) => {}
            (Stage::Block, _) => self.hear_block(link, byte),
            (Stage::Calling | Stage::Between, SOH | STX) => self.begin_block(link, byte),
            (Stage::Calling | Stage::Between | Stage::EndHeard, EOT) => {
                self.enter(link, Stage::EndHeard, self.settings.purge_time);
            }
            (Stage::Calling | Stage::Between, CAN) => {
                self.enter(link, Stage::CanHeard, self.settings.purge_time);
            }
            (Stage::CanHeard, CAN) => self.end_reception(link, Some(Failure::NoEndMark)),
            (Stage::Purging, _) => {
                self.receiver.add_to_run(1);
                self.purge(link);
            }
            _ => self.noise(link),
        }
    }

    /// A character that belongs to nothing, or a damaged one.
    pub(crate) fn noise(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Idle | Stage::NoRoom => return,
            Stage::Block => {
                let count = self.receiver.reader.count + 1;
                self.receiver.begin_run(count, Failure::Checksum);
            }
            Stage::Purging => self.receiver.add_to_run(1),
            _ => self.receiver.begin_run(1, Failure::Protocol),
        }
        self.purge(link);
    }

    fn begin_block(&mut self, link: &mut Context<'_>, first: u8) {
        self.receiver.reader.begin(first, self.receiver.is_crc);
        self.enter(link, Stage::Block, self.settings.character_time);
    }

    fn hear_block(&mut self, link: &mut Context<'_>, byte: u8) {
        match self.receiver.reader.take(byte) {
            Heard::Part => self.enter(link, Stage::Block, self.settings.character_time),
            Heard::Good => self.good_block(link),
            Heard::Bad => {
                let count = self.receiver.reader.count;
                self.receiver.begin_run(count, Failure::Checksum);
                self.purge(link);
            }
        }
    }

    fn good_block(&mut self, link: &mut Context<'_>) {
        if self.receiver.is_expected() {
            self.receiver.begin(link);
            self.put_away(link);
        } else if self.receiver.is_again() {
            self.acknowledge(link);
        } else {
            self.end_reception(link, Some(Failure::Protocol));
            self.say_cancel(link);
        }
    }

    /// Delivers the block, and acknowledges it once there was room for all of it.
    pub(crate) fn put_away(&mut self, link: &mut Context<'_>) {
        if self.receiver.deliver(link, &self.settings) {
            self.acknowledge(link);
        } else {
            self.stage = Stage::NoRoom;
            self.timers.cancel(link, Timer::Transfer);
        }
    }

    fn acknowledge(&mut self, link: &mut Context<'_>) {
        self.receiver.went_well();
        self.answers.say(link, &[ACK]);
        self.enter(link, Stage::Between, self.settings.block_time);
    }

    /// Time has run out.
    pub(crate) fn silence(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Idle => self.begin_calling(link),
            Stage::Calling => self.say_call(link),
            Stage::Between => {
                self.receiver.begin_run(0, Failure::NoAnswer);
                self.refuse(link);
            }
            Stage::Block => {
                let count = self.receiver.reader.count;
                self.receiver.begin_run(count, Failure::Checksum);
                self.refuse(link);
            }
            Stage::CanHeard => {
                self.receiver.begin_run(1, Failure::Protocol);
                self.refuse(link);
            }
            Stage::Purging => self.refuse(link),
            Stage::EndHeard => self.end_of_file(link),
            _ => {}
        }
    }

    /// The line is clear: what was no good block is asked for again.
    fn refuse(&mut self, link: &mut Context<'_>) {
        if self.receiver.is_cancelling {
            self.rest(link);
            self.say_cancel(link);
        } else if !self.receiver.is_open && !self.receiver.has_called() {
            self.rest(link);
        } else if !self.receiver.is_open && self.sender.is_waiting() {
            // Who calls cannot be called.
            self.stage = Stage::Idle;
        } else if !self.receiver.is_open || self.receiver.refuses(self.settings.repeats) {
            self.ask_again(link);
        } else {
            let why = self.receiver.why();
            self.end_reception(link, Some(why));
            self.say_cancel(link);
        }
    }

    /// NAK; before the first good block it is the call.
    fn ask_again(&mut self, link: &mut Context<'_>) {
        if self.receiver.is_open {
            self.answers.say(link, &[NAK]);
            self.enter(link, Stage::Between, self.settings.block_time);
        } else {
            let call = self.receiver.same_call();
            self.answers.say(link, &[call]);
            self.enter(link, Stage::Calling, self.settings.call_time);
        }
    }

    /// EOT, and then nothing.
    fn end_of_file(&mut self, link: &mut Context<'_>) {
        if !self.receiver.is_open && self.sender.is_waiting() {
            self.stage = Stage::Idle;
        } else if self.receiver.is_missing {
            self.end_reception(link, Some(Failure::Protocol));
            self.say_cancel(link);
        } else if self.settings.end_twice && !self.receiver.is_end_refused {
            self.receiver.is_end_refused = true;
            self.ask_again(link);
        } else {
            self.receiver.begin(link);
            self.end_reception(link, None);
            self.receiver.lingers = true;
            self.answers.say(link, &[ACK]);
        }
    }

    /// Whatever comes ends, and nothing is done for a while.
    pub(crate) fn end_reception(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        self.receiver.end(link, failure);
        self.rest(link);
    }

    /// The host wants no more of it: the sender is told when it listens.
    pub(crate) fn cancel_reception(&mut self, link: &mut Context<'_>) {
        if self.receiver.is_open {
            self.receiver.end(link, Some(Failure::Aborted));
            self.receiver.is_cancelling = true;
            self.purge(link);
        }
    }

    /// Nothing is under way; after a while we call again.
    pub(crate) fn rest(&mut self, link: &mut Context<'_>) {
        self.receiver.is_cancelling = false;
        self.enter(link, Stage::Idle, self.settings.block_time);
    }

    /// Calls for a file, if nothing else is to be done.
    pub(crate) fn begin_calling(&mut self, link: &mut Context<'_>) {
        self.receiver.forget();
        self.timers.cancel(link, Timer::Transfer);
        let can_call = self.takes && !self.is_narrow && !self.is_down;
        if self.settings.call && can_call && !self.sender.is_waiting() {
            self.say_call(link);
        }
    }

    fn say_call(&mut self, link: &mut Context<'_>) {
        self.receiver.is_end_refused = false;
        self.receiver.is_missing = false;
        let call = self.receiver.call(&self.settings);
        self.answers.say(link, &[call]);
        self.enter(link, Stage::Calling, self.settings.call_time);
    }

    fn purge(&mut self, link: &mut Context<'_>) {
        self.enter(link, Stage::Purging, self.settings.purge_time);
    }

    /// From here on, and for so long from now.
    pub(crate) fn enter(&mut self, link: &mut Context<'_>, stage: Stage, millis: i64) {
        self.stage = stage;
        self.timers.set_after(link, Timer::Transfer, millis);
    }
}
