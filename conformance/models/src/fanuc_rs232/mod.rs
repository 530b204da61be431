//! The control's reader and punch, from `docs/protocols/fanuc-rs232.md`: all but the
//! packets of a remote buffer.

mod blame;
mod clauses;
mod code;
mod control;
mod delivery;
mod feed;
mod file;
mod flow;
mod hear;
mod propose;
mod punch;
mod requests;
mod rules;
mod select;
mod tape;
mod values;
mod wire;

use crate::demands::Demands;
use crate::dice::Dice;
use crate::fanuc_rs232_remote;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Profile, Proposal};
use crate::room::Room;
use blame::BLAME;
use feed::Feed;
use flow::Flow;
use propose::Course;
use punch::Punch;
use requests::Requests;
use rules::Rules;
use select::Start;
use softplug_abi::{Failure, LineErrorKind, LineParameters, Micros, ModemLines};
use std::cell::Cell;
pub(crate) use values::SPECIAL;
use wire::Wire;

/// The profile `fanuc-rs232`.
pub(crate) const PROFILE: Profile = Profile {
    name: "fanuc-rs232",
    clauses: values::CLAUSES,
    values: values::VALUES,
    presets: &[],
    lines: values::LINES,
    rooms: &[],
    modem_lines: values::MODEM_LINES,
    special: SPECIAL,
    start,
};

/// A remote buffer speaks in packets; its model is apart.
fn start(conditions: &Conditions) -> Option<Box<dyn Model>> {
    fanuc_rs232_remote::start(conditions).or_else(|| reader(conditions))
}

fn reader(conditions: &Conditions) -> Option<Box<dyn Model>> {
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
        course: Cell::new(Course::new(conditions)),
    }))
}

/// The profile's state: a reader and a punch that share a line.
#[derive(Clone, Debug)]
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
    /// What the session is about.
    course: Cell<Option<Course>>,
}

impl Model for Fanuc {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        match input {
            LineInput::Bytes(bytes) => bytes.iter().for_each(|byte| self.hear(at, *byte)),
            LineInput::Damaged { byte: Some(byte), span: 0, .. } => {
                let (punch, mut with) = self.punch();
                punch.damaged(at, *byte, &mut with);
            }
            LineInput::Damaged { kind: LineErrorKind::Overrun, .. } => {
                let (punch, mut with) = self.punch();
                punch.overrun(at, &mut with);
            }
            // A break, or one that was given already.
            LineInput::Damaged { .. } => {
                let (punch, mut with) = self.punch();
                punch.has_break(at, &mut with);
            }
            LineInput::ModemLines(named, on) => self.modem_lines(at, *named, *on),
            LineInput::Down(_) => {
                self.is_down = true;
                self.feed.link_down(&mut self.wire, &mut self.demands);
                let (punch, mut with) = self.punch();
                punch.end(at, Some(Failure::LinkDown), "fanuc-rs232.link.down", &mut with);
                self.wire.port.set_gone(true);
            }
            LineInput::Up => {
                self.is_down = false;
                self.wire.port.set_gone(false);
                // Nothing is left of what was before: also not a stop.
                self.feed.has_ended = false;
                self.punch.deaf = None;
                self.flow.go(&self.rules, &mut self.wire, &mut self.demands);
            }
        }
        self.stop_if_short();
        self.feed.update(&mut self.wire);
    }

    fn left(&mut self, at: Micros, _byte: u8) {
        let (number, is_code) = self.wire.character_left();
        if is_code {
            self.flow.left(number, &mut self.wire);
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
                self.flow.close();
            }
            HostRequest::Job { id, data, fields, .. } => {
                self.jobs = *id;
                feed.begin(at, *id, &Start::new(fields), data, rules, wire, demands);
                self.end_output();
            }
            HostRequest::Pause(id) => feed.pause(*id, true),
            HostRequest::Resume(id) => feed.pause(*id, false),
            HostRequest::Abort(0) => self.abort_capture(at),
            HostRequest::Abort(id) => feed.abort(*id, wire, demands),
            HostRequest::ForceResume => {
                // As the DC1 that was lost it ends a capture, too.
                if feed.is_waiting() || feed.is_held() {
                    let (punch, mut with) = self.punch();
                    punch.end(at, None, "fanuc-rs232.punch.while-waiting", &mut with);
                }
                self.feed.force_resume(&mut self.wire);
                self.end_output();
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
        let Effect::Byte(byte) = effect else { return self.demands.meet(effect, &BLAME) };
        self.began = at;
        self.wire.port.begins(*byte, self.clause_of(*byte))
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        self.demands.settled()?;
        self.wire.settled(self.clause_of_silence())
    }

    fn next(&self) -> Option<Micros> {
        let capture = self.punch.deadline(&self.rules, self.flow.is_stopped());
        [self.feed.deadline(&self.rules), capture].into_iter().flatten().min()
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        propose::next(self, now, dice)
    }

    fn is_filled(&self) -> bool {
        self.course.get().is_none_or(|course| course != Course::Any)
    }
}
