//! Jobs of the host.

use super::value;
use crate::dice::Dice;
use crate::model::HostRequest;
use crate::rk512::telegram::MOST;

/// A job, mostly one that fits.
pub(super) fn job(id: u32, dice: &mut Dice) -> HostRequest {
    let is_write = dice.one_in(2);
    let areas: &[&str] = match (is_write, dice.below(60)) {
        (_, 0) => &["", "db", "XX", "DBX", "D", " DB", "P", "I", "M", "T", "C", "Z", "E", "A", "Q"],
        (true, _) => &["DB", "DB", "DX"],
        (false, _) => &["DB", "DB", "DX", "I", "Q", "M", "T", "C", "E", "A", "Z"],
    };
    let area = *dice.pick(areas);
    let mut fields = Vec::new();
    let mut field = |name: &str, value: String| fields.push((name.to_owned(), value));
    if !dice.one_in(200) {
        field("area", area.to_owned());
    }
    let is_block = matches!(area, "DB" | "DX");
    if is_block && !dice.one_in(60) || !is_block && dice.one_in(60) {
        field("block", number(255, dice));
    } else if !is_block && dice.one_in(30) {
        field("block", "0".to_owned());
    }
    if !dice.one_in(100) {
        field("offset", number(255, dice));
    }
    let unit = if matches!(area, "I" | "Q" | "M" | "E" | "A") { 1 } else { 2 };
    let length = if is_write || dice.one_in(80) { length(dice) } else { 0 };
    let has_count = if is_write { dice.one_in(30) } else { !dice.one_in(150) };
    if has_count {
        // A SEND has as many as its data are, if it says how many.
        let is_right = is_write && !dice.one_in(4);
        let count = if is_right { (length / 2).to_string() } else { count(unit, dice) };
        field("count", count);
    }
    let (flag, cpu) = (dice.below(100), dice.one_in(5));
    if flag < 22 {
        field("flag_byte", number(254, dice));
    }
    if flag < 20 || matches!(flag, 22 | 23) {
        let most = if dice.one_in(20) { 15 } else { 7 };
        field("flag_bit", number(most, dice));
    }
    if cpu {
        let cpu = if dice.one_in(10) { number(4, dice) } else { dice.between(1, 4).to_string() };
        field("cpu", cpu);
    }
    let kind = match (is_write, dice.below(100)) {
        (_, 0) => {
            fields.clear();
            "send"
        }
        (true, _) => "write",
        (false, _) => "read",
    };
    let data = (0..length).map(|_| value(dice)).collect();
    HostRequest::Job { id, kind: kind.to_owned(), fields, data }
}

/// A job that is as long as jobs can be.
pub(super) fn long(id: u32, doubling: bool, dice: &mut Dice) -> HostRequest {
    let is_write = !dice.one_in(3);
    // Little more than 65535 bytes, mostly.
    let most = if dice.one_in(4) { 65_535 } else { 32_900 };
    let words = dice.between(32_769, most);
    let pairs = [("area", "DB".to_owned()), ("block", "5".to_owned()), ("offset", "1".to_owned())];
    let mut fields: Vec<_> = pairs.map(|(name, value)| (name.to_owned(), value)).into();
    let (kind, data) = if is_write {
        // Each DLE goes twice.
        let byte = if doubling { 0x10 } else { 0x11 };
        ("write", vec![byte; 2 * words as usize])
    } else {
        fields.push(("count".to_owned(), words.to_string()));
        ("read", Vec::new())
    };
    HostRequest::Job { id, kind: kind.to_owned(), fields, data }
}

fn number(most: i64, dice: &mut Dice) -> String {
    let number = match dice.below(240) {
        0 => most + 1,
        1 => -1,
        2 => 1 << dice.between(8, 40),
        3 => i64::from(u32::MAX) + 1 + dice.between(0, 3),
        4 => dice.between(-300, -1),
        5..=12 => most,
        13..=20 => 0,
        21..=28 => 0x10_i64.min(most),
        _ => dice.between(0, most),
    };
    number.to_string()
}

fn count(unit: usize, dice: &mut Dice) -> String {
    let most = (MOST / unit) as i64;
    match dice.below(20) {
        0 if dice.one_in(3) => *dice.pick(&[0, -1, 65_535, 65_536, 65_537, 1 << 32, (1 << 32) + 1]),
        1 => most,
        2 => most + 1,
        3 => 2 * most + dice.between(-1, 1),
        4..=6 => dice.between(1, 5 * most),
        7 => dice.between(1, 2_000),
        _ => dice.between(1, 20),
    }
    .to_string()
}

fn length(dice: &mut Dice) -> usize {
    let length = match dice.below(24) {
        0 if dice.one_in(3) => 0,
        1 => MOST,
        2 => MOST + 2,
        3 => 2 * MOST + 2 * dice.below(2) as usize,
        4 | 5 => dice.below(3 * MOST as u64) as usize * 2,
        6 => dice.below(300) as usize,
        7 if dice.one_in(40) => *dice.pick(&[131_068, 131_070, 131_072, 131_074]),
        7 => dice.below(2_000) as usize * 2,
        _ => 2 * (1 + dice.below(12) as usize),
    };
    length + usize::from(dice.one_in(100))
}
