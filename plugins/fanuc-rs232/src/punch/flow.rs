//! How the control's output is held while the host has little room.

use crate::code::Code;
use crate::{OutputFlow, ParityMode, ResumeCode, Settings};
use softplug_plugin::{Context, MarkId, ModemLines};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The control is held below this room and goes on above twice as much; both are
/// less where the whole room is small. It may send ten more characters.
const LOW: u32 = 1_024;

/// The mark of what the control is told.
pub(super) const TOLD: MarkId = MarkId(u32::MAX - 1);

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Flow {
    low: u32,
    high: u32,
    /// The control is held.
    pub(crate) held: bool,
    /// The code by which the control is to know that.
    to_tell: u8,
    /// The one that has not left yet; 0: none. Another waits until it has: a control that
    /// sends faster than its line cannot make more of them wait.
    leaving: u8,
    spare: u8,
}

impl Flow {
    /// Marks must leave the host space to report room in between. They rise with the room that is
    /// known, and stay over a swap: a converter that goes on is told what is left, not the whole.
    pub(crate) fn raise_marks(&mut self, room: u32) {
        self.low = self.low.max(LOW.min(room.div_ceil(2)));
        self.high = self.high.max((2 * LOW).min(room - room.div_ceil(4)));
    }

    pub(crate) fn look(&mut self, link: &mut Context<'_>, settings: &Settings, code: Code) {
        if self.held || link.delivery_room() >= self.low {
            return;
        }
        self.held = settings.output_flow != OutputFlow::None;
        match settings.output_flow {
            OutputFlow::None => {}
            OutputFlow::Rts => {
                let on = ModemLines::default();
                link.set_modem_lines(ModemLines::RTS, on);
            }
            OutputFlow::Dc3 => {
                // A port with seven bits makes the parity itself.
                let has_parity = code == Code::Eia || settings.parity == ParityMode::Software;
                self.tell(link, if has_parity { 0x93 } else { 0x13 });
            }
        }
    }

    /// Whether the control goes on.
    pub(crate) fn drained(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        self.raise_marks(link.delivery_room());
        let goes_on = self.held && link.delivery_room() > self.high;
        if goes_on {
            self.let_go(link, settings);
        }
        goes_on
    }

    pub(crate) fn let_go(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if !core::mem::take(&mut self.held) {
            return;
        }
        if settings.output_flow == OutputFlow::Rts {
            link.set_modem_lines(ModemLines::RTS, ModemLines::RTS);
        } else {
            let is_dc2 = settings.resume_code == ResumeCode::Dc2;
            self.tell(link, if is_dc2 { 0x12 } else { 0x11 });
        }
    }

    /// The control reads: what it put out is over, and a code for it would stand in its program.
    pub(crate) fn end(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if settings.output_flow == OutputFlow::Rts {
            self.let_go(link, settings);
        }
        self.held = false;
        self.to_tell = self.leaving;
    }

    fn tell(&mut self, link: &mut Context<'_>, code: u8) {
        self.to_tell = code;
        if self.leaving == 0 {
            self.leaving = code;
            link.transmit_urgent_marked(TOLD, &[code]);
        }
    }

    /// What the control was told has left.
    pub(super) fn left(&mut self, link: &mut Context<'_>) {
        let left = core::mem::take(&mut self.leaving);
        if left != self.to_tell {
            self.tell(link, self.to_tell);
        }
    }
}
