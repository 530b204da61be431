//! The punch: captures, from DC2 to DC4 and what follows.

mod characters;
mod raw;

use super::code::{decoded, has_wrong_parity};
use super::delivery::Delivery;
use super::requests::Requests;
use super::rules::{Code, Rules};
use crate::demands::Demands;
use crate::model::Effect;
use crate::room::Room;
use raw::{Raw, guess, may_be_first};
use softplug_abi::{Failure, Micros};

/// *Idle*, or a capture.
#[derive(Clone, Debug, Default)]
pub(super) struct Punch {
    capture: Option<Capture>,
    /// Deliveries that have ended since the link was opened.
    deliveries: u32,
    /// Since when the line is silent, where what comes is none without DC2: after a
    /// job, or a capture that the host gave up.
    pub(super) deaf: Option<Micros>,
}

/// A capture.
#[derive(Clone, Debug)]
struct Capture {
    stage: Stage,
    /// `None`: not known yet.
    code: Option<Code>,
    /// Since when it is silent.
    silent: Micros,
    line: Line,
    delivery: Option<Delivery>,
    /// The delivery has its closing `%`.
    is_closed: bool,
    /// An EOB has come behind it.
    is_behind_eob: bool,
    /// An EOB has come behind the first `%`.
    has_eob: bool,
    /// DC4 came before the code was known.
    kept: Vec<Raw>,
}

#[derive(Clone, Debug)]
enum Stage {
    /// No `%` yet.
    Punching,
    /// A first `%`, and no EOB that tells the code: characters as they came, and
    /// whether they were damaged.
    Unknown(Vec<Raw>),
    Receiving,
    /// The closing `%` has come.
    Ended,
    /// DC4 has come; SYN and NAK are awaited until then.
    Leaving(Micros),
}

/// Where the line ends of a capture are. A CR at the end of a capture that is cut is
/// none; the page does not say so.
#[derive(Copy, Clone, Debug, Default)]
struct Line {
    /// CRs that may still come that belong to the LF before them.
    of_lf: u8,
    is_behind_cr: bool,
}

/// What a punch has to do with.
pub(super) struct With<'a> {
    pub(super) rules: &'a Rules,
    pub(super) room: &'a mut Room,
    pub(super) requests: &'a mut Requests,
    pub(super) demands: &'a mut Demands,
}

impl Punch {
    pub(super) fn is_idle(&self) -> bool {
        self.capture.is_none()
    }

    pub(super) fn is_punching(&self) -> bool {
        self.stage().is_some_and(|stage| matches!(stage, Stage::Punching))
    }

    pub(super) fn is_receiving(&self) -> bool {
        self.stage().is_some_and(|stage| matches!(stage, Stage::Unknown(_) | Stage::Receiving))
    }

    pub(super) fn is_ended(&self) -> bool {
        self.stage().is_some_and(|stage| matches!(stage, Stage::Ended))
    }

    pub(super) fn is_leaving(&self) -> bool {
        self.stage().is_some_and(|stage| matches!(stage, Stage::Leaving(_)))
    }

    fn stage(&self) -> Option<&Stage> {
        self.capture.as_ref().map(|capture| &capture.stage)
    }

    /// The code of the capture.
    pub(super) fn code(&self) -> Option<Code> {
        self.capture.as_ref().and_then(|capture| capture.code)
    }

    /// DC2 begins a capture.
    pub(super) fn begin(&mut self, at: Micros, rules: &Rules) {
        self.capture = Some(Capture {
            stage: Stage::Punching,
            code: rules.receive_code,
            silent: at,
            line: Line::default(),
            delivery: None,
            is_closed: false,
            is_behind_eob: false,
            has_eob: false,
            kept: Vec::new(),
        });
    }

    /// With `need_dc2` off a first `%` begins one too.
    pub(super) fn begin_without_dc2(&mut self, at: Micros, byte: u8, with: &mut With<'_>) {
        let is_first = match with.rules.receive_code {
            Some(Code::Iso) => !has_wrong_parity(byte, with.rules) && byte & 0x7F == b'%',
            Some(Code::Eia) => decoded(byte, Code::Eia, with.rules) == Some(b'%'),
            None => may_be_first(byte, with.rules),
        };
        if is_first {
            self.begin(at, with.rules);
            self.whole(at, byte, with);
        }
    }

    /// Something came: silence begins anew.
    pub(super) fn was_heard(&mut self, at: Micros) {
        if let Some(capture) = &mut self.capture {
            capture.silent = at;
        }
    }

    /// A character that is no control code.
    pub(super) fn whole(&mut self, at: Micros, byte: u8, with: &mut With<'_>) {
        self.take(at, Raw::Whole(byte), with);
    }

    /// A character that the port found damaged.
    pub(super) fn damaged(&mut self, at: Micros, byte: u8, with: &mut With<'_>) {
        self.take(at, Raw::Damaged(byte), with);
    }

    /// A break counts as a damaged character.
    pub(super) fn has_break(&mut self, at: Micros, with: &mut With<'_>) {
        self.take(at, Raw::Break, with);
    }

    /// Characters were lost in the port.
    pub(super) fn overrun(&mut self, at: Micros, with: &mut With<'_>) {
        self.take(at, Raw::Overrun, with);
    }

    fn delivery(&self) -> Option<&Delivery> {
        self.capture.as_ref()?.delivery.as_ref()
    }

    /// DC4.
    pub(super) fn dc4(&mut self, at: Micros, with: &mut With<'_>) {
        self.was_heard(at);
        match self.stage() {
            // Of a capture without a `%` the page does not say so.
            Some(Stage::Punching | Stage::Unknown(_) | Stage::Receiving | Stage::Ended) => {
                let Some(capture) = &mut self.capture else { return };
                let leaving = Stage::Leaving(at + with.rules.after_dc4);
                if let Stage::Unknown(raws) = std::mem::replace(&mut capture.stage, leaving) {
                    capture.kept = raws;
                }
            }
            Some(Stage::Leaving(_)) | None => {}
        }
    }

    /// When something is due. Silence counts only while the control may send; the
    /// page does not say so.
    pub(super) fn deadline(&self, rules: &Rules, is_stopped: bool) -> Option<Micros> {
        let capture = self.capture.as_ref()?;
        match capture.stage {
            Stage::Leaving(until) => Some(until),
            _ if is_stopped => None,
            Stage::Ended => Some(capture.silent + rules.end_quiet),
            Stage::Punching | Stage::Unknown(_) | Stage::Receiving => {
                Some(capture.silent + rules.quiet_time?)
            }
        }
    }

    pub(super) fn due(&mut self, at: Micros, is_stopped: bool, with: &mut With<'_>) {
        if self.deadline(with.rules, is_stopped).is_none_or(|deadline| deadline > at) {
            return;
        }
        let clause = match self.stage() {
            Some(Stage::Leaving(_)) => "fanuc-rs232.punch.after-dc4",
            Some(Stage::Ended) => "fanuc-rs232.punch.second-percent",
            _ => "fanuc-rs232.punch.quiet-time",
        };
        self.end(at, None, clause, with);
    }

    /// The capture ends; with a reason, or by itself.
    pub(super) fn end(
        &mut self,
        at: Micros,
        failure: Option<Failure>,
        clause: &'static str,
        with: &mut With<'_>,
    ) {
        if let Some(capture) = &mut self.capture
            && !capture.kept.is_empty()
        {
            capture.stage = Stage::Unknown(std::mem::take(&mut capture.kept));
        }
        if let Some(Stage::Unknown(raws)) = self.stage() {
            // No EOB tells the code, and the page does not say what does.
            let code = guess(raws, with.rules);
            self.decode(at, code, with);
        }
        self.finish(at, failure, clause, with);
        self.capture = None;
    }

    /// The link is closed: it interrupts a delivery itself.
    pub(super) fn close(&mut self, with: &mut With<'_>) {
        let capture = self.capture.as_mut().filter(|capture| {
            !matches!(capture.stage, Stage::Unknown(_)) && capture.kept.is_empty()
        });
        if capture.is_none() {
            // Nothing of it was delivered yet.
            self.capture = None;
        }
        let capture = self.capture.as_mut();
        if let Some(delivery) = capture.and_then(|capture| capture.delivery.as_mut()) {
            delivery.is_cut();
        }
        self.end(Micros::ZERO, Some(Failure::Interrupted), "fanuc-rs232.link.close", with);
        *self = Self::default();
    }

    /// A delivery ends, if there is one.
    fn finish(
        &mut self,
        _at: Micros,
        failure: Option<Failure>,
        clause: &'static str,
        with: &mut With<'_>,
    ) {
        let Some(capture) = &mut self.capture else { return };
        let Some(delivery) = capture.delivery.take() else { return };
        let is_closed = std::mem::take(&mut capture.is_closed);
        let lost = delivery.lost.then_some(Failure::Overrun);
        let no_end_mark = (!is_closed).then_some(Failure::NoEndMark);
        let failure = match failure {
            // The link itself says so.
            Some(Failure::Interrupted) => failure,
            _ => lost.or(delivery.wrong).or(failure).or(no_end_mark),
        };
        self.deliveries += 1;
        let (bytes, name) = (delivery.bytes.clone(), delivery.name());
        let delivered = Effect::Delivered { id: self.deliveries, bytes, name, failure, status: 0 };
        with.demands.add(delivered, clause);
        if failure.is_none() {
            with.requests.ask(&delivery, with.rules, with.demands);
        }
    }
}
