//! The dialogue with the control: what it says, and what it is answered.

use crate::frame::{ACK, DC1, DC3, EOT, ETX, Frame, Heard, NAK, SOH};
use crate::line::spoken;
use crate::stage::Stage;
use crate::{HeidenhainFe, NAME, Timer};
use softplug_plugin::{Context, Failure, NoteLevel, ValueWriter, Values};

/// The field of a request with the program's kind.
const KIND: u16 = 1;

impl HeidenhainFe {
    pub(crate) fn character(&mut self, link: &mut Context<'_>, byte: u8) {
        let heard = self.reader.take(byte, self.settings.dc1, self.settings.bcc_space);
        match heard {
            Heard::Inside | Heard::Alone(_) if self.reader.is_inside() => {}
            Heard::Whole(frame) => self.frame(link, frame),
            Heard::Alone(DC3) => {
                self.hold(link);
            }
            Heard::Alone(DC1) => self.release(link),
            Heard::Alone(ACK) => self.acknowledged(link),
            Heard::Alone(NAK) => self.refused(link),
            // A control that does not wait for its answer has not ended its program.
            Heard::Alone(ETX) if self.stage == Stage::Receiving => self.receiver.at_end(),
            Heard::Alone(EOT) => self.ended(link),
            Heard::Alone(_) | Heard::Inside => {}
        }
    }

    /// A header or block has come, or what is left of one.
    pub(crate) fn frame(&mut self, link: &mut Context<'_>, frame: Frame) {
        self.timers.cancel(link, Timer::Character);
        if frame.begin == SOH {
            if frame.is_good {
                self.header(link);
            } else if !self.stage.is_sending() {
                // Of a transfer that is under way, a header is no part.
                self.say(link, NAK);
            }
        } else if self.stage == Stage::Waiting {
            // One waits: until it is answered, others can only be the same once more.
        } else if self.stage != Stage::Receiving {
            // Nobody waits for a block: a control that sends one is told that it is over.
            if frame.is_good && !self.stage.is_sending() {
                self.withdraw(link);
                self.say(link, EOT);
            }
        } else if self.receiver.pay_ack() {
            self.say(link, ACK);
            // All but the line that waited, once more, is another one.
            if frame.is_good && !self.receiver.is_latest(&self.reader.text()) {
                self.accept(link);
            }
        } else if frame.is_good {
            self.accept(link);
        } else if self.receiver.refuses(self.settings.repeats) {
            self.say(link, NAK);
        } else {
            self.end_reception(link, Some(Failure::Checksum));
            self.say(link, EOT);
        }
    }

    /// A good header: what came before it is over.
    pub(crate) fn header(&mut self, link: &mut Context<'_>) {
        self.end_reception(link, Some(Failure::PartnerReset));
        self.withdraw(link);
        self.stop(link, Failure::PartnerReset);
        let text = self.reader.text();
        let text = text.as_slice();
        let (Some((kind, rest)), Some(mode)) = (text.split_first(), text.last()) else {
            self.say(link, NAK);
            return;
        };
        let name = rest.get(..rest.len().saturating_sub(1)).unwrap_or_default();
        match mode {
            b'A' if !rest.is_empty() && !self.takes => {
                link.note(NoteLevel::Warning, 0, "the control has a program, and nobody takes it");
                self.say(link, EOT);
            }
            b'A' if !rest.is_empty() => {
                self.receiver.begin(link, name);
                self.stage = Stage::Receiving;
                self.say(link, ACK);
            }
            b'E' if !rest.is_empty() => {
                self.asked.clear();
                self.asked.extend(name);
                if self.sender.is_waiting() {
                    self.supply(link);
                } else {
                    self.request(link, *kind);
                }
            }
            _ => self.say(link, NAK),
        }
    }

    fn request(&mut self, link: &mut Context<'_>, kind: u8) {
        let mut buffer = [0; 300];
        let mut fields = ValueWriter::new(&mut buffer);
        // Both fit: a header has at most 242 characters.
        let _ = fields.push_ascii(NAME, self.asked.as_slice());
        let _ = fields.push_ascii(KIND, &[kind]);
        self.request = self.request.next();
        link.request(self.request, 0, Values::new(fields.written()));
        self.stage = Stage::Asking;
    }

    /// The job that is there goes to the control, if it is what it asked for.
    pub(crate) fn supply(&mut self, link: &mut Context<'_>) {
        if !self.sender.fits(self.asked.as_slice()) {
            link.note(NoteLevel::Warning, 0, "the control asks for another program");
            self.refuse(link);
            return;
        }
        self.timers.cancel(link, Timer::Job);
        self.say(link, ACK);
        self.stage = Stage::Filling;
        self.go_on(link);
    }

    /// The control does not get what it asked for.
    pub(crate) fn refuse(&mut self, link: &mut Context<'_>) {
        // The time of a job that was there before runs on.
        if self.stage == Stage::Granted {
            self.await_control(link);
        }
        self.stage = Stage::Idle;
        self.say(link, EOT);
    }

    /// A job waits until the control asks for it, if there is one.
    pub(crate) fn await_control(&mut self, link: &mut Context<'_>) {
        let is_timed = self.settings.request_time > 0;
        if self.sender.is_waiting() && is_timed {
            self.timers.set_after(link, Timer::Job, self.settings.request_time);
        } else {
            self.timers.cancel(link, Timer::Job);
        }
    }

    /// A job that nobody asked for, or a program that was granted and did not come.
    pub(crate) fn too_late(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Granted {
            link.note(NoteLevel::Warning, 0, "the program that was granted did not come");
            self.refuse(link);
        } else {
            self.sender.job.fail(link, Failure::NoAnswer);
        }
    }

    fn withdraw(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Asking => link.withdraw(self.request),
            Stage::Granted => self.timers.cancel(link, Timer::Job),
            _ => return,
        }
        self.stage = Stage::Idle;
    }

    /// Sends the next block, or the end, as far as there is all that it needs.
    pub(crate) fn go_on(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Filling && self.answers.owes_nothing() {
            self.stage = self.sender.next(link, &self.settings);
        }
    }

    fn acknowledged(&mut self, link: &mut Context<'_>) {
        // An answer that comes before the block can have left is none.
        if self.stage == Stage::Answer && self.sender.job.has_left() {
            self.timers.cancel(link, Timer::Answer);
            self.sender.acknowledged();
            self.stage = Stage::Filling;
            self.go_on(link);
        }
    }

    fn refused(&mut self, link: &mut Context<'_>) {
        if self.stage != Stage::Answer || !self.sender.job.has_left() {
            return;
        }
        self.timers.cancel(link, Timer::Answer);
        if self.sender.job.repeats(self.settings.repeats) {
            self.stage = Stage::Filling;
            self.go_on(link);
        } else {
            self.stop(link, Failure::AttemptsUsedUp);
        }
    }

    /// EOT: the control ends what is under way.
    fn ended(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Filling | Stage::Answer => self.stop(link, Failure::Refused),
            Stage::Receiving | Stage::Waiting => {
                let is_whole = self.receiver.is_whole();
                self.end_reception(link, (!is_whole).then_some(Failure::NoEndMark));
            }
            Stage::Asking | Stage::Granted => self.withdraw(link),
            Stage::Idle | Stage::Ending => {}
        }
    }

    /// Ends the job on the line as soon as it is known how much of it has left.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        if !self.stage.is_sending() {
            return;
        }
        self.timers.cancel(link, Timer::Answer);
        self.sender.job.stop(link, failure);
        self.answers.forget();
        self.stage = Stage::Idle;
        if !partner_knows(failure) {
            self.say(link, EOT);
        }
    }

    /// Whatever is under way with the control ends.
    pub(crate) fn give_up(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.end_reception(link, Some(failure));
        self.withdraw(link);
        self.stop(link, failure);
        self.timers.cancel(link, Timer::Job);
    }

    /// A good block is put away and acknowledged, or waits until there is room.
    fn accept(&mut self, link: &mut Context<'_>) {
        let is_taken = self.receiver.take(link, &self.settings, self.reader.text());
        self.taken(link, is_taken);
    }

    /// A good block was put away, or not.
    fn taken(&mut self, link: &mut Context<'_>, is_taken: bool) {
        if !is_taken {
            self.stage = Stage::Waiting;
            return;
        }
        self.stage = Stage::Receiving;
        if self.reader.is_inside_block() {
            // The control did not wait: in the middle of a block it would not hear us.
            self.receiver.owe_ack();
        } else {
            self.say(link, ACK);
        }
    }

    pub(crate) fn has_delivery_room(&mut self, link: &mut Context<'_>) {
        if self.stage != Stage::Waiting {
            return;
        }
        let is_taken = self.receiver.take_waiting(link, &self.settings);
        self.taken(link, is_taken);
        // The next block may have begun; its silence counts from its last character.
        if !self.reader.is_inside() {
            self.watch(link);
        }
    }

    pub(crate) fn end_reception(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        if self.stage.is_receiving() {
            self.receiver.end(link, failure);
            self.stage = Stage::Idle;
        }
    }

    /// Silence in a frame, and between two blocks, counts from here.
    pub(crate) fn watch(&mut self, link: &mut Context<'_>) {
        if self.reader.is_inside() {
            self.timers.set_after(link, Timer::Character, self.settings.character_time);
        } else if self.is_timed() {
            self.timers.set_after(link, Timer::Block, self.settings.block_time);
        }
        self.end_watch(link);
    }

    /// Ends the times that count no more. The others run on: nothing has come.
    pub(crate) fn end_watch(&mut self, link: &mut Context<'_>) {
        if !self.reader.is_inside() {
            self.timers.cancel(link, Timer::Character);
        }
        if self.reader.is_inside() || !self.is_timed() {
            self.timers.cancel(link, Timer::Block);
        }
    }

    fn is_timed(&self) -> bool {
        self.stage == Stage::Receiving && self.settings.block_time > 0
    }

    pub(crate) fn say(&mut self, link: &mut Context<'_>, byte: u8) {
        self.answers.say(link, &[spoken(&self.settings, byte)]);
    }

    pub(crate) fn hold(&mut self, link: &mut Context<'_>) {
        if !self.is_held {
            self.is_held = true;
            link.hold();
        }
    }

    pub(crate) fn release(&mut self, link: &mut Context<'_>) {
        if self.is_held {
            self.is_held = false;
            link.release();
        }
    }
}

/// Whether the control need not be told that the job is over.
fn partner_knows(failure: Failure) -> bool {
    matches!(failure, Failure::Refused | Failure::PartnerReset | Failure::LinkDown)
}
