//! The receiver: deliveries, and the marks at which the machine is stopped.

use super::rules::Rules;
use super::speaker::Speaker;
use super::wire::Wire;
use crate::demands::Demands;
use crate::line_ends::LineEnds;
use crate::model::Effect;
use crate::room::Room;
use softplug_abi::{Failure, Micros};

/// *Idle*, *receiving* or *stopped*.
#[derive(Clone, Debug)]
pub(super) struct Receiver {
    pub(super) room: Room,
    pub(super) speaker: Speaker,
    /// XOFF is sent below this room.
    pub(super) low_mark: u32,
    /// XON is sent above this room.
    pub(super) high_mark: u32,
    /// Deliveries that have ended since the link was opened.
    deliveries: u32,
    delivery: Option<Delivery>,
    /// An escape has come, and its byte not yet.
    is_escaped: bool,
}

/// The delivery under way.
#[derive(Clone, Debug)]
struct Delivery {
    bytes: Vec<u8>,
    /// Since when it is silent.
    silent: Micros,
    line_ends: LineEnds,
    /// What came since the last end mark.
    unmarked: Vec<u8>,
    end_marks: usize,
    /// Bytes found no room, or were lost in the port.
    lost: bool,
    /// A character was damaged, or a break came.
    damaged: bool,
}

impl Receiver {
    pub(super) fn new(room: u32) -> Self {
        Self {
            room: Room::new(room),
            speaker: Speaker::default(),
            low_mark: 0,
            high_mark: 0,
            deliveries: 0,
            delivery: None,
            is_escaped: false,
        }
    }

    /// Deliveries that have ended since the link was opened.
    pub(super) fn deliveries(&self) -> u32 {
        self.deliveries
    }

    /// Marks are lowered for a small host.
    pub(super) fn open(&mut self, rules: &Rules, wire: &mut Wire) {
        self.room.open();
        (self.low_mark, self.high_mark) = (0, 0);
        self.raise_marks(rules);
        if rules.xon_at_open && rules.speak {
            self.speaker.go(rules, wire);
        }
    }

    /// They are of the most room that is known.
    fn raise_marks(&mut self, rules: &Rules) {
        let room = self.room.known();
        self.low_mark = self.low_mark.max(rules.low_mark.min(room / 2));
        // A high mark below the low one cannot hold; the page does not say so.
        let high = rules.high_mark.min(room / 4 * 3).max(self.low_mark);
        self.high_mark = self.high_mark.max(high);
    }

    /// Characters of one time that are no control bytes.
    pub(super) fn receive(&mut self, at: Micros, bytes: &[u8], rules: &Rules, wire: &mut Wire) {
        if bytes.is_empty() {
            return;
        }
        for byte in bytes {
            self.character(at, *byte, rules);
        }
        self.came(at, bytes.len(), rules, wire);
    }

    /// A damaged character.
    pub(super) fn receive_damaged(&mut self, at: Micros, byte: u8, rules: &Rules, wire: &mut Wire) {
        let delivery = begun(&mut self.delivery, at);
        delivery.damaged = true;
        delivery.part();
        delivery.put(&[byte], &mut self.room);
        self.is_escaped = false;
        self.came(at, 1, rules, wire);
    }

    /// A break.
    pub(super) fn receive_break(&mut self, at: Micros) {
        if let Some(delivery) = &mut self.delivery {
            (delivery.damaged, delivery.silent) = (true, at);
            delivery.part();
            self.is_escaped = false;
            self.speaker.was_heard();
        }
    }

    /// Characters were lost in the port, maybe the first ones.
    pub(super) fn overrun(&mut self, at: Micros, rules: &Rules, wire: &mut Wire) {
        let delivery = begun(&mut self.delivery, at);
        delivery.lost = true;
        delivery.part();
        self.is_escaped = false;
        self.came(at, 0, rules, wire);
    }

    /// One character that is no control byte.
    fn character(&mut self, at: Micros, byte: u8, rules: &Rules) {
        let delivery = begun(&mut self.delivery, at);
        if rules.transparent && !self.is_escaped && byte == rules.escape {
            self.is_escaped = true;
            return;
        }
        let is_escaped = std::mem::take(&mut self.is_escaped);
        let byte = if is_escaped { byte ^ rules.escape_xor } else { byte };
        delivery.look_for_end(byte, rules);
        if !rules.receive_drop.contains(&byte) {
            let bytes = delivery.line_ends.rewrite(byte, rules.receive_line_end);
            delivery.put(&bytes, &mut self.room);
        }
    }

    /// After characters of one time: does the machine have to be told?
    fn came(&mut self, at: Micros, count: usize, rules: &Rules, wire: &mut Wire) {
        self.speaker.was_heard();
        if !rules.speak {
            return;
        }
        if self.speaker.is_stopped() {
            self.speaker.came_in_spite(at, count, rules, wire);
        } else if self.room.known() < self.low_mark {
            self.speaker.stop(at, rules, wire);
        }
    }

    /// When something is due.
    pub(super) fn deadline(&self, rules: &Rules) -> Option<Micros> {
        let silence = self.silence_ends(rules);
        [silence, self.speaker.deadline()].into_iter().flatten().min()
    }

    /// Silence counts only while the machine may send.
    fn silence_ends(&self, rules: &Rules) -> Option<Micros> {
        let delivery = self.delivery.as_ref().filter(|_| !self.speaker.is_stopped())?;
        let has_ended = delivery.has_ended(rules);
        let enough = if has_ended { Some(rules.end_quiet) } else { rules.quiet_time };
        Some(delivery.silent + enough?)
    }

    /// First the end of silence, then a repeat of XON, then room.
    pub(super) fn due(
        &mut self,
        at: Micros,
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.silence_ends(rules).is_some_and(|end| end <= at) {
            let has_ended =
                self.delivery.as_ref().is_some_and(|delivery| delivery.has_ended(rules));
            let clause = if has_ended { "xon-xoff.rx.end-mark" } else { "xon-xoff.rx.quiet-ends" };
            self.end(None, clause, rules, demands);
        }
        self.speaker.due(at, rules, wire);
        self.look_at_room(at, rules, wire);
    }

    /// The host may have made room.
    pub(super) fn look_at_room(&mut self, at: Micros, rules: &Rules, wire: &mut Wire) {
        let has_grown = self.room.grows();
        self.raise_marks(rules);
        if has_grown && self.speaker.is_stopped() && self.room.known() > self.high_mark {
            self.speaker.go(rules, wire);
            if let Some(delivery) = &mut self.delivery {
                delivery.silent = at;
                self.speaker.repeat_from(at, rules);
            }
        }
    }

    /// The host aborts the delivery. A machine that was stopped gets its XON.
    pub(super) fn abort(&mut self, rules: &Rules, wire: &mut Wire, demands: &mut Demands) {
        if self.delivery.is_none() {
            return;
        }
        self.end(Some(Failure::Aborted), "xon-xoff.rx.abort", rules, demands);
        if self.speaker.is_stopped() {
            self.speaker.go(rules, wire);
        }
    }

    /// The port is gone.
    pub(super) fn link_down(&mut self, rules: &Rules, demands: &mut Demands) {
        self.end(Some(Failure::LinkDown), "xon-xoff.link.down", rules, demands);
    }

    /// A partner that was sent XOFF is sent XON.
    pub(super) fn link_up(&mut self, rules: &Rules, wire: &mut Wire) {
        if self.speaker.is_stopped() {
            self.speaker.go(rules, wire);
        }
    }

    /// Nothing is left but the host's room.
    pub(super) fn close(&mut self, rules: &Rules, demands: &mut Demands) {
        self.end(Some(Failure::Interrupted), "xon-xoff.link.close", rules, demands);
        self.speaker = Speaker::default();
        self.is_escaped = false;
        self.deliveries = 0;
    }

    /// The delivery ends; with a reason, or by itself.
    fn end(
        &mut self,
        failure: Option<Failure>,
        clause: &'static str,
        rules: &Rules,
        demands: &mut Demands,
    ) {
        let Some(delivery) = self.delivery.take() else { return };
        self.is_escaped = false;
        self.speaker.was_heard();
        self.deliveries += 1;
        let own = delivery.failure(rules);
        let is_damaged = matches!(own, Some(Failure::LineError | Failure::Overrun));
        let failures = match failure {
            None => vec![own],
            Some(Failure::LinkDown) if is_damaged => vec![own],
            // The page does not say which of two reasons counts.
            Some(Failure::Aborted) if own.is_some() => vec![failure, own],
            Some(_) => vec![failure],
        };
        let id = self.deliveries;
        let delivered = |failure| Effect::Delivered {
            id,
            bytes: delivery.bytes.clone(),
            name: None,
            failure,
            status: 0,
        };
        demands.add_one_of(failures.into_iter().map(delivered).collect(), clause);
    }
}

/// The delivery under way, which is silent from now on. It begins with its first
/// character.
fn begun(delivery: &mut Option<Delivery>, at: Micros) -> &mut Delivery {
    let delivery = delivery.get_or_insert_with(|| Delivery {
        bytes: Vec::new(),
        silent: at,
        line_ends: LineEnds::default(),
        unmarked: Vec::new(),
        end_marks: 0,
        lost: false,
        damaged: false,
    });
    delivery.silent = at;
    delivery
}

impl Delivery {
    /// What stood before and what comes are apart.
    fn part(&mut self) {
        self.line_ends = LineEnds::default();
        self.unmarked.clear();
    }

    /// These are delivered as far as there is room.
    fn put(&mut self, bytes: &[u8], room: &mut Room) {
        for byte in bytes {
            if room.take() {
                self.bytes.push(*byte);
            } else {
                self.lost = true;
            }
        }
    }

    /// End marks do not overlap.
    fn look_for_end(&mut self, byte: u8, rules: &Rules) {
        self.unmarked.push(byte);
        if !rules.end_mark.is_empty() && self.unmarked.ends_with(&rules.end_mark) {
            self.end_marks += 1;
            self.unmarked.clear();
        }
    }

    /// All end marks have come.
    fn has_ended(&self, rules: &Rules) -> bool {
        !rules.end_mark.is_empty() && self.end_marks >= rules.end_mark_count
    }

    /// Why it fails when silence ends it.
    fn failure(&self, rules: &Rules) -> Option<Failure> {
        if self.lost {
            Some(Failure::Overrun)
        } else if self.damaged && rules.fails_on_line_error {
            Some(Failure::LineError)
        } else if !rules.end_mark.is_empty() && !self.has_ended(rules) {
            Some(Failure::NoEndMark)
        } else {
            None
        }
    }
}
