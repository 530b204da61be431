//! What we tell a control that punches: stop, go on, and the answer to DC2.

use super::rules::{Code, OutputFlow, Parity, Rules};
use super::wire::Wire;
use crate::demands::Demands;
use crate::model::Effect;
use softplug_abi::ModemLines;

/// Whether the control is stopped, and the marks of the host's room.
#[derive(Clone, Debug, Default)]
pub(super) struct Flow {
    is_stopped: bool,
    /// It is stopped below this room.
    pub(super) low: u32,
    /// It goes on above this room.
    pub(super) high: u32,
    /// Number of an answer to DC2 that has still to leave.
    answer: Option<u64>,
    /// What the control was told and has still to leave, with its number.
    to_leave: Option<(u64, u8)>,
    /// What the control is to know.
    to_tell: u8,
}

impl Flow {
    /// Half and three quarters of the host's room, or less.
    pub(super) fn open(&mut self, room: u32) {
        *self = Self::default();
        self.raise_marks(room);
    }

    /// They are of the most room that is known.
    fn raise_marks(&mut self, room: u32) {
        self.low = self.low.max(room.div_ceil(2).min(1_024));
        self.high = self.high.max((room - room.div_ceil(4)).min(2_048));
    }

    /// Who could tell the control more is gone.
    pub(super) fn close(&mut self) {
        (self.answer, self.to_leave) = (None, None);
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Characters of a capture have come: is there room for more?
    pub(super) fn look(
        &mut self,
        room: u32,
        code: Option<Code>,
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.is_stopped || room >= self.low {
            return;
        }
        match rules.output_flow {
            OutputFlow::None => return,
            OutputFlow::Dc3 => {
                let has_parity = rules.parity == Parity::Software;
                // Where it is not known the code is the one that is sent; the page does not say so.
                let is_eia = code.unwrap_or(rules.code) == Code::Eia;
                self.tell(if has_parity || is_eia { 0x93 } else { 0x13 }, wire);
            }
            OutputFlow::Rts => {
                let off = Effect::ModemLines(ModemLines::RTS, ModemLines::default());
                demands.add(off, "fanuc-rs232.punch.flow-rts");
            }
        }
        self.is_stopped = true;
    }

    /// There is more room.
    pub(super) fn has_grown(
        &mut self,
        room: u32,
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) -> bool {
        self.raise_marks(room);
        let goes_on = self.is_stopped && room > self.high;
        if goes_on {
            self.go(rules, wire, demands);
        }
        goes_on
    }

    /// A control that was stopped goes on.
    pub(super) fn go(&mut self, rules: &Rules, wire: &mut Wire, demands: &mut Demands) {
        if !std::mem::take(&mut self.is_stopped) {
            return;
        }
        match rules.output_flow {
            OutputFlow::None => {}
            OutputFlow::Dc3 => {
                self.tell(rules.resume_code, wire);
            }
            OutputFlow::Rts => {
                let on = Effect::ModemLines(ModemLines::RTS, ModemLines::RTS);
                demands.add(on, "fanuc-rs232.punch.flow-rts");
            }
        }
    }

    /// The control reads: nothing is said for its output any more.
    pub(super) fn end(&mut self, rules: &Rules, wire: &mut Wire, demands: &mut Demands) {
        if rules.output_flow == OutputFlow::Rts {
            self.go(rules, wire, demands);
        }
        self.is_stopped = false;
        if let Some((_, told)) = self.to_leave {
            self.to_tell = told;
        }
    }

    /// A DC2 came.
    pub(super) fn dc2(&mut self, room: u32, rules: &Rules, wire: &mut Wire) {
        if rules.answer_dc2 && room > 0 && !self.is_stopped && self.answer.is_none() {
            self.answer = Some(wire.say(0x11));
        }
    }

    /// A control code of ours has left. What the control is to know since follows, if it is
    /// another one.
    pub(super) fn left(&mut self, number: u64, wire: &mut Wire) {
        self.answer.take_if(|answer| *answer == number);
        if let Some((_, told)) = self.to_leave.take_if(|(which, _)| *which == number)
            && told != self.to_tell
        {
            self.tell(self.to_tell, wire);
        }
    }

    /// One has to leave before the next.
    fn tell(&mut self, code: u8, wire: &mut Wire) {
        self.to_tell = code;
        if self.to_leave.is_none() {
            self.to_leave = Some((wire.say(code), code));
        }
    }
}
