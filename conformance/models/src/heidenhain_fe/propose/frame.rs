//! Headers and blocks that go on, and bad ones.

use super::super::frame::{ACK, DC1, DC3, EOT, ETX, Frame, Kind, NAK, Place, SOH, STX};
use super::super::{Fe, text};
use super::{after, host, line};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use softplug_abi::LineErrorKind;

impl Fe {
    /// A header or block in one of the many ways in which it is bad.
    pub(super) fn bad(&self, begin: u8, dice: &mut Dice) -> Vec<u8> {
        let mut all = self.whole(begin, &text::line(dice));
        let last = all.len() - 1;
        let at = dice.between(1, last as i64) as usize;
        match dice.below(7) {
            0 => all[at] ^= 1 << dice.below(7),
            1 => all[at] = dice.between(0, 0x1F) as u8,
            2 => all[last] = dice.between(0x20, 0x7E) as u8,
            3 => all = self.whole(begin, &b"X".repeat(dice.between(242, 244) as usize)),
            4 => {
                let check = last - usize::from(self.rules.dc1);
                all[check] ^= 1 << dice.below(7);
            }
            5 => all[at] |= 0x80,
            _ => all.insert(at, dice.byte()),
        }
        all
    }

    /// The header or block that has begun goes on.
    pub(super) fn in_frame(&self, frame: &Frame, dice: &mut Dice) -> Proposal {
        let pace = self.characters(1);
        let rest = self.rest(frame, dice);
        let one = rest[..1].to_vec();
        match dice.below(32) {
            0 => {
                let edge = self.rules.character_time.0 + dice.between(-1, 1);
                after(edge, self.says(&one))
            }
            1 => after(
                pace,
                self.says(&[*dice.pick(&[DC1, DC3, EOT, ACK, NAK, ETX, 0, 0x1F, 0x7F])]),
            ),
            2 => self.spoken(self.whole(*dice.pick(&[SOH, STX]), &text::line(dice)), dice),
            3 => {
                let kinds = [
                    LineErrorKind::Framing,
                    LineErrorKind::Parity,
                    LineErrorKind::Overrun,
                    LineErrorKind::Break,
                ];
                let kind = *dice.pick(&kinds);
                // Lost ones are told with the one that came behind them, or without.
                let is_read = match kind {
                    LineErrorKind::Overrun => dice.one_in(2),
                    kind => kind != LineErrorKind::Break,
                };
                let byte = is_read.then_some(rest[0]);
                after(pace, line(LineInput::Damaged { kind, byte, span: 0 }))
            }
            4 => after(self.rules.character_time.0 + 1, Given::Nothing),
            5 => after(dice.between(1, self.rules.character_time.0), self.host_meanwhile(dice)),
            6..=16 => after(pace, self.says(&one)),
            17 => after(
                pace,
                self.says(&[rest, vec![*dice.pick(&[DC1, DC3, EOT, STX, b'X'])]].concat()),
            ),
            _ => after(self.characters(rest.len()), self.says(&rest)),
        }
    }

    /// What the host asks for while a header or block is under way.
    fn host_meanwhile(&self, dice: &mut Dice) -> Given {
        host(match dice.below(8) {
            0 => HostRequest::Pause(self.jobs),
            1 => HostRequest::Resume(self.jobs),
            2 => HostRequest::Abort(0),
            _ => HostRequest::Abort(self.jobs),
        })
    }

    /// What may follow the characters of a header or block that have come.
    pub(super) fn rest(&self, frame: &Frame, dice: &mut Dice) -> Vec<u8> {
        let begin = if frame.kind == Kind::Header { SOH } else { STX };
        if frame.place == Place::Dc1 {
            return vec![DC1];
        }
        if frame.place == Place::Check {
            return [&[frame.check()][..], if self.rules.dc1 { &[DC1] } else { &[] }].concat();
        }
        let known = frame.text.len();
        let mut text = frame.text.clone();
        if frame.kind == Kind::Header && (known < 3 || !matches!(text[known - 1], b'A' | b'E')) {
            text.extend(if known == 0 { &b"H7"[..] } else { b"" });
            text.push(*dice.pick(b"AAEEX"));
        } else if dice.one_in(2) {
            text.extend(text::line(dice));
        }
        self.whole(begin, &text).split_off(known + 1)
    }
}
