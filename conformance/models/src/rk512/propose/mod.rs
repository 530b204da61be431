//! What a partner and a host could do next, above the procedure.

mod commands;
mod hosts;
mod jobs;

use super::job::Stage;
use super::layer::Layer;
use super::reactions::GOOD;
use super::telegram::{Kind, MOST, reaction};
use crate::dice::Dice;
use crate::model::{HostRequest, LineInput, Proposal};
use crate::r3964::room::Room;
use crate::r3964::{Station, Upper, bytes, host, line, nothing, soon};
use softplug_abi::{LinkDownReason, Micros};

/// STX of the procedure: the partner begins a block.
const STX: u8 = 0x02;
/// NAK: our block is refused.
const NAK: u8 = 0x15;

/// The layer, as those see it who draw what comes next, and the number of a long session.
pub(super) struct Telegrams<'a>(pub(super) &'a Layer, pub(super) Option<u64>);

impl Upper for Telegrams<'_> {
    fn job(&self, _: &Station, dice: &mut Dice) -> HostRequest {
        jobs::job(self.0.jobs + 1, dice)
    }

    fn last_job(&self, _: &Station) -> u32 {
        self.0.jobs
    }

    fn room<'a>(&'a self, _: &'a Station) -> &'a Room {
        &self.0.room
    }

    fn block(&self, _: &Station, is_faulty: bool, dice: &mut Dice) -> Vec<u8> {
        let is_command = !self.0.awaits_reaction() || dice.one_in(8);
        let telegram = if is_command {
            commands::command(self.0.series.as_ref(), self.0.ended.as_ref(), dice)
        } else {
            self.reaction(dice)
        };
        if is_faulty { mangled(telegram, dice) } else { telegram }
    }

    fn in_idle(&self, now: Micros, wait: i64, dice: &mut Dice) -> Option<Vec<Proposal>> {
        let soon = soon(dice);
        let stx = bytes(soon, &[STX]);
        if let Some(request) = &self.0.request
            && !dice.one_in(6)
        {
            let until = (request.until - now).0;
            return Some(match dice.below(30) {
                0 | 1 => vec![stx],
                2 => vec![nothing(until + 10)],
                3 => vec![host((until + dice.between(-1, 1)).max(1), hosts::answer(request, dice))],
                _ => vec![host(soon, hosts::answer(request, dice))],
            });
        }
        let Some(job) = &self.0.job else {
            return Some(vec![if dice.one_in(2) {
                bytes(wait, &[STX])
            } else {
                host(wait, jobs::job(self.0.jobs + 1, dice))
            }]);
        };
        Some(match job.stage {
            Stage::Awaiting(until) => {
                let until = (until - now).0;
                match dice.below(40) {
                    0 => vec![nothing(until + 10)],
                    1 | 2 => vec![bytes((until + dice.between(-1, 1)).max(1), &[STX])],
                    _ => vec![stx],
                }
            }
            Stage::Ready | Stage::OnLine if job.is_paused && !dice.one_in(4) => {
                let request = HostRequest::Resume(job.id);
                let request = if dice.one_in(6) { HostRequest::Abort(job.id) } else { request };
                vec![host(wait, request)]
            }
            Stage::Ready | Stage::OnLine => vec![stx],
        })
    }

    fn meanwhile(&self, _: Micros, dice: &mut Dice) -> Option<Vec<Proposal>> {
        let is_delivering = self.0.job.as_ref().is_some_and(|job| !job.fetched.is_empty());
        if is_delivering && dice.one_in(40) {
            return Some(vec![host(soon(dice), HostRequest::Abort(0))]);
        }
        if let Some(plan) = self.later_part(dice) {
            return Some(plan);
        }
        if let Some(request) = self.0.request.as_ref().filter(|_| dice.one_in(12)) {
            return Some(vec![host(soon(dice), hosts::answer(request, dice))]);
        }
        let wait = soon(dice);
        let Some(job) = &self.0.job else {
            let is_now = !self.0.station.is_idle() && dice.one_in(25);
            return is_now.then(|| vec![host(wait, jobs::job(self.0.jobs + 1, dice))]);
        };
        let is_now = job.stage != Stage::OnLine && !job.is_paused && dice.one_in(40);
        is_now.then(|| vec![host(wait, HostRequest::Pause(job.id))])
    }

    fn long_ones(&self, _: &Station) -> u64 {
        60
    }

    fn begin_long(&self, station: &Station, dice: &mut Dice) -> Proposal {
        let is_partners = self.1.map_or_else(|| dice.one_in(3), |number| number % 4 == 1);
        if is_partners {
            return bytes(1, &[STX]);
        }
        host(1, jobs::long(self.0.jobs + 1, station.doubles(), dice))
    }

    fn is_long_under_way(&self, _: &Station) -> bool {
        self.0.job.is_some() || self.0.series.is_some() || self.0.request.is_some()
    }

    fn go_on(&self, _: &Station, dice: &mut Dice) -> Proposal {
        let wait = dice.between(1, 2_000);
        match (&self.0.request, &self.0.job) {
            (Some(request), _) => host(wait, hosts::good(request)),
            (None, Some(job)) if job.is_paused => host(wait, HostRequest::Resume(job.id)),
            (None, _) => bytes(wait, &[STX]),
        }
    }

    fn good_block(&self, _: &Station, dice: &mut Dice) -> Vec<u8> {
        match (&self.0.job, &self.0.series) {
            (Some(job), _) => {
                let data = if job.command.kind == Kind::Fetch { job.part() } else { 0 };
                let mut telegram = reaction(job.front(), GOOD);
                telegram.extend(std::iter::repeat_n(0x11, data));
                telegram
            }
            (None, Some(series)) => commands::next(series),
            (None, None) if self.1.is_some_and(|number| number % 8 == 1) => commands::far(dice),
            (None, None) => commands::long(dice),
        }
    }
}

impl Telegrams<'_> {
    /// The partner goes on with a command although the link was gone, or although it has
    /// not acknowledged our reaction to a later part.
    fn later_part(&self, dice: &mut Dice) -> Option<Vec<Proposal>> {
        let (layer, station) = (self.0, &self.0.station);
        let series = layer.series.as_ref()?;
        let follow_up = commands::next(series);
        let wait = soon(dice);
        if station.awaits_acknowledgement() && series.has_left && series.done > 0 {
            let stx = bytes(station.characters(2) + soon(dice), &[STX]);
            let refused = bytes(wait, &[NAK]);
            return dice.one_in(6).then(|| vec![refused, stx]);
        }
        if !station.is_idle() || layer.request.is_some() || !dice.one_in(20) {
            return None;
        }
        let later = dice.between(1, 3_000_000);
        Some(vec![
            line(wait, LineInput::Down(LinkDownReason::Unplugged)),
            line(later, LineInput::Up),
            bytes(wait, &[STX]),
            bytes(station.characters(2) + 1, &station.framed(&follow_up)),
        ])
    }

    /// A reaction to our command, mostly good.
    fn reaction(&self, dice: &mut Dice) -> Vec<u8> {
        let Some(job) = &self.0.job else { return reaction(0, GOOD) };
        let data = match job.command.kind {
            Kind::Send => 0,
            Kind::Fetch => job.part(),
        };
        let mut telegram = reaction(job.front(), GOOD);
        match dice.below(30) {
            0 => telegram[3] = *dice.pick(&[0x0A, 0x0C, 0x10, 0x12, 0x14, 0x16]),
            1 => telegram[3] = *dice.pick(&[0x2A, 0x32, 0x34, 0x36]),
            2 => telegram[3] = dice.byte(),
            3 => telegram[0] = !telegram[0],
            4 => {
                let at = dice.below(4) as usize;
                telegram[at] = dice.byte();
            }
            _ => {}
        }
        let count = match dice.below(30) {
            0 => data + 1 + dice.below(3) as usize,
            1 => data.saturating_sub(1 + dice.below(3) as usize),
            2 => dice.below(MOST as u64 + 1) as usize,
            _ if telegram[3] != GOOD && !dice.one_in(4) => 0,
            _ => data,
        };
        telegram.extend((0..count).map(|_| value(dice)));
        telegram.truncate(if dice.one_in(60) { dice.below(4) as usize } else { usize::MAX });
        telegram
    }
}

/// A byte of data, often one that means something.
fn value(dice: &mut Dice) -> u8 {
    match dice.below(4) {
        0 => *dice.pick(&[0x02, 0x10, 0x03, 0x15, 0x00, 0xFF]),
        _ => dice.byte(),
    }
}

/// A telegram that is not as it should be.
fn mangled(mut telegram: Vec<u8>, dice: &mut Dice) -> Vec<u8> {
    let at = dice.below(telegram.len().min(12) as u64) as usize;
    match dice.below(6) {
        0 => telegram.truncate(at),
        1 => telegram.extend((0..=dice.length(3 * MOST)).map(|_| value(dice))),
        2 => telegram.insert(at.min(telegram.len()), value(dice)),
        3 | 4 if at < telegram.len() => telegram[at] = value(dice),
        _ => {}
    }
    telegram
}
