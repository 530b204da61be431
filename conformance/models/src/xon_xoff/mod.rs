//! XON/XOFF in both directions, from `docs/protocols/xon-xoff.md`.

mod blame;
mod program;
mod propose;
mod receiver;
mod rules;
mod sender;
mod speaker;
mod values;
mod wire;

use crate::demands::Demands;
use crate::dice::Dice;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Profile, Proposal};
use blame::BLAME;
use receiver::Receiver;
use rules::Rules;
use sender::Sender;
use softplug_abi::{LineErrorKind, LineParameters, Micros};
use std::cell::Cell;
use wire::Wire;

/// The profile `xon-xoff`.
pub(crate) const PROFILE: Profile = Profile {
    name: "xon-xoff",
    clauses: values::CLAUSES,
    values: values::VALUES,
    presets: &[],
    lines: values::LINES,
    rooms: &[],
    modem_lines: values::MODEM_LINES,
    special: values::SPECIAL,
    start,
};

fn start(conditions: &Conditions) -> Option<Box<dyn Model>> {
    let rules = Rules::new(&conditions.settings)?;
    Some(Box::new(XonXoff {
        rules,
        line: conditions.line,
        wire: Wire::new(conditions.depth),
        sender: Sender::default(),
        receiver: Receiver::new(conditions.delivery_room),
        demands: Demands::default(),
        is_open: false,
        is_down: false,
        jobs: 0,
        began: Micros::ZERO,
        plan: Cell::new(propose::Plan::new(conditions)),
    }))
}

/// The profile's state: a sender and a receiver that share a line.
#[derive(Clone, Debug)]
struct XonXoff {
    rules: Rules,
    line: LineParameters,
    wire: Wire,
    sender: Sender,
    receiver: Receiver,
    demands: Demands,
    is_open: bool,
    is_down: bool,
    /// The last job's id.
    jobs: u32,
    /// When our last character began.
    began: Micros,
    /// What its partner and host have in mind.
    plan: Cell<propose::Plan>,
}

impl Model for XonXoff {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        let Self { rules, wire, sender, receiver, demands, .. } = self;
        let is_ignored = rules.ignores_echo && sender.job().is_some();
        match input {
            LineInput::Bytes(bytes) => {
                let control = |byte: &u8| rules.control(*byte);
                bytes.iter().filter_map(control).for_each(|control| sender.heed(at, control));
                let data = |byte: &u8| control(byte).is_none() && !is_ignored;
                let data: Vec<u8> = bytes.iter().copied().filter(data).collect();
                receiver.receive(at, &data, rules, wire);
            }
            LineInput::Damaged { .. } if is_ignored => {}
            LineInput::Damaged { kind, byte: Some(byte), span: 0 } => {
                receiver.receive_damaged(at, *byte, rules, wire);
                if *kind == LineErrorKind::Overrun {
                    receiver.overrun(at, rules, wire);
                }
            }
            LineInput::Damaged { kind: LineErrorKind::Overrun, .. } => {
                receiver.overrun(at, rules, wire);
            }
            // A break, or one that was given already.
            LineInput::Damaged { .. } => receiver.receive_break(at),
            LineInput::ModemLines(..) => {}
            LineInput::Down(_) => {
                self.is_down = true;
                sender.link_down(rules, wire, demands);
                receiver.link_down(rules, demands);
                wire.port.set_gone(true);
            }
            LineInput::Up => {
                self.is_down = false;
                wire.port.set_gone(false);
                receiver.link_up(rules, wire);
            }
        }
        sender.update(wire);
    }

    fn left(&mut self, _at: Micros, _byte: u8) {
        let number = self.wire.character_left();
        self.receiver.speaker.left(number, &self.rules, &mut self.wire);
        self.sender.left(number, &mut self.demands);
        self.sender.update(&mut self.wire);
    }

    fn due(&mut self, at: Micros) {
        if !self.is_open {
            return;
        }
        let Self { rules, wire, sender, receiver, demands, .. } = self;
        sender.due(at, rules, wire, demands);
        receiver.due(at, rules, wire, demands);
        sender.update(wire);
    }

    fn host(&mut self, at: Micros, request: &HostRequest) {
        let Self { rules, wire, sender, receiver, demands, .. } = self;
        match request {
            HostRequest::Open => {
                (self.is_open, self.is_down) = (true, false);
                wire.port.set_gone(false);
                receiver.open(rules, wire);
            }
            HostRequest::Close => {
                self.is_open = false;
                sender.close(demands);
                receiver.close(rules, demands);
                wire.port.clear();
            }
            HostRequest::Job { id, data, .. } => {
                self.jobs = *id;
                sender.begin(at, *id, data, rules, wire, demands);
            }
            HostRequest::Pause(id) => sender.pause(*id, true),
            HostRequest::Resume(id) => sender.pause(*id, false),
            HostRequest::Abort(0) => receiver.abort(rules, wire, demands),
            HostRequest::Abort(id) => sender.abort(*id, rules, wire, demands),
            HostRequest::ForceResume => sender.force_resume(),
            HostRequest::Keep => receiver.room.keep(),
            HostRequest::PutAway(bytes) => receiver.room.put_away(*bytes),
            HostRequest::PutAllAway => receiver.room.put_all_away(),
            HostRequest::Answer(..) => {}
        }
        if self.is_open {
            receiver.look_at_room(at, rules, wire);
        }
        sender.update(wire);
    }

    fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken> {
        let Effect::Byte(byte) = effect else { return self.demands.meet(effect, &BLAME) };
        self.began = at;
        self.wire.port.begins(*byte, self.clause_of(*byte))
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        self.demands.settled()?;
        self.wire.settled(self.clause_of_silence())?;
        self.sender.settled(&self.wire);
        Ok(())
    }

    fn next(&self) -> Option<Micros> {
        let deadlines = [self.sender.deadline(&self.rules), self.receiver.deadline(&self.rules)];
        deadlines.into_iter().flatten().min()
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        propose::next(self, now, dice)
    }

    fn is_filled(&self) -> bool {
        self.plan.get() != propose::Plan::Usual
    }
}

impl XonXoff {
    /// The clause that a character breaks which had not to leave now.
    fn clause_of(&self, byte: u8) -> &'static str {
        let Self { rules, sender, receiver, .. } = self;
        let is_stopped = receiver.speaker.is_stopped();
        match () {
            () if byte == rules.xoff && is_stopped => "xon-xoff.rx.repeat-xoff",
            () if [rules.xon, rules.xoff].contains(&byte) && !rules.speak => "xon-xoff.rx.speak",
            () if byte == rules.xoff => "xon-xoff.rx.low-mark",
            () if byte == rules.xon && is_stopped => "xon-xoff.rx.high-mark",
            () if byte == rules.xon => "xon-xoff.rx.repeat-xon",
            () if sender.is_held() => "xon-xoff.tx.obey-xoff",
            () if sender.is_waiting() => "xon-xoff.tx.wait-for-xon",
            () if sender.is_paused() => "xon-xoff.tx.pause",
            () if sender.job().is_none() => "xon-xoff.tx.abort-clean",
            () if rules.transparent => "xon-xoff.tx.transparent",
            () if rules.send_line_end.is_some() => "xon-xoff.tx.line-ends",
            () if !rules.send_drop.is_empty() => "xon-xoff.tx.drop",
            () => "xon-xoff.tx.feed-strings",
        }
    }

    /// The clause that silence breaks where a character had to leave.
    fn clause_of_silence(&self) -> &'static str {
        match () {
            () if self.wire.port.urgent() == 0 && self.sender.job().is_none() => {
                "xon-xoff.tx.abort-send"
            }
            () if self.wire.port.urgent() == 0 => "xon-xoff.tx.resume-on-xon",
            () if self.receiver.speaker.is_stopped() => "xon-xoff.rx.low-mark",
            () => "xon-xoff.rx.high-mark",
        }
    }
}
