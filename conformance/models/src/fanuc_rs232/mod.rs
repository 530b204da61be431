//! The control's reader and punch, from `docs/protocols/fanuc-rs232.md`: all but the
//! packets of a remote buffer.

mod code;
mod control;
mod delivery;
mod demands;
mod feed;
mod file;
mod flow;
mod propose;
mod punch;
mod requests;
mod room;
mod rules;
mod select;
mod tape;
mod text;
mod values;
mod wire;

use crate::dice::Dice;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Profile, Proposal};
use control::{Context, Control};
use demands::Demands;
use feed::Feed;
use flow::Flow;
use punch::{Punch, With};
use requests::Requests;
use room::Room;
use rules::{Code, Rules};
use select::Start;
use softplug_abi::{Failure, LineErrorKind, LineParameters, Micros, ModemLines};
use wire::Wire;

/// The profile `fanuc-rs232`.
pub(crate) const PROFILE: Profile = Profile {
    name: "fanuc-rs232",
    clauses: values::CLAUSES,
    values: values::VALUES,
    lines: values::LINES,
    modem_lines: values::MODEM_LINES,
    special: values::SPECIAL,
    start,
};

/// `None` also where the settings select the packets of a remote buffer.
fn start(conditions: &Conditions) -> Option<Box<dyn Model>> {
    let rules = Rules::new(&conditions.settings)?;
    let has_dsr = conditions.modem_lines.map(|(known, on)| (known.contains(ModemLines::DSR), on));
    Some(Box::new(Fanuc {
        rules,
        line: conditions.line,
        wire: Wire::new(conditions.depth),
        feed: Feed::default(),
        punch: Punch::default(),
        flow: Flow::default(),
        room: Room::new(conditions.delivery_room),
        requests: Requests::default(),
        demands: Demands::default(),
        dsr: has_dsr.and_then(|(has, on)| has.then_some(on.contains(ModemLines::DSR))),
        is_open: false,
        is_down: false,
        jobs: 0,
        began: Micros::ZERO,
        has_given_up: false,
    }))
}

/// The profile's state: a reader and a punch that share a line.
#[derive(Debug)]
struct Fanuc {
    rules: Rules,
    line: LineParameters,
    wire: Wire,
    feed: Feed,
    punch: Punch,
    flow: Flow,
    room: Room,
    requests: Requests,
    demands: Demands,
    /// Whether DSR is on; `None`: the port has none.
    dsr: Option<bool>,
    is_open: bool,
    is_down: bool,
    /// The last job's id.
    jobs: u32,
    /// When our last character began.
    began: Micros,
    /// Plug-in differs: a transfer that the host starts or lets go on while a capture is
    /// under way obeys no DC3 until that has ended, and a DC2 in it breaks the host's
    /// pause. What comes of that is not judged.
    has_given_up: bool,
}

impl Model for Fanuc {
    fn line(&mut self, at: Micros, input: &LineInput) {
        match input {
            LineInput::Bytes(bytes) => bytes.iter().for_each(|byte| self.hear(at, *byte)),
            LineInput::Damaged { byte: Some(byte), .. } => {
                let (punch, mut with) = self.punch();
                punch.damaged(at, *byte, &mut with);
            }
            LineInput::Damaged { kind: LineErrorKind::Break, .. } => {
                let (punch, mut with) = self.punch();
                punch.has_break(at, &mut with);
            }
            LineInput::Damaged { .. } => {
                let (punch, mut with) = self.punch();
                punch.overrun(at, &mut with);
            }
            LineInput::ModemLines(named, on) => self.modem_lines(at, *named, *on),
            LineInput::Down(_) => {
                self.is_down = true;
                self.feed.link_down(at, &mut self.wire, &mut self.demands);
                let (punch, mut with) = self.punch();
                punch.end(at, Some(Failure::LinkDown), "fanuc-rs232.link.down", &mut with);
                // Plug-in differs: by the page nothing of a job is left when the port is back.
                self.look_at_job(at);
                self.wire.port.set_gone(true);
            }
            LineInput::Up => {
                self.is_down = false;
                self.wire.port.set_gone(false);
                // Nothing is left of what was before: also not a stop.
                self.flow.go(&self.rules, &mut self.wire, &mut self.demands);
            }
        }
        self.stop_if_short();
        self.feed.update(&mut self.wire);
    }

    fn left(&mut self, at: Micros, _byte: u8) {
        let (number, is_code) = self.wire.character_left();
        if is_code {
            self.flow.left(number);
        } else {
            self.feed.left(at, number, &self.rules, &mut self.demands);
            self.look_at_job(at);
        }
    }

    fn due(&mut self, at: Micros) {
        if !self.is_open {
            return;
        }
        self.feed.due(at, &self.rules, &mut self.wire, &mut self.demands);
        self.look_at_job(at);
        let is_stopped = self.flow.is_stopped();
        let (punch, mut with) = self.punch();
        punch.due(at, is_stopped, &mut with);
        self.look_at_room(at);
        self.feed.update(&mut self.wire);
    }

    fn host(&mut self, at: Micros, request: &HostRequest) {
        let Self { rules, wire, feed, demands, .. } = self;
        match request {
            HostRequest::Open => {
                (self.is_open, self.is_down) = (true, false);
                wire.port.set_gone(false);
                self.room.open();
                self.flow.open(self.room.known());
            }
            HostRequest::Close => {
                self.is_open = false;
                feed.close(demands);
                wire.clear();
                let (punch, mut with) = self.punch();
                punch.close(&mut with);
                self.requests.close();
            }
            HostRequest::Job { id, data, fields, .. } => {
                self.jobs = *id;
                let was_transfer = feed.is_transfer();
                feed.begin(at, *id, &Start::new(fields), data, rules, wire, demands);
                self.has_given_up |= !was_transfer && feed.is_transfer() && !self.punch.is_idle();
            }
            HostRequest::Pause(id) => feed.pause(*id, true),
            HostRequest::Resume(id) => feed.pause(*id, false),
            HostRequest::Abort(0) => self.abort_capture(at),
            HostRequest::Abort(id) => feed.abort(at, *id, wire, demands),
            HostRequest::ForceResume => {
                let is_wanted = feed.is_waiting() || feed.is_held();
                feed.force_resume(at, wire);
                self.has_given_up |= is_wanted && !self.punch.is_idle();
            }
            HostRequest::Keep => self.room.keep(),
            HostRequest::PutAway(bytes) => self.room.put_away(*bytes),
            HostRequest::PutAllAway => self.room.put_all_away(),
            HostRequest::Answer(id, _) => self.requests.answered(*id),
        }
        if self.is_open {
            self.look_at_job(at);
            self.look_at_room(at);
        }
        self.feed.update(&mut self.wire);
    }

    fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken> {
        if self.has_given_up {
            return Ok(());
        }
        let Effect::Byte(byte) = effect else { return self.demands.meet(effect) };
        self.began = at;
        self.wire.port.begins(*byte, self.clause_of(*byte))
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        if self.has_given_up {
            return Ok(());
        }
        self.demands.settled()?;
        self.wire.settled(self.clause_of_silence())
    }

    fn next(&self) -> Option<Micros> {
        if self.has_given_up {
            return None;
        }
        let capture = self.punch.deadline(&self.rules, self.flow.is_stopped());
        [self.feed.deadline(&self.rules), capture].into_iter().flatten().min()
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        propose::next(self, now, dice)
    }
}

impl Fanuc {
    fn punch(&mut self) -> (&mut Punch, With<'_>) {
        let Self { rules, punch, room, requests, demands, .. } = self;
        (punch, With { rules, room, requests, demands })
    }

    /// Where characters stand that come now.
    fn context(&self) -> Context {
        if !self.punch.is_idle() {
            return Context::of(self.punch.code());
        }
        // Outside a capture the code is the one that is sent; the page does not say so.
        match self.rules.code {
            Code::Iso => Context::Iso,
            Code::Eia if self.rules.plain_codes && self.feed.is_transfer() => Context::PlainEia,
            Code::Eia => Context::Eia,
        }
    }

    /// A character that came whole.
    fn hear(&mut self, at: Micros, byte: u8) {
        let control = self.context().control(byte, &self.rules);
        let was_idle = self.punch.is_idle();
        self.punch.was_heard(at);
        match control {
            Some(Control::Dc1) => self.dc1(at),
            Some(Control::Dc2) => self.dc2(at),
            // Plug-in differs: in a capture it does not take a remembered DC1 back.
            Some(Control::Dc3) if !self.punch.is_idle() => {}
            Some(Control::Dc3) => self.feed.dc3(at, &mut self.wire, &mut self.demands),
            Some(Control::Dc4) => {
                let (punch, mut with) = self.punch();
                punch.dc4(at, &mut with);
            }
            Some(Control::Syn) => {
                self.partner_ends(at, Failure::PartnerReset, "fanuc-rs232.punch.reset");
            }
            Some(Control::Nak) => {
                self.partner_ends(at, Failure::PartnerAlarm, "fanuc-rs232.punch.alarm");
            }
            None if !self.punch.is_idle() => {
                let (punch, mut with) = self.punch();
                punch.whole(at, byte, &mut with);
            }
            // In a transfer a `%` can be one of ours that comes back, also while it is held.
            None if !self.rules.need_dc2 && !self.feed.is_transfer() && !self.is_deaf(at) => {
                let (punch, mut with) = self.punch();
                punch.begin_without_dc2(at, byte, &mut with);
            }
            None => {}
        }
        if was_idle && control.is_none() {
            self.hear_silence(at);
        }
        self.look_at_job(at);
    }

    /// Our own characters can come back behind a job's end, and those of a capture that
    /// was given up still come: until the line was silent, no `%` begins a capture. The
    /// page does not say so.
    ///
    /// Plug-in differs: it is so behind a job's beginning, too.
    fn is_deaf(&self, at: Micros) -> bool {
        self.punch.deaf.is_some_and(|since| since + self.rules.end_quiet > at)
    }

    /// A character breaks that silence.
    fn hear_silence(&mut self, at: Micros) {
        self.punch.deaf = self.is_deaf(at).then_some(at);
    }

    /// The control is stopped where room is short.
    fn stop_if_short(&mut self) {
        if !self.punch.is_idle() {
            let (room, code) = (self.room.known(), self.punch.code());
            self.flow.look(room, code, &self.rules, &mut self.wire, &mut self.demands);
        }
    }

    fn dc1(&mut self, at: Micros) {
        let is_wanted = self.feed.is_waiting() || self.feed.is_held();
        let ends = is_wanted || self.punch.is_leaving();
        if !self.punch.is_idle() && !ends {
            return;
        }
        let (punch, mut with) = self.punch();
        punch.end(at, None, "fanuc-rs232.punch.while-waiting", &mut with);
        self.feed.dc1(at, &mut self.wire);
    }

    fn dc2(&mut self, at: Micros) {
        if self.punch.is_idle() && self.feed.is_reading(at) {
            return;
        }
        self.feed.take_dc1_back();
        // Behind the closing `%` it begins the next capture; the page does not say so.
        if self.punch.is_ended() || self.punch.is_leaving() {
            let (punch, mut with) = self.punch();
            punch.end(at, None, "fanuc-rs232.punch.after-dc4", &mut with);
        }
        if self.punch.is_idle() {
            self.punch.begin(at, &self.rules);
        }
        self.flow.dc2(self.room.known(), &self.rules, &mut self.wire);
    }

    /// SYN or NAK.
    fn partner_ends(&mut self, at: Micros, failure: Failure, clause: &'static str) {
        if self.punch.is_idle() {
            self.feed.take_dc1_back();
            self.feed.partner_ends(at, failure, &mut self.wire, &mut self.demands);
        } else {
            // Plug-in differs: by the page it ends a job that is held, too, and takes a
            // remembered DC1 back.
            let (punch, mut with) = self.punch();
            punch.end(at, Some(failure), clause, &mut with);
        }
    }

    fn modem_lines(&mut self, at: Micros, named: ModemLines, on: ModemLines) {
        if !named.contains(ModemLines::DSR) {
            return;
        }
        let Some(dsr) = &mut self.dsr else { return };
        let was_on = std::mem::replace(dsr, on.contains(ModemLines::DSR));
        if was_on && !*dsr && self.rules.watch_dsr {
            let failure = Failure::PartnerGone;
            // The page does not say that it takes a DC1 back.
            self.feed.take_dc1_back();
            self.feed.partner_ends(at, failure, &mut self.wire, &mut self.demands);
            let (punch, mut with) = self.punch();
            punch.end(at, Some(failure), "fanuc-rs232.punch.dsr", &mut with);
            self.look_at_job(at);
        }
    }

    fn abort_capture(&mut self, at: Micros) {
        if !self.punch.is_idle() {
            let (punch, mut with) = self.punch();
            punch.end(at, Some(Failure::Aborted), "fanuc-rs232.punch.abort", &mut with);
            self.punch.deaf = Some(at);
        }
        self.flow.go(&self.rules, &mut self.wire, &mut self.demands);
    }

    /// A job may have begun or ended.
    fn look_at_job(&mut self, at: Micros) {
        if std::mem::take(&mut self.feed.has_changed) {
            self.punch.deaf = Some(at);
        }
    }

    /// The host may have made room.
    fn look_at_room(&mut self, at: Micros) {
        if self.room.grows() {
            let room = self.room.known();
            let goes_on = self.flow.has_grown(room, &self.rules, &mut self.wire, &mut self.demands);
            if goes_on {
                self.punch.was_heard(at);
            }
        }
    }

    /// The clause that a character breaks which had not to leave now.
    fn clause_of(&self, byte: u8) -> &'static str {
        let Self { rules, feed, flow, .. } = self;
        match () {
            () if [0x13, 0x93].contains(&byte) && feed.job().is_none() => "fanuc-rs232.punch.flow",
            () if byte == 0x11 && feed.job().is_none() && flow.is_stopped() => {
                "fanuc-rs232.punch.flow"
            }
            () if byte == 0x11 && feed.job().is_none() => "fanuc-rs232.punch.answer-dc2",
            () if feed.job().is_none() => "fanuc-rs232.feed.abort-clean",
            () if feed.is_waiting() => "fanuc-rs232.feed.wait-dc1",
            () if feed.is_held() => "fanuc-rs232.feed.obey-dc3",
            () if feed.is_paused() => "fanuc-rs232.feed.pause",
            () if feed.is_ending() => "fanuc-rs232.feed.end-wait",
            () if rules.tv_pad => "fanuc-rs232.tape.tv-pad",
            () if rules.code == Code::Eia => "fanuc-rs232.code.eia",
            () => "fanuc-rs232.code.iso",
        }
    }

    /// The clause that silence breaks where a character had to leave.
    fn clause_of_silence(&self) -> &'static str {
        match () {
            () if self.wire.port.urgent() == 0 => "fanuc-rs232.feed.resume",
            () if self.rules.answer_dc2 => "fanuc-rs232.punch.answer-dc2",
            () => "fanuc-rs232.punch.flow",
        }
    }
}
