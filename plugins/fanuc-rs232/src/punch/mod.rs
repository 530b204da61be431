//! Capture of what the control puts out (PUNCH): from DC2 to DC4, or to the
//! second % and silence.

mod flow;
#[cfg(test)]
mod tests;
mod text;
mod title;

pub(crate) use title::Title;

use crate::code::{Code, Control, Decoded, decode};
use crate::fields::Fields;
use crate::request::Requests;
use crate::short::Short;
use crate::state::State;
use crate::{CAPTURE, ReceiveCode, SendCode, Settings, set_timer};
use flow::Flow;
use softplug_plugin::{Context, Failure, LineErrorKind, MarkState, Micros};
use text::Text;

/// Mark on our answer to DC2: the feed counts its own from 1.
const ANSWER: u32 = u32::MAX;

/// How far a capture is.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
enum Stage {
    /// No capture.
    #[default]
    Idle,
    /// The code is not known yet; what came since what may be a % is kept.
    Unknown,
    /// Before the first %: nothing counts.
    Leader,
    /// Behind the first %.
    Program,
    /// Behind the second %: nothing counts.
    Closed,
}

#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Punch {
    stage: Stage,
    code: Code,
    early: Short,
    text: Text,
    pub(crate) flow: Flow,
    /// DC4 has come: only SYN or NAK may follow.
    ended: bool,
    ends_at: Option<Micros>,
    /// Until then, and for as long as something comes, a % begins nothing: it is
    /// an echo, or the rest of what was aborted.
    deaf_until: Option<Micros>,
    /// Our answer to DC2 has not left: there is one at a time.
    is_answering: bool,
    pub(crate) requests: Requests,
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
        if let Some(at) = self.ends_at {
            link.set_timer(CAPTURE, at);
        }
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
                let at = link.now() + Micros::from_millis(settings.after_dc4);
                set_timer(link, CAPTURE, &mut self.ends_at, Some(at));
            }
            Control::Syn => self.finish(link, settings, Some(Failure::PartnerReset)),
            Control::Nak => self.finish(link, settings, Some(Failure::PartnerAlarm)),
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
        self.text.start();
        if by_dc2 {
            self.answer_dc2(link, settings);
        }
    }

    fn answer_dc2(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if settings.answer_dc2 && !self.is_answering {
            self.is_answering = true;
            link.transmit_urgent_marked(ANSWER, &[0x11]);
        }
    }

    /// News of a mark that may be that on our answer.
    pub(crate) fn mark(&mut self, mark: u32, state: MarkState) {
        self.is_answering &= mark != ANSWER || state == MarkState::MaybeLeft;
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

    /// Without an EOB: EIA if every character is one of it.
    fn guess(&mut self, settings: &Settings) {
        let is_eia =
            |byte: &u8| matches!(decode(settings, Code::Eia, *byte), Decoded::Character(_));
        self.code = if self.early.as_slice().iter().all(is_eia) { Code::Eia } else { Code::Iso };
    }

    /// The code is known: what was kept is read.
    fn settle(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.stage = Stage::Leader;
        let early = core::mem::take(&mut self.early);
        for byte in early.as_slice() {
            self.read(link, settings, *byte);
        }
    }

    fn read(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        if self.code == Code::Iso && byte & 0x7F == b'\r' {
            self.text.carriage_return(settings);
            return;
        }
        let was_text = self.has_text();
        let damaged = match decode(settings, self.code, byte) {
            Decoded::Ignored => return,
            Decoded::Character(character) => {
                self.character(link, settings, character);
                return;
            }
            Decoded::Damaged(byte) | Decoded::Unknown(byte) => byte,
        };
        if self.code == Code::Iso {
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
                self.text.put(link, b'%');
            }
            Stage::Program if character == b'%' => {
                self.stage = Stage::Closed;
                self.text.close(link, settings);
            }
            Stage::Program => {
                self.text.character(link, settings, &mut self.requests, character);
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
        let was_text = self.has_text();
        if let Some(byte) = byte {
            self.byte(link, settings, byte);
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
        let is_timed = self.is_capturing() && !self.flow.held && span > 0;
        let at = is_timed.then(|| link.now() + Micros::from_millis(span));
        set_timer(link, CAPTURE, &mut self.ends_at, at);
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
        if self.stage == Stage::Unknown {
            self.guess(settings);
            self.settle(link, settings);
        }
        let lacks_end = self.stage != Stage::Closed;
        let failure = failure.or(lacks_end.then_some(Failure::NoEndMark));
        self.text.end(link, settings, &mut self.requests, failure);
        self.stage = Stage::Idle;
        self.ended = false;
        set_timer(link, CAPTURE, &mut self.ends_at, None);
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
        self.deaf_until = Some(link.now() + Micros::from_millis(settings.end_quiet));
    }

    fn is_deaf(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let is_deaf = self.deaf_until.is_some_and(|until| link.now() < until);
        if is_deaf {
            self.deafen(link, settings);
        }
        is_deaf
    }

    pub(crate) fn fields(&mut self, fields: &mut Fields<'_, '_>) {
        let stages = [Stage::Idle, Stage::Unknown, Stage::Leader, Stage::Program, Stage::Closed];
        self.stage = fields.choice(self.stage as u8, &stages);
        self.code = fields.choice(self.code as u8, &[Code::Iso, Code::Eia]);
        self.early.fields(fields);
        self.text.fields(fields);
        self.flow.fields(fields);
        fields.bool(&mut self.ended);
        fields.deadline(&mut self.ends_at);
        fields.deadline(&mut self.deaf_until);
        fields.bool(&mut self.is_answering);
        self.requests.fields(fields);
    }
}

/// Whether a byte may be the first % of a tape.
fn is_percent(settings: &Settings, byte: u8) -> bool {
    let is = |code| decode(settings, code, byte) == Decoded::Character(b'%');
    (settings.receive_code != ReceiveCode::Eia && is(Code::Iso))
        || (settings.receive_code != ReceiveCode::Iso && is(Code::Eia))
}
