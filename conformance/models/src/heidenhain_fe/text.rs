//! Lines, names and programs that are worth trying.

use super::frame::LONGEST;
use crate::dice::Dice;

/// A line that the control could send.
pub(super) fn line(dice: &mut Dice) -> Vec<u8> {
    match dice.below(24) {
        0 => Vec::new(),
        1 => b" ".repeat(dice.between(1, 3) as usize),
        2 => characters(dice.between(LONGEST as i64 - 4, LONGEST as i64) as usize, dice),
        3 => (b' '..=b'~').collect(),
        4..=6 => characters(dice.length(LONGEST), dice),
        7 | 8 => [nc(dice), b" ".to_vec()].concat(),
        9 => b"0 BEGIN PGM 15 MM".to_vec(),
        10 => b"E15A".to_vec(),
        11 => characters(1, dice),
        _ => nc(dice),
    }
}

fn nc(dice: &mut Dice) -> Vec<u8> {
    let x = dice.between(-99_999, 99_999);
    format!("{} L X{:+} F{}", dice.below(1_000), x, dice.below(9_999)).into_bytes()
}

fn characters(count: usize, dice: &mut Dice) -> Vec<u8> {
    (0..count).map(|_| dice.between(0x20, 0x7E) as u8).collect()
}

/// The kind of a program, as it stands in a header.
pub(super) fn kind(dice: &mut Dice) -> u8 {
    match dice.below(6) {
        0 => dice.between(0x21, 0x7E) as u8,
        1 => *dice.pick(b"ENA"),
        _ => b'H',
    }
}

/// A program's name.
pub(super) fn name(dice: &mut Dice) -> Vec<u8> {
    const KNOWN: &[&[u8]] = &[
        b"15",
        b"1",
        b"16",
        b"99999999",
        b"A",
        b"E",
        b"",
        b" ",
        b"15 ",
        b" 15",
        b"../x",
        b"%1",
        b"\"'\\;=",
        b"PROGRAM1",
        b"Program12",
        b"PLATE",
    ];
    match dice.below(12) {
        0 => characters(dice.between(1, 8) as usize, dice),
        1 => characters(dice.between(120, 136) as usize, dice),
        2 => characters(dice.between(236, 240) as usize, dice),
        3..=5 => dice.pick(KNOWN).to_vec(),
        _ => format!("{}", dice.below(100)).into_bytes(),
    }
}

/// A program that the host could send.
pub(super) fn program(longest: usize, dice: &mut Dice) -> Vec<u8> {
    let count = match dice.below(24) {
        0 => 0,
        1 => dice.below(300),
        2..=5 => dice.below(20),
        _ => dice.below(4) + 1,
    };
    let is_odd = dice.one_in(12);
    let long = dice.one_in(6);
    let mut program = Vec::new();
    for _ in 0..count {
        let mut text =
            if long { characters(longest - dice.below(3) as usize, dice) } else { line(dice) };
        text.truncate(longest);
        if is_odd && dice.one_in(4) {
            spoil(&mut text, longest, dice);
        }
        program.extend(text);
        program.extend(*dice.pick(&[&b"\n"[..], b"\n", b"\r\n"]));
    }
    match dice.below(8) {
        0 => drop(program.pop()),
        1 => program.extend(characters(dice.length(longest), dice)),
        2 if is_odd => program.push(b'\r'),
        _ => {}
    }
    program
}

/// Of some 64 KiB.
pub(super) fn long_program(longest: usize, dice: &mut Dice) -> Vec<u8> {
    let size = dice.between(60_000, 66_000) as usize;
    let mut program = Vec::with_capacity(size + longest);
    while program.len() < size {
        program.extend(characters(longest - dice.below(20) as usize, dice));
        program.push(b'\n');
    }
    program
}

/// Of more than 64 KiB, in lines as long as they can be.
pub(super) fn large_program(longest: usize, lines: usize, dice: &mut Dice) -> Vec<u8> {
    let line = [characters(longest, dice), b"\n".to_vec()].concat();
    line.repeat(lines)
}

/// What cannot be sent.
fn spoil(line: &mut Vec<u8>, longest: usize, dice: &mut Dice) {
    let at = dice.below(line.len() as u64 + 1) as usize;
    match dice.below(6) {
        0 => line.insert(at, dice.byte()),
        1 => line.insert(at, *dice.pick(b"\r\x00\x1F\x7F\x80\xFF\x02\x17")),
        2 => line.push(b'\r'),
        3 => *line = characters(longest + 1 + dice.below(4) as usize, dice),
        4 => *line = [characters(longest, dice), vec![*dice.pick(b"\r\x7F")]].concat(),
        _ => *line = (0..=255).collect(),
    }
}
