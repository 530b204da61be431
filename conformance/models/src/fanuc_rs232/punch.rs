//! The punch: captures, from DC2 to DC4 and what follows.

use super::code::{decoded, has_wrong_parity};
use super::delivery::Delivery;
use super::demands::Demands;
use super::requests::Requests;
use super::room::Room;
use super::rules::{Code, Parity, Rules};
use softplug_abi::{Failure, Micros};

/// So many characters are kept until the code is known.
const KEPT: usize = 128;

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
    /// An EOB has come.
    has_eob: bool,
    /// DC4 came before the code was known.
    kept: Vec<Raw>,
    /// What was wrong before the code was known.
    early: Vec<Failure>,
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

/// What came before the code was known.
#[derive(Copy, Clone, Debug)]
enum Raw {
    Whole(u8),
    Damaged(u8),
    Break,
    Overrun,
}

/// A character of a tape.
#[derive(Copy, Clone, Debug)]
struct Heard {
    byte: u8,
    is_damaged: bool,
    /// A NUL or DEL, which is dropped.
    is_blank: bool,
}

/// Where the line ends of a capture are. A CR at the end of a capture that is cut is
/// none; the page does not say so.
#[derive(Copy, Clone, Debug, Default)]
struct Line {
    has_lf: bool,
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
            // Plug-in differs: where the code is set a NUL is a damaged character also before
            // the first EOB.
            has_eob: rules.receive_code == Some(Code::Eia),
            kept: Vec::new(),
            early: Vec::new(),
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

    fn take(&mut self, at: Micros, raw: Raw, with: &mut With<'_>) {
        self.was_heard(at);
        let Some(capture) = &mut self.capture else { return };
        match (&mut capture.stage, capture.code) {
            (Stage::Punching, None) => {
                if let Raw::Whole(byte) | Raw::Damaged(byte) = raw
                    && may_be_first(byte, with.rules)
                {
                    capture.stage = Stage::Unknown(vec![raw]);
                }
            }
            (Stage::Unknown(raws), _) => {
                raws.push(raw);
                let told = match raw {
                    Raw::Whole(byte) | Raw::Damaged(byte) => told(byte),
                    Raw::Break | Raw::Overrun => None,
                };
                // Plug-in differs: after so many characters it does not wait for an EOB.
                let guessed = (raws.len() >= KEPT).then(|| guess(raws, with.rules));
                if let Some(code) = told.or(guessed) {
                    self.decode(at, code, with);
                }
            }
            (_, Some(code)) => self.put(at, raw, code, with),
            (_, None) => {}
        }
    }

    /// The code is known: what was kept is decoded.
    fn decode(&mut self, at: Micros, code: Code, with: &mut With<'_>) {
        let Some(capture) = &mut self.capture else { return };
        if let Stage::Unknown(raws) = std::mem::replace(&mut capture.stage, Stage::Punching) {
            capture.code = Some(code);
            // Plug-in differs: by the page it is noise before the first `%` of that code,
            // and nothing behind the closing one.
            let early = |raw: &Raw| match raw {
                Raw::Whole(_) => None,
                Raw::Damaged(_) | Raw::Break => Some(Failure::LineError),
                Raw::Overrun => Some(Failure::Overrun),
            };
            capture.early = raws.iter().filter_map(early).collect();
            for raw in raws {
                if let Raw::Whole(byte) | Raw::Damaged(byte) = raw {
                    self.put(at, Raw::Whole(byte), code, with);
                }
            }
        }
    }

    /// Something of a capture whose code is known.
    fn put(&mut self, at: Micros, raw: Raw, code: Code, with: &mut With<'_>) {
        // Where we check the parity, a NUL or DEL with a wrong one keeps its place. Of
        // others that are damaged the page does not say so.
        let is_blank = match raw {
            Raw::Whole(byte) | Raw::Damaged(byte) => is_blank(byte, code, with.rules),
            Raw::Break | Raw::Overrun => false,
        };
        let (byte, is_damaged) = match raw {
            Raw::Whole(byte) if code == Code::Iso => {
                // Plug-in differs: a CR with a wrong parity is no damaged character.
                let is_damaged = has_wrong_parity(byte, with.rules) && byte != b'\r';
                (byte & 0x7F, is_damaged)
            }
            Raw::Whole(byte) => match decoded(byte, code, with.rules) {
                Some(character) => (character, false),
                None => return self.unknown(byte, with),
            },
            Raw::Damaged(byte) => match decoded(byte, code, with.rules) {
                Some(character) => (character, true),
                None => return self.unknown(byte, with),
            },
            Raw::Break => return self.wrong(Failure::LineError, with.rules),
            Raw::Overrun => return self.wrong(Failure::Overrun, with.rules),
        };
        let Some(capture) = &mut self.capture else { return };
        match capture.stage {
            Stage::Punching if byte == b'%' => {
                capture.stage = Stage::Receiving;
                capture.delivery = Some(Delivery::new(with.rules, with.room));
                let damaged = is_damaged.then_some(Failure::LineError);
                let early = std::mem::take(&mut capture.early);
                for failure in early.into_iter().chain(damaged) {
                    self.wrong(failure, with.rules);
                }
            }
            Stage::Receiving => self.receive(at, Heard { byte, is_damaged, is_blank }, code, with),
            Stage::Ended if !is_damaged => self.behind(at, byte, with),
            Stage::Punching | Stage::Unknown(_) | Stage::Ended | Stage::Leaving(_) => {}
        }
    }

    /// A character that EIA does not have: damaged. It is kept as it came; the page does
    /// not say so.
    fn unknown(&mut self, byte: u8, with: &mut With<'_>) {
        self.wrong(Failure::LineError, with.rules);
        if self.is_receiving()
            && let Some(capture) = &mut self.capture
            && let Some(delivery) = &mut capture.delivery
        {
            delivery.put(&[byte], with.room);
        }
    }

    fn wrong(&mut self, failure: Failure, rules: &Rules) {
        let Some(capture) = &mut self.capture else { return };
        let Stage::Receiving = capture.stage else { return };
        let Some(delivery) = &mut capture.delivery else { return };
        match failure {
            Failure::Overrun => delivery.lost = true,
            _ if rules.fails_on_line_error => delivery.fails(failure),
            _ => {}
        }
    }

    /// A character of a tape.
    fn receive(&mut self, at: Micros, heard: Heard, code: Code, with: &mut With<'_>) {
        let Heard { byte, is_damaged, is_blank } = heard;
        let Some(capture) = &mut self.capture else { return };
        if !is_blank && let Some(delivery) = &mut capture.delivery {
            // A CR waits for what follows: an LF is one line end with it.
            match (std::mem::take(&mut capture.line.is_behind_cr), byte) {
                // Plug-in differs: CRs that follow each other are one line end together.
                (true, b'\n' | b'\r') => delivery.carriage_return(with.rules),
                (true, _) => delivery.eob(with.rules, with.room),
                (false, _) => {}
            }
        }
        let splits = with.rules.splits_programs
            && self.delivery().is_some_and(|delivery| delivery.begins_another(byte));
        if splits {
            self.split(at, with);
        }
        let Some(capture) = &mut self.capture else { return };
        let Some(delivery) = &mut capture.delivery else { return };
        // In EIA a NUL has an even number of holes, as a damaged character has.
        let is_bad_nul = code == Code::Eia && byte == 0 && capture.has_eob;
        capture.has_eob |= byte == b'\n';
        let fails = (is_damaged || is_bad_nul) && with.rules.fails_on_line_error;
        match byte {
            _ if is_blank => {}
            b'%' => {
                capture.stage = Stage::Ended;
                (capture.is_closed, capture.is_behind_eob) = (true, false);
                delivery.close(with.rules, with.room);
            }
            b'\n' => {
                capture.line.has_lf = true;
                delivery.eob(with.rules, with.room);
            }
            // Plug-in differs: where an LF has come, a CR alone is no line end.
            b'\r' if code == Code::Iso && capture.line.has_lf => {
                delivery.carriage_return(with.rules)
            }
            b'\r' if code == Code::Iso => capture.line.is_behind_cr = true,
            byte => delivery.character(byte, with.rules, with.room),
        }
        // Of a damaged EOB behind an odd block the block counts; the page does not say so.
        if fails {
            delivery.fails(Failure::LineError);
        }
    }

    /// A whole character behind the closing `%`.
    fn behind(&mut self, at: Micros, byte: u8, with: &mut With<'_>) {
        let Some(capture) = &mut self.capture else { return };
        match byte {
            0 | 0x7F | b' ' | b'\t' => {}
            b'\n' | b'\r' => {
                // Plug-in differs: where an LF has come, a CR alone is no EOB.
                capture.is_behind_eob |= byte == b'\n' || !capture.line.has_lf;
                capture.has_eob = true;
            }
            byte => {
                let is_behind_eob = capture.is_behind_eob;
                let code = capture.code;
                self.finish(at, None, "fanuc-rs232.punch.after-end", with);
                let Some(capture) = &mut self.capture else { return };
                capture.stage = Stage::Receiving;
                let mut delivery = Delivery::new(with.rules, with.room);
                if byte == b'%' {
                    capture.delivery = Some(delivery);
                    return;
                }
                if is_behind_eob {
                    delivery.first_line_ends(with.rules, with.room);
                }
                capture.delivery = Some(delivery);
                let heard = Heard { byte, is_damaged: false, is_blank: false };
                self.receive(at, heard, code.unwrap_or(Code::Iso), with);
            }
        }
    }

    /// The next program of a tape begins.
    fn split(&mut self, at: Micros, with: &mut With<'_>) {
        let Some(capture) = &mut self.capture else { return };
        // Spaces before the O or `:` are of its block.
        let count = capture.delivery.as_ref().map_or(0, Delivery::count);
        if let Some(delivery) = &mut capture.delivery {
            delivery.close(with.rules, with.room);
        }
        (capture.is_closed, capture.is_behind_eob) = (true, false);
        self.finish(at, None, "fanuc-rs232.punch.programs", with);
        let Some(capture) = &mut self.capture else { return };
        let mut delivery = Delivery::new(with.rules, with.room);
        delivery.first_line_ends(with.rules, with.room);
        delivery.has_counted(count);
        capture.delivery = Some(delivery);
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
        with.demands.deliver(self.deliveries, &delivery, failure, clause);
        if failure.is_none() {
            with.requests.ask(&delivery, with.rules, with.demands);
        }
    }
}

/// Whether a character can be a first `%` while the code is not known.
fn may_be_first(byte: u8, rules: &Rules) -> bool {
    let is_iso = match rules.parity {
        Parity::Software => byte == 0xA5,
        Parity::Uart | Parity::None => byte & 0x7F == b'%',
    };
    is_iso || byte == 0x0B
}

fn is_blank(byte: u8, code: Code, rules: &Rules) -> bool {
    match (code, rules.parity) {
        (Code::Iso, Parity::Software) => [0x00, 0xFF].contains(&byte),
        (Code::Iso, Parity::Uart | Parity::None) => [0x00, 0x7F].contains(&(byte & 0x7F)),
        (Code::Eia, _) => [0x00, 0x7F].contains(&byte),
    }
}

/// What the first EOB tells. A CR is none of EIA.
fn told(byte: u8) -> Option<Code> {
    if byte == 0x80 {
        return Some(Code::Eia);
    }
    // A CR tells it, too, whatever its bit 7 is, and an LF with a bit 7 does not; the page
    // does not say so.
    (byte == b'\n' || byte & 0x7F == b'\r').then_some(Code::Iso)
}

/// Without an EOB: EIA, if all of it can be; the page does not say.
fn guess(raws: &[Raw], rules: &Rules) -> Code {
    let is_eia = |raw: &Raw| match raw {
        Raw::Whole(0x7F) | Raw::Damaged(0x7F) => false,
        Raw::Whole(byte) | Raw::Damaged(byte) => decoded(*byte, Code::Eia, rules).is_some(),
        Raw::Break | Raw::Overrun => true,
    };
    if raws.iter().all(is_eia) { Code::Eia } else { Code::Iso }
}
