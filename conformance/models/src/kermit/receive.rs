//! Files come, and are asked for.

use super::agree::Agreed;
use super::code::{decode, title};
use super::packet::Packet;
use super::{Kermit, State};
use crate::model::Effect;
use softplug_abi::Failure;

/// The file that comes.
#[derive(Clone, Debug)]
pub(super) struct File {
    name: String,
    /// As it came, before ends of lines were looked at.
    bytes: Vec<u8>,
    /// All of it has come.
    is_whole: bool,
}

impl File {
    /// What is delivered: in a text CR LF is LF. A CR of which it is not known whether LF
    /// follows stays out.
    fn delivered(&self, is_text: bool, is_whole: bool) -> Vec<u8> {
        if !is_text {
            return self.bytes.clone();
        }
        let mut delivered = Vec::new();
        for (place, byte) in self.bytes.iter().enumerate() {
            match (byte, self.bytes.get(place + 1)) {
                (b'\r', Some(b'\n')) => {}
                (b'\r', None) if !is_whole => {}
                _ => delivered.push(*byte),
            }
        }
        delivered
    }
}

impl Kermit {
    /// A good packet where no job is on the line.
    pub(super) fn hears(&mut self, packet: &Packet) {
        let is_under_way = !matches!(self.state, State::Idle);
        let ended = self.ended.as_ref().map(|(number, _)| *number);
        match packet.kind {
            b'S' if packet.number == 0 => self.begins_transfer(packet),
            b'E' => {
                self.withdraws("kermit.ask.withdrawn");
                self.granted = None;
                if is_under_way {
                    self.ends_transfer(Some(Failure::NoEndMark), "kermit.rx.error");
                    self.begins_job_that_waits();
                }
            }
            b'Y' | b'N' => self.waits(),
            _ if is_under_way => self.hears_next(packet),
            b'B' if ended == Some(packet.number) => self.acknowledges_end(),
            b'I' => {
                let (agreed, answer) = Agreed::asked(&packet.data, &self.rules);
                if self.rules.crc_only && agreed.check < 3 {
                    self.agreed = Agreed::nothing();
                    self.says(b'E', packet.number, b"CRC is needed", "kermit.line.crc-only");
                } else {
                    self.agreed = Agreed { check: 1, ..agreed };
                    self.says(b'Y', packet.number, &answer, "kermit.ask.exchange");
                }
            }
            b'R' => self.is_asked(packet),
            b'G' | b'C' | b'K' => {
                let text = "Commands are not supported";
                self.says_plainly(packet.number, text, "kermit.ask.commands");
            }
            _ => {
                self.says(b'E', packet.number, b"No transfer is under way", "kermit.rx.idle");
            }
        }
    }

    /// S: a transfer begins, or begins again.
    pub(super) fn begins_transfer(&mut self, packet: &Packet) {
        self.ends_transfer(Some(Failure::PartnerReset), "kermit.rx.restart");
        self.withdraws("kermit.ask.withdrawn");
        self.granted = None;
        let (agreed, answer) = Agreed::asked(&packet.data, &self.rules);
        if self.rules.crc_only && agreed.check < 3 {
            self.says(b'E', 0, b"CRC is needed", "kermit.line.crc-only");
            return self.begins_job_that_waits();
        }
        self.agreed = Agreed { check: 1, ..agreed.clone() };
        self.says(b'Y', 0, &answer, "kermit.rx.begin");
        self.agreed = agreed;
        (self.expected_number, self.latest) = (1, b'S');
        self.state = State::AwaitFile;
        self.waits();
    }

    fn hears_next(&mut self, packet: &Packet) {
        let before = (self.expected_number + 63) % 64;
        if packet.number == before && packet.kind == self.latest {
            self.refusals = 0;
            self.acknowledges(packet.number, packet.kind, "kermit.rx.again");
            return self.waits();
        }
        if packet.number != self.expected_number {
            return self.refuses(Failure::Protocol, "kermit.rx.wrong-number");
        }
        match (&self.state, packet.kind) {
            (State::AwaitFile, b'F') => {
                self.ends_whole_file();
                let name = title(&packet.data, &self.agreed);
                self.file = Some(File { name, bytes: Vec::new(), is_whole: false });
                self.accepts(packet, State::AwaitData);
            }
            (State::AwaitFile, b'B') => {
                let agreed = self.agreed.clone();
                self.acknowledges(packet.number, b'B', "kermit.rx.file");
                self.ends_transfer(None, "kermit.rx.file");
                self.ended = Some((packet.number, agreed));
                self.begins_job_that_waits();
            }
            (State::AwaitData, b'A') => self.accepts(packet, State::AwaitData),
            (State::AwaitData, b'D') => self.hears_data(packet),
            (State::AwaitData, b'Z') => {
                if packet.data == b"D" {
                    self.ends_file(Some(Failure::NoEndMark), "kermit.rx.discard");
                } else if let Some(file) = &mut self.file {
                    file.is_whole = true;
                }
                self.accepts(packet, State::AwaitFile);
            }
            _ => {
                let text = b"This packet is not expected here";
                self.says(b'E', packet.number, text, "kermit.rx.unexpected");
                self.ends_transfer(Some(Failure::Protocol), "kermit.rx.unexpected");
                self.begins_job_that_waits();
            }
        }
    }

    fn hears_data(&mut self, packet: &Packet) {
        let (bytes, is_whole) = decode(&packet.data, &self.agreed);
        if !is_whole {
            return self.refuses(Failure::Protocol, "kermit.rx.wrong-number");
        }
        // How much of it finds room, and when, is the host's matter.
        if !self.takes_room(bytes.len() + 1) {
            self.is_blind = true;
        }
        if let Some(file) = &mut self.file {
            file.bytes.extend(bytes);
        }
        self.accepts(packet, State::AwaitData);
    }

    /// Whether so many bytes find room. With all that is put away at once they do.
    fn takes_room(&mut self, bytes: usize) -> bool {
        let is_sure = self.room.take(bytes);
        if self.room.is_over() {
            self.full_at = Some(self.now);
        }
        is_sure
    }

    fn accepts(&mut self, packet: &Packet, next: State) {
        self.refusals = 0;
        self.acknowledges(packet.number, packet.kind, "kermit.rx.file");
        self.expected_number = (packet.number + 1) % 64;
        self.latest = packet.kind;
        self.state = next;
        self.waits();
    }

    fn acknowledges(&mut self, number: u8, kind: u8, clause: &'static str) {
        self.says(b'Y', number, if kind == b'A' { b"Y" } else { b"" }, clause);
    }

    /// B of the last transfer comes again.
    pub(super) fn acknowledges_end(&mut self) {
        if let Some((number, agreed)) = self.ended.clone() {
            self.says_as(&agreed, b'Y', number, b"", "kermit.rx.end-again");
        }
    }

    /// What was to come is asked for again, or it is over.
    pub(super) fn refuses(&mut self, why: Failure, clause: &'static str) {
        let number = self.expected_number;
        self.ends_whole_file();
        self.refusals += 1;
        if self.refusals <= self.rules.repeats {
            self.says(b'N', number, b"", clause);
            return self.waits();
        }
        self.says(b'E', number, b"Too many errors", "kermit.rx.repeats");
        self.ends_transfer(Some(why), "kermit.rx.repeats");
        self.begins_job_that_waits();
    }

    fn ends_file(&mut self, failure: Option<Failure>, clause: &'static str) {
        let Some(file) = self.file.take() else { return };
        let failure = failure.filter(|_| !file.is_whole);
        self.deliveries += 1;
        let bytes = file.delivered(self.rules.is_text, failure.is_none());
        let name = Some(file.name).filter(|name| !name.is_empty());
        let id = self.deliveries;
        self.expected.expect(clause, Effect::Delivered { id, bytes, name, failure, status: 0 });
    }

    /// Something has come behind the end of the file.
    fn ends_whole_file(&mut self) {
        if self.file.as_ref().is_some_and(|file| file.is_whole) {
            self.ends_file(None, "kermit.rx.complete");
        }
    }

    /// Nothing is under way any more.
    pub(super) fn ends_transfer(&mut self, failure: Option<Failure>, clause: &'static str) {
        self.ends_file(failure, clause);
        self.refusals = 0;
        self.ended = None;
        self.agreed = Agreed::nothing();
        self.state = State::Idle;
        self.until = None;
    }

    /// The host wants no more of the file.
    pub(super) fn aborts_file(&mut self) {
        if self.file.is_some() {
            self.says(b'E', self.expected_number, b"Cancelled", "kermit.rx.abort");
            self.ends_transfer(Some(Failure::Aborted), "kermit.rx.abort");
            self.begins_job_that_waits();
        }
    }

    /// A machine asks for a file.
    fn is_asked(&mut self, packet: &Packet) {
        const CLAUSE: &str = "kermit.ask.request";
        let name = title(&packet.data, &self.agreed);
        let is_same = self.request.is_some() && self.asked_for == name;
        if is_same || self.granted.is_some() {
            return;
        }
        self.withdraws(CLAUSE);
        if name.is_empty() {
            return self.says_plainly(packet.number, "A name is needed", CLAUSE);
        }
        self.requests += 1;
        let id = self.requests;
        self.request = Some(id);
        self.asked_for.clone_from(&name);
        let fields = vec![("name".to_owned(), name)];
        self.expected.expect(CLAUSE, Effect::Requested { id, kind: "program".to_owned(), fields });
    }

    pub(super) fn is_answered_by_host(&mut self, id: u32, answer: Option<Failure>) {
        if self.request != Some(id) {
            return;
        }
        self.request = None;
        if !matches!(self.state, State::Idle) {
            return;
        }
        match answer {
            Some(_) => self.says_plainly(0, "There is no such file", "kermit.ask.refused"),
            None => self.granted = Some(self.now + self.rules.job_time),
        }
    }

    pub(super) fn withdraws(&mut self, clause: &'static str) {
        if let Some(id) = self.request.take() {
            self.expected.expect(clause, Effect::Withdrawn(id));
        }
    }
}
