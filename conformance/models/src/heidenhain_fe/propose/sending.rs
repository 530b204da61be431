//! A job is being sent.

use super::super::frame::{ACK, DC1, DC3, EOT, ETB, ETX, NAK, SOH, STX};
use super::super::send::{Sending, Stage};
use super::super::{Fe, text};
use super::{about, after, host, line, pause};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use softplug_abi::{LinkDownReason, Micros};

impl Fe {
    pub(super) fn sending(&self, now: Micros, sending: &Sending, dice: &mut Dice) -> Proposal {
        let job = self.jobs;
        match sending.stage {
            Stage::Leaving(place) => self.leaving(place, dice),
            Stage::Answer { until } => self.answer(now, until, sending, dice),
            Stage::Paused => match dice.below(12) {
                0 => self.spoken(vec![*dice.pick(&[ACK, NAK, ETX, b'X', DC3])], dice),
                1 => self.spoken(vec![EOT], dice),
                2 => self.spoken(self.heads(b"15", *dice.pick(b"AE"), dice), dice),
                3 => after(pause(dice), host(HostRequest::Abort(job))),
                4 => after(dice.between(1, 3_600_000_000), Given::Nothing),
                _ => after(pause(dice), host(HostRequest::Resume(job))),
            },
            Stage::Ending(place) => {
                let wait = self.characters(self.out.remaining(place) as usize);
                match dice.below(10) {
                    0 => after(dice.between(1, wait + 1), self.says(&[EOT])),
                    1 => after(dice.between(1, wait + 1), host(HostRequest::Abort(job))),
                    2 => {
                        let header = self.heads(b"15", *dice.pick(b"AE"), dice);
                        after(dice.between(1, wait + 1), self.says(&header))
                    }
                    3 => after(dice.between(1, wait + 1), self.says(&[DC3])),
                    4 => after(dice.between(1, wait + 1), self.says(&[*dice.pick(&[ACK, NAK])])),
                    5 => after(dice.between(1, wait + 1), host(HostRequest::Close)),
                    6 => after(dice.between(1, wait + 1), host(HostRequest::Pause(job))),
                    _ => after(wait + dice.between(0, 1), self.says(&[EOT])),
                }
            }
        }
    }

    /// A block of ours is on its way.
    pub(super) fn leaving(&self, place: u64, dice: &mut Dice) -> Proposal {
        let job = self.jobs;
        let whole = self.characters(self.out.remaining(place) as usize);
        let within = dice.between(1, whole + 1);
        match dice.below(48) {
            0 => after(within, self.says(&[ACK])),
            1 => after(within, self.says(&[NAK])),
            2 => after(within, self.says(&[EOT])),
            3 | 4 => after(within, self.says(&[DC3])),
            5 => after(within, host(HostRequest::Pause(job))),
            6 => after(within, host(HostRequest::Abort(job))),
            7 => {
                let header = self.heads(&text::name(dice), *dice.pick(b"AE"), dice);
                after(within, self.says(&header))
            }
            8 => after(within, self.says(&[b'X', 0x7F, ETX, ETB])),
            // About when its last bit leaves.
            9 => after(whole + dice.between(-2, 1), self.says(&[*dice.pick(&[ACK, NAK])])),
            10 => self.job(None, dice),
            11 => after(within, line(LineInput::Down(LinkDownReason::Disconnected))),
            12 => after(within, host(HostRequest::Close)),
            _ => after(whole + pause(dice).min(90_000), self.says(&[ACK])),
        }
    }

    /// The control has a block of ours.
    pub(super) fn answer(
        &self,
        now: Micros,
        until: Micros,
        sending: &Sending,
        dice: &mut Dice,
    ) -> Proposal {
        let job = self.jobs;
        let refuses = sending.repeats > 0 && dice.one_in(3);
        let wait = pause(dice).min((until - now).0);
        match dice.below(64) {
            0 => self.spoken(vec![EOT], dice),
            1 => self.spoken(self.heads(&text::name(dice), *dice.pick(b"AEX"), dice), dice),
            2 => after(about(until, now, dice), self.says(&[*dice.pick(&[ACK, NAK])])),
            3 => after(about(until, now, dice), Given::Nothing),
            4 => self.spoken(vec![*dice.pick(&[ETX, b'X', DC1, DC3, ETB])], dice),
            5 => after(wait, host(HostRequest::Pause(job))),
            6 => after(wait, host(HostRequest::Abort(job))),
            7 => self.job(None, dice),
            8 => after(wait, self.says(&[ACK, ACK])),
            9 => after(wait, self.says(&[*dice.pick(&[ACK, NAK]), DC3])),
            10 => self.spoken(self.whole(STX, &text::line(dice)), dice),
            11 => self.spoken(self.bad(SOH, dice), dice),
            12 => self.spoken(self.bad(STX, dice), dice),
            13 => after(wait, line(LineInput::Bytes(vec![*dice.pick(&[ACK, NAK, EOT]) ^ 0x80]))),
            14 => after(wait, self.says(&[NAK, EOT])),
            15..=19 => after(wait, self.says(&[NAK])),
            _ if refuses => after(wait, self.says(&[NAK])),
            _ => after(wait, self.says(&[ACK])),
        }
    }
}
