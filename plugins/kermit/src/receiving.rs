//! Files come: what a sender says, and what it is answered.

use crate::Kermit;
use crate::Timer;
use crate::receiver::{TITLE, title};
use crate::stage::Stage;
use crate::terms::{FIELDS, Terms};
use softplug_plugin::{Context, Failure, NoteLevel};

impl Kermit {
    /// A good packet where no job is on the line.
    pub(crate) fn hear(&mut self, link: &mut Context<'_>) {
        let (kind, number) = (self.reader.kind(), self.reader.number());
        let is_receiving = self.stage.is_receiving();
        match kind {
            b'S' if number == 0 => self.first_packet(link),
            b'E' => {
                self.told_error(link);
                self.withdraw(link);
                if is_receiving {
                    self.end_reception(link, Some(Failure::NoEndMark));
                    self.start_waiting(link);
                }
            }
            // Our own that come back, or answers to what is over.
            b'Y' | b'N' => self.watch(link),
            _ if is_receiving => self.next_packet(link, kind, number),
            b'B' if self.receiver.ended.0.is_some_and(|(ended, _)| ended == number) => {
                self.ended_again(link);
            }
            b'I' => self.exchange(link, number),
            b'R' => self.asked(link, number),
            b'G' | b'C' | b'K' => self.say_plainly(link, number, b"Commands are not supported"),
            _ => self.say(link, b'E', number, b"No transfer is under way"),
        }
    }

    /// S: a transfer begins, or begins again.
    pub(crate) fn first_packet(&mut self, link: &mut Context<'_>) {
        self.receiver.end_delivery(link, Some(Failure::PartnerReset));
        self.withdraw(link);
        self.receiver.forget();
        self.timers.cancel(link, Timer::Transfer);
        self.stage = Stage::Idle;
        let (terms, reply) = self.reply();
        if !self.takes {
            link.note(NoteLevel::Warning, 0, "the machine has a file, and nobody takes it");
            self.terms = Terms::usual();
            self.say(link, b'E', 0, b"Files are not taken now");
            self.start_waiting(link);
        } else if self.settings.crc_only && terms.check < 3 {
            self.terms = Terms::usual();
            self.say(link, b'E', 0, b"CRC is needed");
            self.start_waiting(link);
        } else {
            // The check that was agreed on begins with the next packet.
            self.terms = Terms { check: 1, ..terms };
            self.say(link, b'Y', 0, &reply);
            self.terms = terms;
            (self.receiver.expected, self.receiver.latest) = (1, b'S');
            self.enter(link, Stage::AwaitFile);
        }
    }

    fn reply(&self) -> (Terms, [u8; FIELDS]) {
        Terms::answer(&self.settings, self.is_narrow, self.reader.data())
    }

    /// I: what a machine says of itself before it asks for something.
    fn exchange(&mut self, link: &mut Context<'_>, number: u8) {
        let (terms, reply) = self.reply();
        if self.settings.crc_only && terms.check < 3 {
            self.terms = Terms::usual();
            self.say(link, b'E', number, b"CRC is needed");
            return;
        }
        self.terms = Terms { check: 1, ..terms };
        self.say(link, b'Y', number, &reply);
    }

    /// A packet of the transfer.
    fn next_packet(&mut self, link: &mut Context<'_>, kind: u8, number: u8) {
        let expected = self.receiver.expected;
        if number == (expected + 63) % 64 && kind == self.receiver.latest {
            // Our answer was lost.
            self.receiver.went_well();
            self.acknowledge(link, number);
            self.enter(link, self.stage);
            return;
        }
        if number != expected {
            self.refuse(link, Failure::Protocol);
            return;
        }
        match (self.stage, kind) {
            (Stage::AwaitFile, b'F') => {
                self.receiver.end_whole(link);
                let (name, length) = title(self.terms.theirs, self.reader.data());
                self.receiver.begin(link, name.get(..length.min(TITLE)).unwrap_or_default());
                self.accept(link, Stage::AwaitData);
            }
            (Stage::AwaitFile, b'B') => {
                self.acknowledge(link, number);
                let terms = self.terms;
                self.end_reception(link, None);
                self.receiver.ended.0 = Some((number, terms));
                self.start_waiting(link);
            }
            (Stage::AwaitData, b'A') => self.accept(link, Stage::AwaitData),
            (Stage::AwaitData, b'D') if !self.terms.theirs.is_sound(self.reader.data()) => {
                self.refuse(link, Failure::Protocol);
            }
            (Stage::AwaitData, b'Z') if self.reader.data() == b"D" => {
                self.receiver.end_delivery(link, Some(Failure::NoEndMark));
                self.accept(link, Stage::AwaitFile);
            }
            (Stage::AwaitData, b'D' | b'Z') => self.put_away(link),
            _ => {
                self.say(link, b'E', number, b"This packet is not expected here");
                self.end_reception(link, Some(Failure::Protocol));
                self.start_waiting(link);
            }
        }
    }

    /// Delivers the data, or ends the file, and acknowledges it once there was room for all of
    /// it.
    pub(crate) fn put_away(&mut self, link: &mut Context<'_>) {
        let is_end = self.reader.kind() == b'Z';
        let coding = self.terms.theirs;
        let is_whole = if is_end {
            self.receiver.deliver_rest(link)
        } else {
            self.receiver.deliver(link, &self.settings, coding, &self.reader)
        };
        if !is_whole {
            self.stage = Stage::NoRoom;
            self.timers.cancel(link, Timer::Transfer);
        } else if is_end {
            self.receiver.is_whole = true;
            self.accept(link, Stage::AwaitFile);
        } else {
            self.accept(link, Stage::AwaitData);
        }
    }

    /// The packet that was expected is good.
    fn accept(&mut self, link: &mut Context<'_>, stage: Stage) {
        let number = self.receiver.expected;
        self.receiver.went_well();
        self.acknowledge(link, number);
        self.receiver.expected = (number + 1) % 64;
        self.receiver.latest = self.reader.kind();
        self.enter(link, stage);
    }

    /// ACK for the packet that is there.
    fn acknowledge(&mut self, link: &mut Context<'_>, number: u8) {
        let data: &[u8] = if self.reader.kind() == b'A' { b"Y" } else { b"" };
        self.say(link, b'Y', number, data);
    }

    /// The end of the last transfer comes again.
    pub(crate) fn ended_again(&mut self, link: &mut Context<'_>) {
        if let Some((number, terms)) = self.receiver.ended.0
            && number == self.reader.number()
        {
            self.say_with(link, &terms, b'Y', number, b"");
        }
        self.watch(link);
    }

    /// What came is no good packet, or nothing has come: the packet is asked for again.
    pub(crate) fn refuse(&mut self, link: &mut Context<'_>, why: Failure) {
        let number = self.receiver.expected;
        self.receiver.end_whole(link);
        if self.receiver.refuses(self.settings.repeats, why) {
            self.say(link, b'N', number, b"");
            self.enter(link, self.stage);
        } else {
            self.give_up(link, number);
            self.end_reception(link, Some(why));
            self.start_waiting(link);
        }
    }

    /// The sender, or whoever asked for a file, tells what is wrong.
    pub(crate) fn told_error(&mut self, link: &mut Context<'_>) {
        let (text, length) = title(self.terms.theirs, self.reader.data());
        if let Ok(text) = core::str::from_utf8(text.get(..length).unwrap_or_default()) {
            link.note(NoteLevel::Warning, 0, text);
        }
    }

    /// The transfer is over.
    pub(crate) fn end_reception(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        self.receiver.end_delivery(link, failure);
        self.receiver.forget();
        self.terms = Terms::usual();
        self.stage = Stage::Idle;
        self.timers.cancel(link, Timer::Transfer);
    }

    /// A job that had to wait begins.
    pub(crate) fn start_waiting(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Idle && self.sender.is_waiting() {
            self.begin_job(link);
        }
    }

    /// The host wants no more of it.
    pub(crate) fn cancel_reception(&mut self, link: &mut Context<'_>) {
        if self.receiver.is_open {
            let number = self.receiver.expected;
            self.say(link, b'E', number, b"Cancelled");
            self.end_reception(link, Some(Failure::Aborted));
            self.start_waiting(link);
        }
    }

    pub(crate) fn say(&mut self, link: &mut Context<'_>, kind: u8, number: u8, data: &[u8]) {
        let terms = self.terms;
        self.say_with(link, &terms, kind, number, data);
    }

    /// An error in answer to a packet that has check 1 in any case.
    pub(crate) fn say_plainly(&mut self, link: &mut Context<'_>, number: u8, text: &[u8]) {
        let terms = Terms { check: 1, ..self.terms };
        self.say_with(link, &terms, b'E', number, text);
    }

    /// From here on, until something comes.
    pub(crate) fn enter(&mut self, link: &mut Context<'_>, stage: Stage) {
        self.stage = stage;
        self.watch(link);
    }
}
