//! A job goes.

use super::agree::Agreed;
use super::code::encode;
use super::packet::{Packet, packet};
use super::{Kermit, State};
use crate::model::Effect;
use crate::out::Out;
use softplug_abi::{Failure, Micros};

/// A job: it waits, or is on the line.
#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    pub(super) name: String,
    /// As it goes: with CR before LF in a text.
    pub(super) data: Vec<u8>,
    pub(super) is_paused: bool,
    /// Until when its S must be answered.
    pub(super) until: Option<Micros>,
    /// Characters that were queued for it.
    pub(super) queued: u64,
}

/// What of the job is on the line.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    pub(super) stage: Stage,
    pub(super) kind: u8,
    pub(super) number: u8,
    /// Bytes of the job that are with the receiver, and those that the packet has besides.
    done: usize,
    length: usize,
    pub(super) packet: Vec<u8>,
    repeats: u32,
    is_interrupted: bool,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Stage {
    /// Nothing is on its way: the job is paused.
    Paused,
    /// It has left at this place.
    Leaving(u64),
    /// Its answer is awaited.
    Answer,
}

impl Sending {
    fn is_confirmed(&self) -> bool {
        self.kind == b'B' && !self.is_interrupted
    }

    /// Whether it can be answered: all of it has left but its EOL.
    pub(super) fn is_answerable(&self, out: &Out) -> bool {
        match self.stage {
            Stage::Paused => false,
            Stage::Leaving(place) => out.has_left(place - 1),
            Stage::Answer => true,
        }
    }
}

impl Kermit {
    /// A job that could not begin yet begins, if there is one.
    pub(super) fn begins_job_that_waits(&mut self) {
        if !matches!(self.state, State::Idle) || self.job.is_none() {
            return;
        }
        self.withdraws("kermit.ask.withdrawn");
        self.granted = None;
        self.agreed = Agreed::nothing();
        self.until = None;
        let until = self.rules.begin_time.map(|time| self.now + time);
        if let Some(job) = &mut self.job {
            job.until = until;
        }
        self.state = State::Sending(Sending {
            stage: Stage::Paused,
            kind: b'S',
            number: 0,
            done: 0,
            length: 0,
            packet: Vec::new(),
            repeats: 0,
            is_interrupted: false,
        });
        self.makes("kermit.tx.begin");
    }

    /// Makes the packet that is next, and lets it go.
    fn makes(&mut self, clause: &'static str) {
        let (Some(job), State::Sending(sending)) = (&self.job, &mut self.state) else { return };
        let agreed = &self.agreed;
        let short = agreed.short - 2 - agreed.check;
        let long = agreed.long.unwrap_or(0).saturating_sub(7 + agreed.check);
        sending.length = 0;
        let mut data = Vec::new();
        match sending.kind {
            b'S' => data = self.rules.offer(),
            b'F' => {
                let (name, used) = encode(job.name.as_bytes(), agreed, short);
                if used < job.name.len() {
                    return self.fails(Failure::BadJob, "kermit.tx.name");
                }
                data = name;
            }
            b'D' => {
                let rest = &job.data[sending.done..];
                (data, sending.length) = encode(rest, agreed, short.max(long));
                let cannot = |byte: &u8| *byte > 127 && agreed.eighth.is_none();
                // It is looked at where the packet may have room for it.
                let looked_at = rest.len().min(sending.length + 1);
                if self.rules.is_narrow() && rest[..looked_at].iter().any(cannot) {
                    self.narrow_at = Some(self.now);
                    return self.fails(Failure::UnsupportedCharacter, "kermit.tx.narrow");
                }
                if rest.is_empty() {
                    sending.kind = b'Z';
                }
            }
            b'Z' if sending.is_interrupted => data = b"D".to_vec(),
            _ => {}
        }
        sending.packet = packet(sending.kind, sending.number, &data, agreed.check, agreed.short);
        self.goes(clause);
    }

    /// The packet goes, if the job is not paused.
    pub(super) fn goes(&mut self, clause: &'static str) {
        self.until = None;
        let (Some(job), State::Sending(sending)) = (&mut self.job, &mut self.state) else { return };
        if job.is_paused {
            sending.stage = Stage::Paused;
            return;
        }
        let all = [&self.agreed.padding[..], &sending.packet, &[self.agreed.end]].concat();
        job.queued += all.len() as u64;
        sending.stage = Stage::Leaving(self.out.send(&all, clause));
    }

    /// A good packet while the job is on the line.
    pub(super) fn is_answered(&mut self, packet: &Packet) {
        let State::Sending(sending) = &self.state else { return };
        if packet.kind == b'E' {
            return self.fails(Failure::Refused, "kermit.tx.error");
        }
        if !sending.is_answerable(&self.out) {
            return;
        }
        let is_own = packet.number == sending.number;
        let is_next = packet.number == (sending.number + 1) % 64;
        let is_first = sending.kind == b'S';
        let is_echo = sending.packet.get(1..) == Some(&packet.all[..]);
        let ended = self.ended.as_ref().map(|(number, _)| *number);
        match packet.kind {
            b'Y' if is_own => self.is_acknowledged(packet),
            b'N' if is_own || (is_next && is_first) => self.goes_again(Failure::AttemptsUsedUp),
            b'N' if is_next => self.goes_on("kermit.tx.next-nak"),
            b'S' if is_first && !is_echo => {
                if let Some(job) = &mut self.job {
                    job.until = None;
                }
                self.begins_transfer(packet);
            }
            b'B' if is_first && ended == Some(packet.number) => {
                self.acknowledges_end();
                self.waits();
            }
            _ => self.waits(),
        }
    }

    fn is_acknowledged(&mut self, packet: &Packet) {
        let (Some(job), State::Sending(sending)) = (&mut self.job, &mut self.state) else { return };
        match sending.kind {
            b'S' => {
                job.until = None;
                self.ended = None;
                self.agreed = Agreed::answered(&packet.data, &self.rules);
                if self.rules.crc_only && self.agreed.check < 3 {
                    return self.fails(Failure::NotSupported, "kermit.line.crc-only");
                }
            }
            b'D' => sending.is_interrupted = matches!(packet.data.first(), Some(b'X' | b'Z')),
            _ => {}
        }
        self.goes_on("kermit.tx.order");
    }

    /// The packet is with the receiver.
    fn goes_on(&mut self, clause: &'static str) {
        let State::Sending(sending) = &mut self.state else { return };
        sending.done += sending.length;
        sending.kind = match sending.kind {
            b'S' => b'F',
            b'D' if sending.is_interrupted => b'Z',
            b'F' | b'D' => b'D',
            b'Z' => b'B',
            _ => return self.ends_job(),
        };
        sending.number = (sending.number + 1) % 64;
        sending.repeats = 0;
        self.makes(clause);
    }

    pub(super) fn goes_again(&mut self, failure: Failure) {
        let State::Sending(sending) = &mut self.state else { return };
        if sending.kind == b'S' {
            return self.goes("kermit.tx.begin");
        }
        sending.repeats += 1;
        if sending.repeats <= self.rules.repeats {
            self.goes("kermit.tx.repeat");
        } else if sending.kind == b'B' {
            self.ends_job();
        } else {
            self.fails(failure, "kermit.tx.repeat");
        }
    }

    /// The end of the transfer is acknowledged, or nobody answers it.
    fn ends_job(&mut self) {
        let State::Sending(sending) = &self.state else { return };
        let is_confirmed = sending.is_confirmed();
        if let Some(Job { id: job, queued: sent, .. }) = self.job.take() {
            let effect = if is_confirmed {
                Effect::Done { job, sent }
            } else {
                Effect::Failed { job, failure: Failure::Refused, status: 0, sent }
            };
            self.expected.expect("kermit.tx.confirmed", effect);
        }
        self.rests();
    }

    fn rests(&mut self) {
        self.state = State::Idle;
        self.until = None;
        self.agreed = Agreed::nothing();
    }

    /// The job on the line fails, if it is not confirmed; E follows where the receiver does not
    /// know.
    pub(super) fn fails(&mut self, failure: Failure, clause: &'static str) {
        let State::Sending(sending) = &self.state else { return };
        let (number, is_last) = (sending.number, sending.kind == b'B');
        let is_confirmed = sending.is_confirmed() && failure != Failure::Interrupted;
        let dropped = self.out.discard();
        if let Some(Job { id: job, queued, .. }) = self.job.take() {
            let sent = queued.saturating_sub(dropped);
            let effect = if is_confirmed {
                Effect::Done { job, sent }
            } else {
                Effect::Failed { job, failure, status: 0, sent }
            };
            self.expected.expect(clause, effect);
        }
        let text = match failure {
            Failure::Refused | Failure::LinkDown | Failure::Interrupted => "",
            _ if is_last => "",
            Failure::Aborted => "Cancelled",
            Failure::NotSupported => "CRC is needed",
            Failure::UnsupportedCharacter => "Bytes above 127 cannot be sent",
            Failure::BadJob => "The name is too long",
            _ => "Too many errors",
        };
        if !text.is_empty() {
            self.says(b'E', number, text.as_bytes(), clause);
        }
        self.rests();
    }

    /// A job that waits fails.
    pub(super) fn drops_job(&mut self, failure: Failure, clause: &'static str) {
        let Some(job) = self.job.take() else { return };
        let sent = job.queued;
        self.expected.expect(clause, Effect::Failed { job: job.id, failure, status: 0, sent });
    }

    /// A character of ours has left.
    pub(super) fn progress(&mut self) {
        let State::Sending(sending) = &mut self.state else { return };
        let Stage::Leaving(place) = sending.stage else { return };
        if !self.out.has_left(place) {
            return;
        }
        sending.stage = Stage::Answer;
        self.waits();
        if self.hearing.is_some() {
            self.waits_inside();
        }
    }

    pub(super) fn aborts_job(&mut self) {
        match &self.state {
            State::Sending(_) => self.fails(Failure::Aborted, "kermit.tx.abort"),
            _ => self.drops_job(Failure::Aborted, "kermit.tx.abort"),
        }
    }
}
