//! Capture of what the control puts out (PUNCH): from DC2 to DC4, or to the
//! second % and silence.

mod flow;
#[cfg(test)]
mod tests;
mod text;
mod title;

pub(crate) use title::Title;

use crate::code::{Code, Control, Decoded, decode};
use crate::request::Requests;
use crate::short::{self, Short};
use crate::state::State;
use crate::timer::Timer;
use crate::{CAPTURE, ReceiveCode, SendCode, Settings};
use flow::Flow;
use softplug_plugin::{Context, Failure, LineErrorKind, MarkId, MarkState};
use text::Text;
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Mark on our answer to DC2: the feed counts its own from 1.
const ANSWER: MarkId = MarkId(u32::MAX);

/// How far a capture is.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
enum Stage {
    /// No capture.
    Idle,
    /// The code is not known yet; what came since what may be a % is kept.
    Unknown,
    /// Before the first %: nothing counts.
    Leader,
    /// Behind the first %.
    Program,
    /// Behind the second %: blanks do not count, all else is another program.
    Closed,
}

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Punch {
    timer: Timer,
    /// Until then, and for as long as something comes, a % begins nothing: it is
    /// an echo, or the rest of what was aborted.
    deaf: Timer,
    pub(crate) flow: Flow,
    pub(crate) requests: Requests,
    stage: Stage,
    code: Code,
    /// DC4 has come: only SYN or NAK may follow.
    ended: bool,
    /// Our answer to DC2 has not left: there is one at a time.
    is_answering: bool,
    text: Text,
    early: Short,
    /// Which bytes of these are damaged, one bit each.
    damaged: [u8; short::MOST / 8],
    spare: [u8; 3],
}

impl Punch {
    pub(crate) fn is_capturing(&self) -> bool {
        self.stage != Stage::Idle
    }

    pub(crate) fn state(&self) -> Option<State> {
        match (self.stage, self.flow.held) {
            (_, true) => Some(State::Holding),
            (Stage::Idle, _) => None,
            _ => Some(State::Capturing),
        }
    }

    pub(crate) fn set_timers(&self, link: &mut Context<'_>) {
        self.timer.resume(link, CAPTURE);
    }

    /// The code that control bytes are read in: while it is unknown, what may be
    /// a digit in EIA is one.
    pub(crate) fn code(&self) -> Code {
        if self.stage == Stage::Unknown { Code::Eia } else { self.code }
    }

    /// A control code; whether it is none for the feed, which may wait for DC1.
    pub(crate) fn control(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        control: Control,
        is_awaited: bool,
    ) -> bool {
        if !self.is_capturing() {
            if control == Control::Dc2 {
                self.start(link, settings, true);
            }
            return matches!(control, Control::Dc2 | Control::Dc4);
        }
        match control {
            Control::Dc2 if self.ended || self.stage == Stage::Closed => {
                self.finish(link, settings, None);
                self.start(link, settings, true);
            }
            // Repeated until it is answered.
            Control::Dc2 => self.answer_dc2(link, settings),
            Control::Dc4 if !self.ended => {
                self.ended = true;
                self.timer.start(link, CAPTURE, settings.after_dc4);
            }
            Control::Syn => {
                self.finish(link, settings, Some(Failure::PartnerReset));
                return false;
            }
            Control::Nak => {
                self.finish(link, settings, Some(Failure::PartnerAlarm));
                return false;
            }
            // The operator reads already: nothing follows.
            Control::Dc1 if self.ended || is_awaited => {
                self.finish(link, settings, None);
                return false;
            }
            // They concern no output of the control; ours may be echoed.
            Control::Dc1 | Control::Dc3 | Control::Dc4 => {}
        }
        true
    }

    fn start(&mut self, link: &mut Context<'_>, settings: &Settings, by_dc2: bool) {
        (self.stage, self.code) = match settings.receive_code {
            ReceiveCode::Iso => (Stage::Leader, Code::Iso),
            ReceiveCode::Eia => (Stage::Leader, Code::Eia),
            ReceiveCode::Auto if settings.code == SendCode::Iso => (Stage::Unknown, Code::Iso),
            ReceiveCode::Auto => (Stage::Unknown, Code::Eia),
        };
        self.early.clear();
        self.damaged = [0; short::MOST / 8];
        self.text.start();
        if by_dc2 {
            self.answer_dc2(link, settings);
        }
    }

    fn answer_dc2(&mut self, link: &mut Context<'_>, settings: &Settings) {
        // Short of room it is stopped instead, until it may go on.
        self.text.flush(link);
        self.flow.look(link, settings, self.code);
        let is_free = link.delivery_room() > 0 && !self.flow.held;
        if settings.answer_dc2 && is_free && !self.is_answering {
            self.is_answering = true;
            link.transmit_urgent_marked(ANSWER, &[0x11]);
        }
    }

    /// News of a mark that may be on our answer, or on what the control was told.
    pub(crate) fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        if state == MarkState::MaybeLeft {
            return;
        }
        match mark {
            ANSWER => self.is_answering = false,
            flow::TOLD => self.flow.left(link),
            _ => {}
        }
    }

    /// A character that is no control code.
    pub(crate) fn byte(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        if self.ended {
            return;
        }
        if self.stage == Stage::Idle {
            if settings.need_dc2 || self.is_deaf(link, settings) || !is_percent(settings, byte) {
                return;
            }
            self.start(link, settings, false);
        }
        if self.stage != Stage::Unknown {
            self.read(link, settings, byte);
            return;
        }
        if byte == 0 || (!self.has_text() && !is_percent(settings, byte)) {
            return;
        }
        self.keep(link, settings, byte, false);
    }

    /// Keeps a byte until the code is known. A NUL stands for a break, or, if it is not
    /// damaged, for bytes that were lost.
    fn keep(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8, is_damaged: bool) {
        let at = self.early.as_slice().len();
        if let Some(marks) = self.damaged.get_mut(at / 8) {
            *marks |= u8::from(is_damaged) << (at % 8);
        }
        self.early.push(byte);
        match byte {
            // CR is no EIA code.
            0x0A | 0x0D | 0x8D => self.code = Code::Iso,
            0x80 => self.code = Code::Eia,
            _ if self.early.is_full() => self.guess(settings),
            _ => return,
        }
        self.settle(link, settings);
    }

    /// Without an EOB: EIA if every character is one of it, and % among them.
    fn guess(&mut self, settings: &Settings) {
        let early = self.early.as_slice();
        let is_eia =
            |byte: &u8| matches!(decode(settings, Code::Eia, *byte), Decoded::Character(_));
        let is_percent = |byte: &u8| decode(settings, Code::Eia, *byte) == Decoded::Character(b'%');
        let is_all_eia =
            early.iter().filter(|byte| **byte != 0).all(is_eia) && early.iter().any(is_percent);
        self.code = if is_all_eia { Code::Eia } else { Code::Iso };
    }

    /// The code is known: what was kept is read.
    fn settle(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.stage = Stage::Leader;
        let (early, damaged) = (self.early, self.damaged);
        self.early.clear();
        for (at, byte) in early.as_slice().iter().enumerate() {
            let marks = damaged.get(at / 8).copied().unwrap_or_default();
            if marks >> (at % 8) & 1 == 1 {
                self.wrong(link, settings, LineErrorKind::Framing, *byte);
            } else if *byte == 0 {
                self.wrong(link, settings, LineErrorKind::Overrun, 0);
            } else {
                self.read(link, settings, *byte);
            }
        }
    }

    fn read(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        let decoded = decode(settings, self.code, byte);
        let is_cr = self.code == Code::Iso && byte & 0x7F == b'\r';
        if is_cr && decoded == Decoded::Ignored {
            match self.stage {
                Stage::Program => self.text.carriage_return(link, settings),
                Stage::Closed => self.text.end_behind(),
                Stage::Idle | Stage::Unknown | Stage::Leader => {}
            }
            return;
        }
        let was_text = self.has_text();
        let is_closed = self.stage == Stage::Closed;
        let damaged = match decoded {
            Decoded::Ignored => return,
            // Blank tape behind the % is no damage.
            Decoded::Unknown(0) if !self.text.has_ended_line() => return,
            Decoded::Character(character) => {
                self.character(link, settings, character);
                return;
            }
            Decoded::Damaged(byte) | Decoded::Unknown(byte) => byte,
        };
        if is_closed {
            // As before the first %: it is noise.
        } else if is_cr && was_text {
            self.text.carriage_return(link, settings);
        } else if self.code == Code::Iso {
            self.character(link, settings, damaged);
        } else if was_text && damaged != 0 {
            self.text.put(link, damaged);
        }
        if was_text || self.has_text() {
            self.text.damaged(settings);
        }
    }

    fn character(&mut self, link: &mut Context<'_>, settings: &Settings, character: u8) {
        match self.stage {
            Stage::Leader if character == b'%' => {
                self.stage = Stage::Program;
                self.text.begin(link);
            }
            Stage::Program if character == b'%' => {
                self.stage = Stage::Closed;
                self.text.close(link, settings);
            }
            Stage::Program => {
                self.text.character(link, settings, &mut self.requests, character);
            }
            Stage::Closed if character == b'\n' => self.text.end_behind(),
            Stage::Closed if matches!(character, b' ' | b'\t') => {}
            // Another program: nothing of what the control puts out is left out.
            Stage::Closed => {
                self.stage = Stage::Program;
                self.text.begin_again(link, settings, &mut self.requests, character);
            }
            _ => {}
        }
    }

    /// Whether what comes belongs to a program.
    fn has_text(&self) -> bool {
        match self.stage {
            Stage::Program => true,
            Stage::Unknown => !self.early.as_slice().is_empty(),
            Stage::Idle | Stage::Leader | Stage::Closed => false,
        }
    }

    /// A damaged character keeps its place, if that is known.
    pub(crate) fn line_error(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        kind: LineErrorKind,
        byte: Option<u8>,
    ) {
        if !self.is_capturing() || self.ended {
            return;
        }
        let byte = byte.unwrap_or_default();
        if self.stage != Stage::Unknown {
            self.wrong(link, settings, kind, byte);
        } else if !self.has_text() && !is_percent(settings, byte) {
            // Before what may be the first %.
        } else if kind != LineErrorKind::Overrun {
            self.keep(link, settings, byte, true);
        } else {
            self.byte(link, settings, byte);
            if self.stage == Stage::Unknown {
                self.keep(link, settings, 0, false);
            } else {
                self.wrong(link, settings, kind, 0);
            }
        }
    }

    /// A damaged character, or a NUL for none, where the code is known.
    fn wrong(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        kind: LineErrorKind,
        byte: u8,
    ) {
        if self.stage == Stage::Closed {
            return;
        }
        let was_text = self.has_text();
        if byte != 0 {
            self.read(link, settings, byte);
        }
        if !was_text && !self.has_text() {
            return;
        }
        if kind == LineErrorKind::Overrun {
            self.text.lost();
        } else {
            self.text.damaged(settings);
        }
    }

    /// After what came at one time: room and silence.
    pub(crate) fn after_bytes(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.text.flush(link);
        if self.is_capturing() {
            self.flow.look(link, settings, self.code);
            self.await_silence(link, settings);
        }
    }

    /// Silence counts only while the control may send; after DC4 the time runs
    /// on, whatever comes.
    fn await_silence(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.ended {
            return;
        }
        let is_closed = self.stage == Stage::Closed;
        let span = if is_closed { settings.end_quiet } else { settings.quiet_time };
        if self.is_capturing() && !self.flow.held && span > 0 {
            self.timer.start(link, CAPTURE, span);
        } else {
            self.timer.stop(link, CAPTURE);
        }
    }

    /// The host has put deliveries away.
    pub(crate) fn drained(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.flow.drained(link, settings) {
            self.await_silence(link, settings);
        }
    }

    /// Ends the capture, if there is one. It is good only with both its %.
    pub(crate) fn finish(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        failure: Option<Failure>,
    ) {
        if !self.is_capturing() {
            return;
        }
        // As if what ends it had come apart from what came before it at the same time.
        self.text.flush(link);
        self.flow.look(link, settings, self.code);
        if self.stage == Stage::Unknown {
            self.guess(settings);
            self.settle(link, settings);
        }
        let lacks_end = self.stage != Stage::Closed;
        let failure = failure.or(lacks_end.then_some(Failure::NoEndMark));
        self.text.end(link, settings, &mut self.requests, failure);
        self.stage = Stage::Idle;
        self.ended = false;
        self.timer.stop(link, CAPTURE);
    }

    /// The control is not left waiting.
    pub(crate) fn abort(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.is_capturing() {
            self.finish(link, settings, Some(Failure::Aborted));
            self.deafen(link, settings);
        }
        self.flow.let_go(link, settings);
    }

    pub(crate) fn deafen(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.deaf.start_silently(link, settings.end_quiet);
    }

    /// Nothing of what was before can still come.
    pub(crate) fn hear(&mut self) {
        self.deaf.has_run_out();
    }

    fn is_deaf(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let is_deaf = !self.deaf.is_over(link);
        if is_deaf {
            self.deafen(link, settings);
        }
        is_deaf
    }
}

/// Whether a byte may be the first % of a tape.
fn is_percent(settings: &Settings, byte: u8) -> bool {
    let is = |code| decode(settings, code, byte) == Decoded::Character(b'%');
    (settings.receive_code != ReceiveCode::Eia && is(Code::Iso))
        || (settings.receive_code != ReceiveCode::Iso && is(Code::Eia))
}
