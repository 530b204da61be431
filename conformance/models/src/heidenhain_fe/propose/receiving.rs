//! The control sends.

use super::super::frame::{ACK, DC1, DC3, EOT, ETB, ETX, NAK, SOH, STX};
use super::super::receive::Reception;
use super::super::{Fe, text};
use super::{about, after, host, pause};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, Proposal};
use softplug_abi::Micros;

impl Fe {
    pub(super) fn receiving(
        &self,
        now: Micros,
        reception: &Reception,
        dice: &mut Dice,
    ) -> Proposal {
        if reception.refusals > 0 && dice.one_in(3) {
            return self.spoken(self.bad(STX, dice), dice);
        }
        if self.room.is_small() && !self.room.is_kept() && dice.one_in(8) {
            return after(pause(dice), host(HostRequest::Keep));
        }
        if self.room.free() == 0 && dice.one_in(3) {
            return after(pause(dice), self.says(&[ETX, EOT]));
        }
        let block = self.whole(STX, &self.line_for_room(dice));
        match dice.below(48) {
            0..=3 => self.spoken(self.bad(STX, dice), dice),
            4 => self.spoken(vec![EOT], dice),
            5 => self.spoken(vec![ETX], dice),
            6 => self.spoken(self.heads(&text::name(dice), b'A', dice), dice),
            7 => self.spoken(self.heads(&text::name(dice), b'E', dice), dice),
            8 => self.spoken(self.bad(SOH, dice), dice),
            9 => after(pause(dice), host(HostRequest::Abort(0))),
            10 => self.job(None, dice),
            11 => match self.rules.block_time {
                Some(time) => {
                    let begin = *dice.pick(&[STX, SOH, b'X', DC3, EOT]);
                    after(about(reception.latest + time, now, dice), self.says(&[begin]))
                }
                None => after(dice.between(1, 3_600_000_000), Given::Nothing),
            },
            12 => self.spoken(vec![*dice.pick(&[ACK, NAK, DC1, ETB, b'X', 0x7F])], dice),
            13 => after(pause(dice), host(HostRequest::Keep)),
            14 => after(pause(dice), host(HostRequest::PutAway(dice.below(300) as u32))),
            15 if !self.room.is_kept() => self.spoken([block, vec![ETX, EOT]].concat(), dice),
            16 => self.spoken([vec![ETX, EOT], self.heads(b"7", b'A', dice)].concat(), dice),
            17 if !self.room.is_kept() => {
                self.spoken([block, self.whole(STX, &text::line(dice))].concat(), dice)
            }
            18 => self.spoken([vec![DC3], block].concat(), dice),
            19 => self.spoken(vec![ETX, *dice.pick(&[b'X', ACK, DC1, ETX, 0]), EOT], dice),
            20..=27 => after(pause(dice), self.says(&[ETX, EOT])),
            _ => self.spoken(block, dice),
        }
    }

    /// While the host puts nothing away by itself, lines sometimes fill its room
    /// exactly.
    pub(super) fn line_for_room(&self, dice: &mut Dice) -> Vec<u8> {
        let free = self.room.free();
        let end = self.rules.line_end.len();
        let exact = (free + dice.below(2) as usize).saturating_sub(end);
        if self.room.is_kept() && (1..=240).contains(&exact) && !dice.one_in(3) {
            return b"X".repeat(exact);
        }
        if self.room.is_kept() && dice.one_in(2) {
            return b"Y".repeat(dice.between(100, 240) as usize);
        }
        text::line(dice)
    }

    /// A line waits for room.
    pub(super) fn no_room(&self, dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        match dice.below(64) {
            0 => after(wait, host(HostRequest::Abort(0))),
            1 => after(wait, self.says(&[EOT])),
            2 => after(wait, self.says(&[ETX, EOT])),
            3 => {
                let begin = *dice.pick(&[SOH, STX]);
                self.spoken(self.whole(begin, &text::line(dice)), dice)
            }
            4 => after(wait, host(HostRequest::Close)),
            5 => after(dice.between(1, 3_600_000_000), Given::Nothing),
            6 => self.spoken(vec![*dice.pick(&[ACK, NAK, DC1, DC3, ETX, b'X'])], dice),
            7 => self.job(None, dice),
            8..=20 => after(wait, host(HostRequest::PutAllAway)),
            _ => after(wait, host(HostRequest::PutAway(dice.between(1, 250) as u32))),
        }
    }
}

/// The host puts away what it has kept.
pub(super) fn tidies(dice: &mut Dice) -> Proposal {
    let request = match dice.below(4) {
        0 => HostRequest::PutAllAway,
        _ => HostRequest::PutAway(dice.between(1, 1_000) as u32),
    };
    after(pause(dice), host(request))
}
