//! Words and texts as programs have them.

use crate::dice::Dice;

/// Each stands in programs for some control or other; digits follow some of them.
const WORDS: &[&str] = &[
    "G76P",
    "G76R",
    "G84.2",
    "G83",
    "G71U1.R.5",
    "G70P10Q20",
    "G28U0W0",
    "G50S2000",
    "G90G54",
    "G02X1.Y2.I3.J4.",
    "G03",
    "G04P500",
    "G10L2P1",
    "G43H1Z50.",
    "G65P9010A1.",
    "G96S180",
    "G00",
    "G0X",
    "G1Z-",
    "M29",
    "M3",
    "M98P1000L3",
    "M99",
    "M06T",
    "M30",
    "O9",
    "T0101",
    "T",
    "S1200M3",
    "S",
    "F.15",
    "F",
    "N10 ",
    "X-12.5",
    "Y+0.001",
    "Z.",
    "I",
    "J-",
    "K",
    "R",
    "Q",
    "P",
    "H",
    "D",
    "L",
    "U",
    "W",
    "A90.",
    "B-",
    "C0",
    "E",
    "V",
    "/M8",
    "(COMMENT)",
    "(TOOL 5)",
    "(",
    ")",
    " ",
];

/// Of macros.
const MACROS: &[&str] = &[
    "#100=",
    "#1=[2*3]",
    "IF[#1EQ0]GOTO",
    "WHILE[#1LT5]DO1",
    "END1",
    "#3000=1(ALARM)",
    "GOTO",
    "#[#1+1]=#0",
    "DPRNT[X#1]",
    "SETVN#100[A,B]",
];

/// Lengths about which something may end.
const LENGTHS: &[i64] = &[32, 64, 100, 125, 126, 127, 128, 129, 200, 254, 255, 256, 257, 300];

/// A block of such words.
pub(crate) fn block(dice: &mut Dice) -> String {
    if dice.one_in(4) {
        return movement(dice);
    }
    let has_macros = dice.one_in(6);
    let mut block = String::new();
    for _ in 0..dice.between(1, 6) {
        let words = if has_macros && dice.one_in(2) { MACROS } else { WORDS };
        let word = *dice.pick(words);
        block.push_str(word);
        if dice.one_in(2) {
            let digits = dice.between(1, 5) as u32;
            block.push_str(&dice.below(10_u64.pow(digits)).to_string());
        }
    }
    block
}

/// A block as most of any program: to somewhere, with or without blanks between its words.
fn movement(dice: &mut Dice) -> String {
    let mut words = Vec::new();
    if dice.one_in(3) {
        words.push(format!("N{}", 10 * dice.below(1_000)));
    }
    if !dice.one_in(4) {
        words.push((*dice.pick(&["G0", "G00", "G1", "G01", "G2", "G02", "G03"])).to_owned());
    }
    for axis in ["X", "Y", "Z"] {
        if dice.one_in(2) {
            let sign = if dice.one_in(2) { "-" } else { "" };
            let (whole, part) = (dice.below(400), dice.below(1_000));
            words.push(match dice.below(3) {
                0 => format!("{axis}{sign}{whole}."),
                1 => format!("{axis}{sign}{whole}.{part:03}"),
                _ => format!("{axis}{sign}{whole}"),
            });
        }
    }
    if dice.one_in(3) {
        words.push(format!("F{}", dice.below(2_000)));
    }
    words.join(if dice.one_in(2) { " " } else { "" })
}

/// A length that is more than a line mostly has.
pub(crate) fn long(dice: &mut Dice) -> usize {
    let length = match dice.below(3) {
        0 => dice.between(60, 300),
        _ => *dice.pick(LENGTHS) + dice.between(-2, 2),
    };
    length as usize
}

/// A text of so many characters, as remarks have them.
pub(crate) fn text(length: usize, dice: &mut Dice) -> String {
    const TEXT: &str = "HOUSING OF THE 2ND GEARBOX, SIDE A - ROUGH/FINE +0.1 ";
    let from = dice.below(TEXT.len() as u64) as usize;
    TEXT.chars().cycle().skip(from).take(length).collect()
}

/// A number as people and programs write it: with zeros before it, or too large for
/// whoever counts in two, four or eight bytes.
pub(crate) fn number(number: u64, dice: &mut Dice) -> String {
    let number = u128::from(number);
    match dice.below(6) {
        0 => format!("{}{number}", "0".repeat(dice.between(1, 24) as usize)),
        1 => format!("{}{number}", "0".repeat(long(dice))),
        2 => (number + (1 << dice.pick(&[8, 16, 31, 32, 33, 63, 64]))).to_string(),
        3 => (number + 10_u128.pow(dice.between(3, 20) as u32)).to_string(),
        4 => format!("{number}{}", "0".repeat(dice.between(1, 130) as usize)),
        _ => number.to_string(),
    }
}
