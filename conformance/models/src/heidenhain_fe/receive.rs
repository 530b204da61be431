//! The control sends: headers of mode A, blocks, and their end.

use super::frame::{ACK, EOT, Kind, NAK};
use super::room::Room;
use super::{Fe, LONGEST_NAME, State};
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// A delivery under way.
#[derive(Clone, Debug)]
pub(super) struct Reception {
    name: String,
    bytes: Vec<u8>,
    /// Bad blocks in a row.
    pub(super) refusals: u32,
    pub(super) has_etx: bool,
    /// A good line that has found no room, with its end.
    pub(super) waiting: Option<Vec<u8>>,
    /// It found room while a block came: its answer follows that one.
    pub(super) owed: Option<Vec<u8>>,
    /// When the latest character came, or the latest answer that was late.
    pub(super) latest: Micros,
}

impl Fe {
    /// A header that is bad, or of another mode.
    pub(super) fn bad_header(&mut self) {
        // An answer in the middle of a program would be taken for a part of it.
        if let State::Sending(_) = self.state {
            return;
        }
        self.out.send(&[NAK], "heidenhain-fe.rx.bad-header");
    }

    /// A header of mode A; nothing is under way.
    pub(super) fn header_a(&mut self, name: &[u8]) {
        if self.doubts_place() {
            return;
        }
        if self.has_no_place {
            return self.end_all("heidenhain-fe.rx.no-room");
        }
        self.deliveries += 1;
        let clause = if self.deliveries > 1 {
            "heidenhain-fe.rx.several"
        } else {
            "heidenhain-fe.rx.header"
        };
        self.out.send(&[ACK], clause);
        // A delivery's name has an end; what is longer cannot be told.
        let name = &name[..name.len().min(LONGEST_NAME)];
        self.state = State::Receiving(Reception {
            name: String::from_utf8_lossy(name).into_owned(),
            bytes: Vec::new(),
            refusals: 0,
            has_etx: false,
            waiting: None,
            owed: None,
            latest: self.now,
        });
    }

    /// Whether it cannot be told if the plug-in knows of a place.
    pub(super) fn doubts_place(&mut self) -> bool {
        // Some room that may not have been told.
        self.is_blind |= self.has_no_place && self.room.free() > 0;
        self.is_blind
    }

    /// Another block comes behind a line of which it cannot be told whether it waits.
    fn doubts_line(&mut self) {
        self.is_blind |= self.may_have_taken_room();
    }

    /// A good block.
    pub(super) fn block(&mut self, text: &[u8]) {
        self.doubts_line();
        if let Some(line) = self.answers_late()
            && line == [text, self.rules.line_end].concat()
        {
            return;
        }
        match &mut self.state {
            // An answer in the middle of a program would be taken for a part of it.
            State::Receiving(Reception { waiting: Some(_), .. }) | State::Sending(_) => {}
            State::Receiving(reception) => {
                reception.refusals = 0;
                reception.has_etx = false;
                reception.waiting = Some([text, self.rules.line_end].concat());
                self.takes_room();
            }
            State::Idle | State::Asking { .. } | State::Granted { .. } => {
                self.take_back("heidenhain-fe.rx.stray-block");
                self.out.send(&[EOT], "heidenhain-fe.rx.stray-block");
            }
        }
    }

    /// A block that is damaged, too long or broken off.
    pub(super) fn bad_block(&mut self) {
        const CLAUSE: &str = "heidenhain-fe.rx.bad-block";
        self.doubts_line();
        if self.answers_late().is_some() {
            return;
        }
        // One that belongs to no header is passed over: the page speaks of the delivery.
        let State::Receiving(reception) = &mut self.state else { return };
        if reception.waiting.is_some() {
            return;
        }
        reception.has_etx = false;
        reception.refusals += 1;
        if reception.refusals > self.rules.repeats {
            self.end_delivery(Some(Failure::Checksum), CLAUSE);
            self.end_all(CLAUSE);
        } else {
            self.out.send(&[NAK], CLAUSE);
        }
    }

    /// A line that waits for room finds it for certain.
    pub(super) fn takes_room(&mut self) {
        let is_mid_block = self.frame.as_ref().is_some_and(|frame| frame.kind == Kind::Block);
        self.takes_room_if(Room::must_take, is_mid_block);
    }

    /// The host has put something away.
    pub(super) fn has_more_room(&mut self) {
        self.takes_room();
    }

    /// The plug-in answers: it may know of more room than it was told of for certain, and may have
    /// known of it when the line came.
    pub(super) fn takes_room_early(&mut self) {
        self.takes_room_if(Room::may_take, false);
    }

    /// A line waits for room that the plug-in may know of: its answer, if there is
    /// one, is seen only when it leaves.
    pub(super) fn may_have_taken_room(&self) -> bool {
        let State::Receiving(reception) = &self.state else { return false };
        reception.waiting.as_ref().is_some_and(|line| self.room.may_take(line.len()))
    }

    fn takes_room_if(&mut self, has_room: impl Fn(&Room, usize) -> bool, answers_late: bool) {
        if let State::Receiving(reception) = &mut self.state
            && let Some(line) = reception.waiting.take_if(|line| has_room(&self.room, line.len()))
        {
            self.delivers(&line, answers_late);
        }
    }

    /// A good line finds room: it is delivered and answered, or behind the block that comes.
    fn delivers(&mut self, line: &[u8], answers_late: bool) {
        let State::Receiving(reception) = &mut self.state else { return };
        reception.bytes.extend(line);
        reception.latest = self.now;
        self.room.deliver(line.len());
        if answers_late {
            reception.owed = Some(line.to_vec());
        } else {
            self.out.send(&[ACK], "heidenhain-fe.rx.block");
        }
    }

    /// A block has ended during which a line found room: that line is answered.
    fn answers_late(&mut self) -> Option<Vec<u8>> {
        let State::Receiving(reception) = &mut self.state else { return None };
        let line = reception.owed.take()?;
        self.out.send(&[ACK], "heidenhain-fe.rx.room");
        Some(line)
    }

    /// The delivery ends; a line that waits for room is no part of it.
    pub(super) fn end_delivery(&mut self, failure: Option<Failure>, clause: &'static str) {
        // What the plug-in knows of the room decides whether the line belongs to it.
        self.is_blind |= self.may_have_taken_room();
        let State::Receiving(reception) = std::mem::replace(&mut self.state, State::Idle) else {
            return;
        };
        let Reception { name, bytes, .. } = reception;
        let id = self.deliveries;
        self.expected
            .expect(clause, Effect::Delivered { id, bytes, name: Some(name), failure, status: 0 });
    }
}
