//! Commands of the partner.

use super::value;
use crate::dice::Dice;
use crate::rk512::series::Series;
use crate::rk512::telegram::{Area, Command, Kind, MOST};

/// A first telegram, or one that goes on with the command before, or with one that has
/// ended.
pub(super) fn command(series: Option<&Series>, ended: Option<&Series>, dice: &mut Dice) -> Vec<u8> {
    match (series, ended) {
        (Some(series), _) if dice.one_in(12) => wrong_follow_up(series, dice),
        (Some(series), _) if !dice.one_in(5) => follow_up(series, dice),
        (None, Some(ended)) if dice.one_in(3) => after_the_end(ended, dice),
        (None, _) if dice.one_in(30) => {
            let command = drawn(dice);
            let mut telegram = command.follow_up();
            if command.kind == Kind::Send {
                telegram.extend((0..2).map(|_| value(dice)));
            }
            telegram
        }
        (None | Some(_), _) if dice.one_in(12) => unknown(dice),
        (None | Some(_), _) => first(dice),
    }
}

fn follow_up(series: &Series, dice: &mut Dice) -> Vec<u8> {
    let mut command = series.command;
    if dice.one_in(20) {
        command.kind = *dice.pick(&[Kind::Send, Kind::Fetch]);
        command.area = *dice.pick(&Area::ALL);
    }
    let mut telegram = command.follow_up();
    if command.kind == Kind::Send {
        telegram.extend((0..about(series.part(), dice)).map(|_| value(dice)));
    }
    telegram
}

/// One of another length, of another command, or with another header.
fn wrong_follow_up(series: &Series, dice: &mut Dice) -> Vec<u8> {
    let mut telegram = next(series);
    match dice.below(4) {
        0 => telegram.push(value(dice)),
        1 => telegram[1] = 1,
        2 => telegram[2] = dice.byte(),
        _ => telegram[3] = dice.pick(&Area::ALL).code(),
    }
    telegram
}

/// A partner that did not heed that its command has ended: the part that was refused, or
/// the one behind it.
fn after_the_end(ended: &Series, dice: &mut Dice) -> Vec<u8> {
    let mut series = ended.clone();
    if dice.one_in(2) {
        series.done += series.part();
    }
    next(&series)
}

/// A command that nobody knows, or with an unknown header.
fn unknown(dice: &mut Dice) -> Vec<u8> {
    let mut telegram = drawn(dice).first();
    let at = dice.below(4) as usize;
    telegram[at] = dice.byte();
    telegram
}

/// The first part of a command that is as long as commands can be.
pub(super) fn long(dice: &mut Dice) -> Vec<u8> {
    let kind = *dice.pick(&[Kind::Send, Kind::Send, Kind::Fetch]);
    let count = *dice.pick(&[32_768, 32_769, 32_832, 32_833, 50_000, 65_535]);
    let command = Command { kind, area: Area::Db, block: 5, offset: 1, count, flag: [0xFF, 0xFF] };
    let mut telegram = command.first();
    if kind == Kind::Send {
        telegram.extend([0x11; MOST]);
    }
    telegram
}

/// The first part of one whose last part lies behind place 65535.
pub(super) fn far(dice: &mut Dice) -> Vec<u8> {
    let area = *dice.pick(&Area::ALL);
    let block = if area.is_block() { 5 } else { 0 };
    let (offset, count, flag) = (255, 65_535, [0xFF, 0xFF]);
    Command { kind: Kind::Fetch, area, block, offset, count, flag }.first()
}

/// The next part of a command.
pub(super) fn next(series: &Series) -> Vec<u8> {
    let mut telegram = series.command.follow_up();
    if series.command.kind == Kind::Send {
        telegram.extend(std::iter::repeat_n(0x11, series.part()));
    }
    telegram
}

fn first(dice: &mut Dice) -> Vec<u8> {
    let command = drawn(dice);
    let mut telegram = command.first();
    if command.kind == Kind::Send {
        let part = command.bytes().min(MOST);
        telegram.extend((0..about(part, dice)).map(|_| value(dice)));
    }
    telegram
}

/// A length, mostly right.
fn about(length: usize, dice: &mut Dice) -> usize {
    match dice.below(40) {
        0 => length + 1,
        1 => length.saturating_sub(1),
        2 => dice.length(MOST),
        _ => length,
    }
}

fn drawn(dice: &mut Dice) -> Command {
    let kind = *dice.pick(&[Kind::Send, Kind::Fetch]);
    let area = match (kind, dice.below(3)) {
        (Kind::Send, 0 | 1) => *dice.pick(&[Area::Db, Area::Dx]),
        _ => *dice.pick(&Area::ALL),
    };
    let most = MOST / area.unit();
    let count = match dice.below(16) {
        0 => dice.below(65_536) as usize,
        1 => most,
        2 => most + 1,
        3 => 2 * most + dice.below(3) as usize,
        4 | 5 => dice.below(4 * most as u64) as usize,
        6 => 0x10,
        _ => 1 + dice.below(20) as usize,
    } as u16;
    let block = if area.is_block() || dice.one_in(20) { value(dice) } else { 0 };
    let flag = match dice.below(8) {
        0 => [value(dice), dice.byte()],
        1 => [value(dice), 0xF0 | dice.below(8) as u8],
        2 => [0xFF, (1 + dice.below(4) as u8) << 4 | 0xF],
        3 => [value(dice), (1 + dice.below(4) as u8) << 4 | dice.below(8) as u8],
        _ => [0xFF, 0xFF],
    };
    Command { kind, area, block, offset: value(dice), count, flag }
}
