//! What a machine and a host could do.

use super::Lathe;
use super::run::Stage;
use crate::dice::Dice;
use crate::model::{HostRequest, Proposal};
use crate::propose::{come, host};
use softplug_abi::Micros;
use std::fmt::Write as _;

/// Codes of the page's tables, by form.
const AXES: [u16; 4] = [0o6000, 0o4000, 0o1000, 0o0001];
const THREADS: [u16; 2] = [0o6100, 0o4100];
const LINES: [u16; 8] = [0o7200, 0o5200, 0o4200, 0o6200, 0o3200, 0o1200, 0o0200, 0o2200];
const ARCS: [u16; 8] = [0o2040, 0o3040, 0o1040, 0o0040, 0o5040, 0o4040, 0o6040, 0o7040];

pub(super) fn next(model: &Lathe, _now: Micros, dice: &mut Dice) -> Proposal {
    let Some(job) = &model.job else {
        let data = if model.rules.is_iso { iso(model, dice) } else { octal(model, dice) };
        let kind = "send".to_owned();
        let id = model.jobs + 1;
        let job = HostRequest::Job { id, kind, fields: Vec::new(), data };
        return host(dice.between(1, 3_000), job);
    };
    if dice.one_in(12) {
        return intrude(model, job.id, dice);
    }
    let wait = dice.between(1, 4_000);
    match job.stage {
        Stage::Echo { .. } if dice.one_in(20) => come(wait, vec![dice.byte()]),
        Stage::Echo { code, .. } => come(dice.between(300, 6_000), vec![code]),
        Stage::Single => come(wait, vec![0xF1]),
        Stage::Index { .. } => {
            come(wait, vec![dice.below(64) as u8 | if dice.one_in(3) { 0 } else { 0x40 }])
        }
        Stage::Thread { .. } => {
            let most = *dice.pick(&[1, 3, 10, 64]);
            let count = dice.between(1, 3);
            let turns: Vec<u8> = (0..count).map(|_| dice.below(most) as u8).collect();
            come(dice.between(250, 4_000), turns)
        }
        Stage::Sending | Stage::Ending => come(dice.between(1, 30_000), Vec::new()),
    }
}

/// What comes in between: of the operator, the host and the limits.
fn intrude(model: &Lathe, id: u32, dice: &mut Dice) -> Proposal {
    let wait = dice.between(1, 10_000);
    let is_held = model.job.as_ref().is_some_and(|job| job.is_holding);
    if is_held && !dice.one_in(4) {
        return match dice.below(3) {
            0 => come(wait, vec![0xF1]),
            1 => host(wait, HostRequest::Resume(id)),
            _ => host(wait, HostRequest::ForceResume),
        };
    }
    match dice.below(16) {
        0..=3 => come(wait, vec![0xF0]),
        4 | 5 => come(wait, vec![0xF1]),
        6..=8 => host(wait, HostRequest::Pause(id)),
        9 | 10 => host(wait, HostRequest::Resume(id)),
        11 => come(wait, vec![*dice.pick(&[0xF2, 0xF5, 0xF6, 0xF7, 0xF3, 0xFF])]),
        12 => host(wait, HostRequest::Abort(id)),
        13 => host(wait, HostRequest::ForceResume),
        14 => come(wait, vec![dice.byte()]),
        _ => {
            let kind = "send".to_owned();
            let job = HostRequest::Job {
                id: model.jobs + 1,
                kind,
                fields: Vec::new(),
                data: b"0004".to_vec(),
            };
            host(wait, job)
        }
    }
}

fn small(dice: &mut Dice) -> u16 {
    match dice.below(8) {
        0 => 0,
        1 => dice.between(1, 3) as u16,
        2 => dice.between(20, 200) as u16,
        _ => dice.between(1, 20) as u16,
    }
}

fn octal(model: &Lathe, dice: &mut Dice) -> Vec<u8> {
    let mut words: Vec<u16> = Vec::new();
    let mut begins: Vec<u16> = Vec::new();
    let blocks = dice.between(1, 8).max(if dice.one_in(30) {
        0
    } else {
        model.rules.start_block.min(8) as i64
    });
    let mut entry = 0_usize;
    for nth in 0..blocks {
        let begin = words.len() as u16;
        // Most loops go back to a block that no other loop has.
        if nth > 0 && entry < begins.len() && dice.one_in(5) {
            let place = dice.between(entry as i64, begins.len() as i64 - 1) as usize;
            words.extend([0, dice.between(1, 3) as u16, begins[place]]);
            begins.push(begin);
            entry = if dice.one_in(2) { begins.len() } else { entry };
            continue;
        }
        begins.push(begin);
        let short = if nth > 0 && dice.one_in(2) { 0o0010 } else { 0 };
        let gn = *dice.pick(&[0, 0, 0, 0o1000, 0o4000, 0o5000]);
        match dice.below(8) {
            0..=1 => words.extend([dice.pick(&AXES) + short, gn, small(dice), 0]),
            2..=3 => {
                let alpha = *dice.pick(&[0, 1, 0o2525, 0o4000, 0o7777, 0o1234]);
                words.extend([dice.pick(&LINES) + short, gn, small(dice), 0, alpha]);
            }
            4..=5 => {
                let (z, x) = (small(dice) % 40, small(dice) % 40);
                let z = if z < 2 && x < 2 { 2 } else { z };
                let steps = small(dice);
                words.extend([dice.pick(&ARCS) + short, gn, z, 0, x, 0, steps, 0]);
            }
            6 => words.extend([dice.pick(&THREADS) + short, gn, small(dice) % 30, 0]),
            _ if nth > 0 => {
                words.push(*dice.pick(&[0o0004, 0o0002]));
                continue;
            }
            _ => words.extend([dice.pick(&AXES) + short, gn, small(dice), 0]),
        }
        if short == 0 {
            let stm = *dice.pick(&[0, 0o1122, 0o0010, 0o0120, 0o7777, 0o0034]);
            words.extend([stm, *dice.pick(&[0o7777, 0o7777, 0o7776, 0o5252, 0o3777, 0o1000])]);
        }
    }
    if dice.one_in(10) && !words.is_empty() {
        let place = dice.below(words.len() as u64) as usize;
        words[place] = dice.below(0o10000) as u16;
    }
    let mut text = String::new();
    for word in words {
        let _ = write!(text, "{word:04o}");
        text += *dice.pick(&[" ", "; ", "\n", ",", " (x)\n", "\t%"]);
    }
    if dice.one_in(12) {
        text.truncate(dice.below(text.len() as u64 + 1) as usize);
    }
    if dice.one_in(25) {
        text.insert(dice.below(text.len() as u64 + 1) as usize, *dice.pick(&['8', 'x', '1', '(']));
    }
    text.into_bytes()
}

/// 0.1 µm as mm.
fn mm(value: i64) -> String {
    let sign = if value < 0 { "-" } else { "" };
    let size = value.abs();
    format!("{sign}{}.{:04}", size / 10_000, size % 10_000)
}

fn iso(model: &Lathe, dice: &mut Dice) -> Vec<u8> {
    let mut text = String::new();
    let blocks = dice.between(1, 8).max(if dice.one_in(30) {
        0
    } else {
        model.rules.start_block.min(8) as i64
    });
    for nth in 0..blocks {
        if nth == 0 {
            text += "F";
            text += *dice.pick(&["9999", "2400", "1000.5"]);
            text += *dice.pick(&[" ", "\n", " S9 T2\n", " M3\n"]);
        }
        let coordinate = |dice: &mut Dice| {
            mm(dice.between(-4_000, 4_000) / *dice.pick(&[1, 100]) * *dice.pick(&[1, 50]) / 10)
        };
        let line = match dice.below(12) {
            0..=2 => format!("G00 X{} Z{}", coordinate(dice), coordinate(dice)),
            3..=4 => format!("G01 X{} Z{}", coordinate(dice), coordinate(dice)),
            5 => format!("g1 w{}u{}", coordinate(dice), coordinate(dice)),
            6..=8 => arc(model, dice),
            9 => format!("G33 W{} F{}", coordinate(dice), dice.pick(&["0.25", "1.5", "0.0333"])),
            10 => format!("G04 {}", dice.pick(&["P1", "X0.001", "U.0025", "P0"])),
            _ => (*dice.pick(&[
                "G28", "G28 U0", "G28 W0", "G90", "G91", "M8", "S5", "T1", "M30", "(x)", "%",
            ]))
            .to_owned(),
        };
        text += &line;
        text += *dice.pick(&["\n", "\r\n", " ; x\n", "(y)\n", "\n\n"]);
    }
    if dice.one_in(10) {
        let at = dice.below(text.len() as u64 + 1) as usize;
        text.insert(at, *dice.pick(&['#', '1', 'X', 'Q', '.', '(', '-', '\n']));
    }
    text.into_bytes()
}

/// Ends are exactly on the circle: quarters, halves and wholes, and mirrored ones.
fn arc(model: &Lathe, dice: &mut Dice) -> String {
    let code = *dice.pick(&["G02", "G03"]);
    let unit = *dice.pick(&[100, 100, 50, 7, 1]);
    let side = |dice: &mut Dice| dice.between(-1_500, 1_500) / unit * unit;
    let (i, k) = (side(dice), side(dice));
    let scale = if model.rules.is_diameter { 2 } else { 1 };
    if dice.one_in(4) && i == 0 {
        let size = k.abs();
        let (along, up) = *dice.pick(&[(size, size), (-size, size), (size, -size), (2 * size, 0)]);
        let sign = if dice.one_in(2) { "-" } else { "" };
        return format!("{code} W{} U{} R{sign}{}", mm(along), mm(up * scale), mm(size));
    }
    // From the centre the beginning is (−k, −i).
    let ends = [(i, -k), (-i, k), (k, i), (k, -i), (-k, i), (-k, -i)];
    let (along, up) = *dice.pick(&ends);
    format!("{code} W{} U{} I{} K{}", mm(along + k), mm((up + i) * scale), mm(i), mm(k))
}
