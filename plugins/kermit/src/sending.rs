//! A job goes: what a receiver says, and what it is answered.

use crate::Kermit;
use crate::Timer;
use crate::stage::Stage;
use crate::terms::Terms;
use softplug_plugin::{Context, Failure};

/// What is told to a partner when we give up.
const TOO_MANY: &[u8] = b"Too many errors";

impl Kermit {
    /// Begins with the job that waits.
    pub(crate) fn begin_job(&mut self, link: &mut Context<'_>) {
        self.terms = Terms::usual();
        self.sender.restart();
        self.withdraw(link);
        self.stage = Stage::Filling;
        self.timers.cancel(link, Timer::Transfer);
        if self.settings.begin_time > 0 {
            self.timers.set_after(link, Timer::Begin, self.settings.begin_time);
        } else {
            self.timers.cancel(link, Timer::Begin);
        }
        self.go_on(link);
    }

    /// A good packet from the receiver.
    pub(crate) fn answered(&mut self, link: &mut Context<'_>) {
        let (kind, number) = (self.reader.kind(), self.reader.number());
        if kind == b'E' {
            self.told_error(link);
            self.stop(link, Failure::Refused);
            return;
        }
        // An answer that comes before the check can have left is none.
        if self.stage == Stage::Filling || !self.sender.has_left() {
            return;
        }
        let own = self.sender.number;
        let is_first = self.sender.kind == b'S';
        match kind {
            b'Y' if number == own => self.acknowledged(link),
            b'N' if number == own => self.again(link, Failure::AttemptsUsedUp),
            // It waits for the next one; but the first answer says more than that.
            b'N' if number == (own + 1) % 64 && is_first => {
                self.again(link, Failure::AttemptsUsedUp);
            }
            b'N' if number == (own + 1) % 64 => self.goes_on(link),
            // The same packet is our own that came back.
            b'S' if is_first && self.reader.as_slice() != self.own_packet() => {
                self.timers.cancel(link, Timer::Begin);
                self.first_packet(link);
            }
            b'B' if is_first => self.ended_again(link),
            _ => self.watch(link),
        }
    }

    /// The packet under way, without its mark.
    fn own_packet(&self) -> &[u8] {
        self.sender.packet.as_slice().get(1..).unwrap_or_default()
    }

    /// ACK for the packet under way.
    fn acknowledged(&mut self, link: &mut Context<'_>) {
        match self.sender.kind {
            b'S' => {
                self.timers.cancel(link, Timer::Begin);
                self.receiver.ended.0 = None;
                self.terms = Terms::agreed(&self.settings, self.is_narrow, self.reader.data());
                if self.settings.crc_only && self.terms.check < 3 {
                    self.stop(link, Failure::NotSupported);
                    return;
                }
            }
            b'D' if matches!(self.reader.data().first(), Some(b'X' | b'Z')) => {
                self.sender.is_interrupted = true;
            }
            _ => {}
        }
        self.goes_on(link);
    }

    /// The packet under way is with the receiver.
    fn goes_on(&mut self, link: &mut Context<'_>) {
        self.timers.cancel(link, Timer::Transfer);
        let next = match self.sender.kind {
            b'S' => b'F',
            b'D' if self.sender.is_interrupted => b'Z',
            b'F' | b'D' => b'D',
            b'Z' => b'B',
            _ => {
                self.end_job(link);
                return;
            }
        };
        self.sender.goes_on_with(next);
        self.stage = Stage::Filling;
        self.go_on(link);
    }

    /// The end of the transfer is acknowledged, or nobody answers it.
    fn end_job(&mut self, link: &mut Context<'_>) {
        self.stage = Stage::Idle;
        self.terms = Terms::usual();
        self.timers.cancel(link, Timer::Transfer);
        self.sender.fail(link, Failure::Refused);
    }

    /// The packet goes once more, if it may.
    pub(crate) fn again(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.timers.cancel(link, Timer::Transfer);
        // The first one goes until the time for it has run out.
        let is_first = self.sender.kind == b'S';
        if is_first || self.sender.repeats(self.settings.repeats) {
            self.stage = Stage::Filling;
            self.go_on(link);
        } else if self.sender.kind == b'B' {
            self.end_job(link);
        } else {
            self.stop(link, failure);
        }
    }

    /// Sends what comes next, as far as there is all that it needs.
    pub(crate) fn go_on(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Filling && self.answers.owes_nothing() {
            match self.sender.next(link, &self.settings, &self.terms, self.is_narrow) {
                Ok(stage) => self.stage = stage,
                Err(failure) => self.stop(link, failure),
            }
        }
    }

    /// Ends the job on the line as soon as it is known how much of it has left.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        link.discard();
        self.answers.forget();
        self.timers.cancel(link, Timer::Transfer);
        self.timers.cancel(link, Timer::Begin);
        self.stage = Stage::Idle;
        self.sender.stopping = Some(failure);
        let number = self.sender.number;
        match failure {
            Failure::Refused | Failure::LinkDown => {}
            _ if self.sender.kind == b'B' => {}
            Failure::Aborted => self.say(link, b'E', number, b"Cancelled"),
            Failure::NotSupported => self.say(link, b'E', number, b"CRC is needed"),
            Failure::UnsupportedCharacter => {
                self.say(link, b'E', number, b"Bytes above 127 cannot be sent");
            }
            Failure::BadJob => self.say(link, b'E', number, b"The name is too long"),
            _ => self.say(link, b'E', number, TOO_MANY),
        }
        self.terms = Terms::usual();
    }

    /// The host aborts the job.
    pub(crate) fn abort_job(&mut self, link: &mut Context<'_>) {
        if self.stage.is_sending() {
            self.stop(link, Failure::Aborted);
        } else {
            self.sender.fail(link, Failure::Aborted);
        }
    }

    /// Whoever gave up is told why.
    pub(crate) fn give_up(&mut self, link: &mut Context<'_>, number: u8) {
        self.say(link, b'E', number, TOO_MANY);
    }
}
