//! Nothing is under way, a job waits, or the host was asked.

use super::super::frame::{ACK, DC1, DC3, EOT, ETB, ETX, NAK, SOH, STX};
use super::super::{Fe, text};
use super::receiving::tidies;
use super::{about, after, host, pause};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, Proposal};
use softplug_abi::{Failure, Micros};

/// Headers with little in them.
const SHORT: &[&[u8]] = &[b"A", b"E", b"", b"HA", b"HE", b"EE"];

impl Fe {
    pub(super) fn idle(&self, dice: &mut Dice) -> Proposal {
        if self.room.free() == 0 && !self.has_no_place && dice.one_in(3) {
            return after(pause(dice), host(HostRequest::Close));
        }
        if !self.room.must_take(1) && !dice.one_in(if self.has_no_place { 2 } else { 6 }) {
            return tidies(dice);
        }
        let name = text::name(dice);
        match dice.below(32) {
            0 => self.spoken(self.whole(STX, &text::line(dice)), dice),
            1 => self.spoken(self.bad(STX, dice), dice),
            2 => self.spoken(self.bad(SOH, dice), dice),
            3 => self.spoken(self.heads(&name, dice.between(0x20, 0x7E) as u8, dice), dice),
            4 => {
                let text = *dice.pick(SHORT);
                self.spoken(self.whole(SOH, text), dice)
            }
            5 => self.spoken(vec![*dice.pick(&[EOT, ETX, ACK, NAK, ETB, b'X', 0x7F])], dice),
            6 => after(dice.between(1, 60_000_000), Given::Nothing),
            7 => after(pause(dice), host(HostRequest::Close)),
            8 => {
                let all = [
                    self.heads(&name, b'A', dice),
                    self.whole(STX, &text::line(dice)),
                    vec![ETX, EOT],
                ];
                self.spoken(all.concat(), dice)
            }
            9..=13 => self.spoken(self.heads(&name, b'E', dice), dice),
            14..=19 => self.job(None, dice),
            _ => self.spoken(self.heads(&name, b'A', dice), dice),
        }
    }

    /// A job, mostly for what was asked for.
    pub(super) fn job(&self, asked: Option<&[u8]>, dice: &mut Dice) -> Proposal {
        let data = match dice.below(40) {
            0 => text::long_program(self.rules.longest(), dice),
            _ => text::program(self.rules.longest(), dice),
        };
        let name = match (dice.below(8), asked) {
            (0, _) => Some(text::name(dice)),
            (1..=3, Some(asked)) => Some(asked.to_vec()),
            (1 | 2, None) => Some(format!("{}", dice.below(100)).into_bytes()),
            _ => None,
        };
        let text = name.map(|name| String::from_utf8_lossy(&name).into_owned());
        let fields = text.map(|text| ("name".to_owned(), text)).into_iter().collect();
        let kind = "send".to_owned();
        let job = HostRequest::Job { id: self.jobs + 1, kind, fields, data };
        after(pause(dice), host(job))
    }

    /// A job waits; nobody has asked for it.
    pub(super) fn job_waits(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let Some(job) = &self.job else { return self.idle(dice) };
        let name = job.name.clone().unwrap_or_else(|| text::name(dice));
        match dice.below(24) {
            0 => self.job(None, dice),
            1 => after(pause(dice), host(HostRequest::Abort(job.id))),
            2 => after(pause(dice), host(HostRequest::Pause(job.id))),
            3 => after(pause(dice), host(HostRequest::Close)),
            4 | 5 => self.idle(dice),
            6 => self.spoken(self.heads(&text::name(dice), b'E', dice), dice),
            7 => {
                let turned = |byte: &u8| byte ^ u8::from(byte.is_ascii_alphabetic()) << 5;
                let near = [
                    name.clone(),
                    name[..name.len().saturating_sub(1)].to_vec(),
                    [&name[..], b"0"].concat(),
                    [&name[..], b" "].concat(),
                    name.iter().map(turned).collect(),
                ];
                self.spoken(self.heads(dice.pick(&near).as_slice(), b'E', dice), dice)
            }
            8 | 9 => match job.until {
                Some(until) => {
                    let header = self.heads(&name, b'E', dice);
                    after(about(until, now, dice), self.says(&header))
                }
                None => after(dice.between(1, 9_000_000_000), Given::Nothing),
            },
            _ => self.spoken(self.heads(&name, b'E', dice), dice),
        }
    }

    pub(super) fn asking(&self, request: u32, name: &[u8], dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        match dice.below(24) {
            0 => self.spoken(vec![EOT], dice),
            1 => self.spoken(self.heads(&text::name(dice), b'E', dice), dice),
            2 => self.spoken(self.heads(&text::name(dice), b'A', dice), dice),
            3 => self.spoken(self.bad(SOH, dice), dice),
            4 => self.spoken(self.whole(STX, &text::line(dice)), dice),
            5 => self.spoken(vec![*dice.pick(&[ACK, NAK, ETX, DC3, DC1, b'X'])], dice),
            6 => after(dice.between(1, 7_200_000_000), Given::Nothing),
            7 | 8 => self.job(Some(name), dice),
            9 => after(wait, host(HostRequest::Answer(request + 1, Ok(Vec::new())))),
            10 => after(wait, host(HostRequest::Close)),
            11 => self.spoken(self.bad(STX, dice), dice),
            12..=14 => {
                let failures =
                    [Failure::NotFound, Failure::Denied, Failure::Aborted, Failure::Busy];
                after(wait, host(HostRequest::Answer(request, Err(*dice.pick(&failures)))))
            }
            _ => after(wait, host(HostRequest::Answer(request, Ok(Vec::new())))),
        }
    }

    pub(super) fn granted(
        &self,
        now: Micros,
        name: &[u8],
        until: Micros,
        dice: &mut Dice,
    ) -> Proposal {
        match dice.below(24) {
            0 => self.spoken(vec![EOT], dice),
            1 => self.spoken(self.heads(name, b'E', dice), dice),
            2 => self.spoken(self.heads(name, b'A', dice), dice),
            3 => self.spoken(self.bad(SOH, dice), dice),
            4 => self.spoken(self.whole(STX, &text::line(dice)), dice),
            5 => after(about(until, now, dice), self.says(b"X")),
            6..=8 => {
                let given = self.job(Some(name), dice).given;
                after(about(until, now, dice), given)
            }
            9 => self.spoken(vec![*dice.pick(&[ACK, NAK, ETX, DC3, DC1, b'X'])], dice),
            _ => self.job(Some(name), dice),
        }
    }
}
