//! What is said to each message of the control, and what it does to the job.

use super::RemoteBuffer;
use super::job::{Dialogue, Job, Said};
use super::message::{Bad, Command, compose};
use super::parity::sent;
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// In a row; the next one fails the job.
const REPETITIONS: u32 = 3;

impl RemoteBuffer {
    /// A message, or what was to be one, is complete.
    pub(super) fn message(&mut self, message: Result<Command, Bad>) {
        // What comes behind a GTD at one instant may find its data not there yet: WAT or a
        // short packet is said before it, and the model does not follow that.
        self.is_unsure |= self.job.as_ref().is_some_and(|job| job.is_asked);
        match message {
            Ok(Command::Rty) => self.say_again(),
            Ok(command) => {
                (self.dialogue.repeats, self.dialogue.bad) = (0, 0);
                // This one answers our RTY.
                self.dialogue.asked_again = false;
                self.command(command);
            }
            Err(bad) => self.ask_again(bad),
        }
    }

    fn command(&mut self, command: Command) {
        self.dialogue.is_ready |= matches!(command, Command::Syn | Command::Rdy);
        let has_begun = self.job.as_ref().is_some_and(|job| job.has_begun);
        match command {
            Command::Syn => {
                if has_begun {
                    self.fail(Failure::PartnerReset, "fanuc-rs232.remote.reset");
                }
                self.answer("RDY", "fanuc-rs232.remote.initialise");
            }
            Command::Rdy => {
                self.end();
                // One that answers our SYN has no answer.
                if !std::mem::take(&mut self.dialogue.awaits_rdy) {
                    self.answer("RDY", "fanuc-rs232.remote.initialise");
                }
            }
            Command::Gtd => {
                self.end();
                self.give();
            }
            Command::Sat => {
                self.end();
                self.answer("SET", "fanuc-rs232.remote.status");
            }
            Command::Rst => {
                self.fail(Failure::PartnerReset, "fanuc-rs232.remote.reset");
                self.answer("ARS", "fanuc-rs232.remote.reset");
            }
            Command::Alm => {
                self.fail(Failure::PartnerAlarm, "fanuc-rs232.remote.alarm");
                self.answer("AAL", "fanuc-rs232.remote.alarm");
            }
            Command::Rty => {}
        }
    }

    /// GTD.
    fn give(&mut self) {
        let is_ready = self.dialogue.is_ready;
        match &mut self.job {
            // The page does not say it: a job that waits for RDY, and a paused one, have
            // nothing now.
            Some(job) if is_ready && !job.is_paused => {
                job.is_asked = true;
            }
            _ => self.answer("WAT", "fanuc-rs232.remote.wait"),
        }
    }

    /// Nothing more comes at this instant: the data for a GTD, or their end.
    pub(super) fn give_data(&mut self) {
        if self.job.as_ref().is_some_and(|job| job.is_asked) {
            self.pack();
        }
    }

    fn pack(&mut self) {
        let Some(job) = self.job.as_mut() else { return };
        job.is_asked = false;
        let end = self.rules.end;
        let frame = compose("DAT", &[], end).len();
        // A packet is no longer than the room that is free. While others wait it may have
        // none, which is not judged, nor what follows from it.
        let room = self.wire.known().saturating_sub(frame);
        let size = self.rules.packet_size.min(room);
        self.is_unsure |=
            room < self.rules.packet_size.min(job.remaining()) && !self.wire.is_empty();
        let packet = job.packet(size);
        job.has_begun = true;
        if packet.is_empty() {
            job.is_ended = true;
            let message = compose("EOD", &[], end);
            self.say(Said::Eod, message, "fanuc-rs232.remote.end");
        } else {
            let message = compose("DAT", &packet, end);
            self.say(Said::Dat, message, "fanuc-rs232.remote.data");
        }
    }

    /// RTY of the control.
    fn say_again(&mut self) {
        let Dialogue { asked_again, .. } = self.dialogue;
        let is_of_job = self.job.is_some() && self.dialogue.last_job == self.jobs;
        let last = self.dialogue.last.clone();
        let last_said = last.as_ref().map(|(said, _)| *said);
        if asked_again && is_of_job && last_said == Some(Said::Dat) {
            // Whether the data came is not known.
            self.dialogue.repeats = 0;
            return self.fail(Failure::AttemptsUsedUp, "fanuc-rs232.remote.repeat");
        }
        self.dialogue.repeats += 1;
        // The page says it of jobs alone: without one the fourth has no answer.
        if self.dialogue.repeats > REPETITIONS {
            self.dialogue.repeats = 0;
            return self.fail(Failure::AttemptsUsedUp, "fanuc-rs232.remote.repeat");
        }
        match last {
            Some((Said::Answer, message)) => {
                self.say(Said::Answer, message, "fanuc-rs232.remote.repeat");
            }
            Some((said, message)) if is_of_job => {
                self.say(said, message, "fanuc-rs232.remote.repeat");
            }
            _ => self.answer("WAT", "fanuc-rs232.remote.repeat"),
        }
    }

    /// A message that was none.
    fn ask_again(&mut self, bad: Bad) {
        self.dialogue.bad += 1;
        let (reason, failure) = match bad {
            Bad::Sum => (b"1", Failure::Checksum),
            Bad::Command => {
                // One that has its sum ends a row of RTY; the page does not say so.
                self.dialogue.repeats = 0;
                (b"2", Failure::Protocol)
            }
        };
        // As for RTY: without a job the fourth has no answer.
        if self.dialogue.bad > REPETITIONS {
            self.dialogue.bad = 0;
            return self.fail(failure, "fanuc-rs232.remote.ask-again");
        }
        self.dialogue.asked_again = true;
        let message = compose("RTY", reason, self.rules.end);
        self.send(&message, false, "fanuc-rs232.remote.ask-again");
    }

    /// SYN, which begins a job where the control is not known.
    pub(super) fn initialise(&mut self) {
        let message = compose("SYN", &[], self.rules.end);
        self.say(Said::Syn, message, "fanuc-rs232.remote.initialise");
    }

    fn answer(&mut self, command: &str, clause: &'static str) {
        let message = compose(command, &[], self.rules.end);
        self.say(Said::Answer, message, clause);
    }

    /// A message that RTY gets once more.
    fn say(&mut self, said: Said, message: Vec<u8>, clause: &'static str) {
        self.send(&message, matches!(said, Said::Dat | Said::Eod), clause);
        self.dialogue.awaits_rdy |= said == Said::Syn;
        self.dialogue.last = Some((said, message));
        self.dialogue.last_job = self.jobs;
    }

    fn send(&mut self, message: &[u8], is_job: bool, clause: &'static str) {
        // What finds no room is not said, and the model does not follow that.
        self.is_unsure |= self.wire.known() < message.len();
        if !self.is_unsure {
            let made: Vec<u8> = message.iter().map(|own| sent(&self.rules, *own)).collect();
            self.wire.send(&made, is_job, clause);
        }
    }

    /// `poll_time` of silence is over.
    pub(super) fn silence(&mut self) {
        if self.job.as_ref().is_some_and(|job| job.is_ended) {
            return self.end();
        }
        self.fail(Failure::NoAnswer, "fanuc-rs232.remote.silence");
        self.dialogue.is_ready = false;
    }

    /// A job whose EOD was sent is done.
    fn end(&mut self) {
        let Some(Job { id: job, .. }) = self.job.take_if(|job| job.is_ended) else { return };
        // What still has to leave will: nothing drops it.
        let sent = self.wire.queued();
        self.demands.add(Effect::Done { job, sent }, "fanuc-rs232.remote.end");
    }

    /// The job fails; all that waits is dropped.
    pub(super) fn fail(&mut self, failure: Failure, clause: &'static str) {
        let Some(Job { id: job, .. }) = self.job.take() else { return };
        let failed = Effect::Failed { job, failure, status: 0, sent: self.wire.taken() };
        self.demands.add(failed, clause);
        self.wire.discard();
    }

    /// A character came.
    pub(super) fn heard(&mut self, at: Micros) {
        self.dialogue.heard = at;
    }
}
