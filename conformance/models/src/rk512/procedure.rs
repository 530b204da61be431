//! What comes up from the procedure below, and what goes down to it.

use super::layer::{Layer, Sender};
use super::telegram::{Kind, MOST};
use crate::r3964::Report;
use softplug_abi::Micros;

impl Layer {
    /// A buffer is room for the data that a reaction to our FETCH may bring; other
    /// telegrams bring the host's deliveries nothing.
    pub(super) fn look_at_room(&mut self) {
        let room = self.room.known();
        let is_full = match &self.job {
            Some(job) if job.command.kind == Kind::Fetch => room < MOST,
            _ => false,
        };
        self.station.set_full(is_full);
    }

    /// What the procedure reports.
    pub(super) fn hear(&mut self, at: Micros) {
        self.station.set_full(false);
        for report in self.station.reports() {
            match report {
                Report::Received(telegram) => self.telegram(at, &telegram),
                Report::Sent(sent) => match std::mem::replace(&mut self.sender, Sender::Nobody) {
                    Sender::Job => self.telegram_sent(at, sent),
                    Sender::Reaction => self.reaction_sent(),
                    Sender::Nobody => {}
                },
                Report::Failed { failure, status, sent, clause } => {
                    match std::mem::replace(&mut self.sender, Sender::Nobody) {
                        Sender::Job => {
                            if let Some(job) = &mut self.job {
                                job.sent += sent;
                            }
                            self.fail_job((failure, status, clause));
                        }
                        Sender::Reaction | Sender::Nobody => {}
                    }
                }
            }
        }
        if self.station.takes_begun_again() && self.station.has_block() {
            self.begun_again();
        }
        self.feed(false);
    }

    /// The block that gave way is begun again, behind the reaction if that waits.
    fn begun_again(&mut self) {
        match self.sender {
            Sender::Job if self.reaction.is_some() => {
                self.put_telegram_back();
            }
            Sender::Nobody | Sender::Job | Sender::Reaction => {}
        }
    }

    fn telegram(&mut self, at: Micros, telegram: &[u8]) {
        // Byte 3 of a reaction is 00.
        let is_command = telegram.get(2).is_some_and(|command| *command != 0);
        let is_whole = telegram.len() >= 4 && matches!(telegram[0], 0 | 0xFF) && telegram[1] == 0;
        if is_command {
            self.serve(at, telegram);
        // Whether one without a byte 3 is a reaction is left open.
        } else if self.awaits_reaction() && (telegram.len() > 2 || !self.ways.is_other()) {
            self.take_reaction(telegram);
        // Whether a reaction that nobody awaits may be malformed is left open.
        } else if !is_whole && (self.awaits_reaction() || self.ways.is_other()) {
            self.serve(at, telegram);
        }
    }

    /// Gives the procedure what waits for it.
    pub(super) fn feed(&mut self, are_data_there: bool) {
        if self.is_down || self.station.has_block() || !self.station.may_begin() {
            return;
        }
        if self.reaction.is_some() {
            self.send_reaction();
        } else if self.has_telegram(are_data_there) {
            self.send_telegram();
        }
    }
}
