//! What comes from the line: characters, headers and blocks, and the port's end.

use super::frame::{ACK, DC1, DC3, EOT, ETX, Frame, Kind, NAK, SOH, STX, Step};
use super::receive::Reception;
use super::{Fe, State};
use softplug_abi::Failure;

impl Fe {
    /// A character as it is meant; `None`: it is damaged.
    pub(super) fn read(&self, byte: u8) -> Option<u8> {
        let is_good = if self.rules.makes_parity {
            byte.count_ones().is_multiple_of(2)
        } else {
            byte & 0x80 == 0
        };
        is_good.then_some(byte & 0x7F)
    }

    /// A character comes; `None`: damaged, or lost.
    pub(super) fn character(&mut self, character: Option<u8>) {
        if let State::Receiving(reception) = &mut self.state {
            reception.latest = self.now;
        }
        if let Some(frame) = &mut self.frame {
            match frame.take(self.now, character, self.rules.dc1) {
                Step::GoesOn => {}
                Step::BeginsAnew(kind) => self.frame = Some(Frame::new(kind, self.now)),
                Step::Ends => self.frame_ends(),
            }
            return;
        }
        match character {
            Some(SOH) => self.frame_begins(Kind::Header),
            Some(STX) => self.frame_begins(Kind::Block),
            Some(ETX) => {
                // One that does not wait for its answer ends nothing.
                if let State::Receiving(reception) = &mut self.state {
                    let is_answered = reception.waiting.is_none() && reception.owed.is_none();
                    reception.has_etx = is_answered && reception.refusals == 0;
                }
            }
            Some(EOT) => self.eot(),
            Some(ACK) => self.answered(true),
            Some(NAK) => self.answered(false),
            Some(DC1) => self.hold(false),
            Some(DC3) => self.hold(true),
            // What means nothing is passed over (line.noise), ETX EOT may have it between them.
            _ => {}
        }
    }

    fn frame_begins(&mut self, kind: Kind) {
        self.frame = Some(Frame::new(kind, self.now));
    }

    /// The header or block is whole, or silence has ended it.
    pub(super) fn frame_ends(&mut self) {
        let Some(frame) = self.frame.take() else { return };
        // The time between two blocks counts from their ends, also where silence is the end.
        if let State::Receiving(reception) = &mut self.state {
            reception.latest = self.now;
        }
        let text = frame.stripped(self.rules.bcc_space).to_vec();
        match (frame.kind, frame.is_bad) {
            (Kind::Header, true) => self.bad_header(),
            (Kind::Header, false) => self.header(&text),
            (Kind::Block, true) => self.bad_block(),
            (Kind::Block, false) => self.block(&text),
        }
    }

    /// A good header: it ends what was before.
    fn header(&mut self, text: &[u8]) {
        self.is_begun_anew();
        match text {
            [_, name @ .., b'A'] => self.header_a(name),
            [kind, name @ .., b'E'] => self.header_e(*kind, name),
            _ => self.bad_header(),
        }
    }

    /// Another header has come (rx.new-header, tx.withdrawn, tx.header-between).
    fn is_begun_anew(&mut self) {
        let failure = Some(Failure::PartnerReset);
        match self.state {
            State::Receiving(_) => self.end_delivery(failure, "heidenhain-fe.rx.new-header"),
            State::Sending(_) => {
                self.fail_job(Failure::PartnerReset, "heidenhain-fe.tx.header-between");
            }
            State::Asking { .. } | State::Granted { .. } => {
                self.take_back("heidenhain-fe.tx.withdrawn");
            }
            State::Idle => {}
        }
    }

    /// EOT outside of headers and blocks.
    fn eot(&mut self) {
        match &self.state {
            State::Receiving(Reception { has_etx: true, .. }) => {
                self.end_delivery(None, "heidenhain-fe.rx.end");
            }
            State::Receiving(_) => {
                self.end_delivery(Some(Failure::NoEndMark), "heidenhain-fe.rx.no-end");
            }
            State::Asking { .. } | State::Granted { .. } => {
                self.take_back("heidenhain-fe.tx.withdrawn");
            }
            State::Sending(sending) if !sending.is_ending() => {
                self.fail_job(Failure::Refused, "heidenhain-fe.tx.partner-ends");
            }
            // Both are at this instant, or the queue has no room for our ETX EOT: whether it
            // comes after that is open.
            State::Sending(sending) => {
                self.is_blind |= sending.since == self.now || self.rules.has_small_queue;
            }
            State::Idle => {}
        }
    }

    /// DC3 stops our next character, DC1 or the host lets it go on.
    pub(super) fn hold(&mut self, is_held: bool) {
        self.is_held = is_held;
        self.out.hold(is_held);
    }

    /// The port is gone (line.down).
    pub(super) fn goes_down(&mut self) {
        const CLAUSE: &str = "heidenhain-fe.line.down";
        self.frame = None;
        match self.state {
            State::Receiving(_) => self.end_delivery(Some(Failure::LinkDown), CLAUSE),
            State::Asking { .. } | State::Granted { .. } => self.take_back(CLAUSE),
            State::Sending(_) | State::Idle => {}
        }
        if self.job.is_some() {
            self.fail_job(Failure::LinkDown, CLAUSE);
        }
        // Answers that a hold has kept back leave when the link is back.
        self.hold(false);
        self.is_down = true;
        self.out.set_gone(true);
    }

    /// We tell the control that what is under way ends.
    pub(super) fn end_all(&mut self, clause: &'static str) {
        self.state = State::Idle;
        self.out.send(&[EOT], clause);
    }
}
