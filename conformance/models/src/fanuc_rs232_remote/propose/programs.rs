//! Programs, mostly such that can be sent.

use crate::dice::Dice;
use crate::words;

/// How much of a program is odd.
#[derive(Copy, Clone, PartialEq, Eq)]
enum Kind {
    /// A program as it should be.
    Plain,
    /// With all that means something.
    Odd,
    /// Any bytes.
    Bytes,
}

/// The data of a job.
pub(super) fn program(dice: &mut Dice) -> Vec<u8> {
    let kind = match dice.below(12) {
        0 => Kind::Bytes,
        1..=5 => Kind::Odd,
        _ => Kind::Plain,
    };
    if dice.one_in(500) {
        return large(dice);
    }
    let eobs: &[&[u8]] = &[b"\n", b"\n", b"\r\n", b"\r", b"\n\r", b"\n\r\r"];
    let eob = *dice.pick(eobs);
    let mut text = Vec::new();
    let is_odd = kind == Kind::Odd;
    if is_odd && dice.one_in(3) {
        let before: &[&[u8]] = &[b"\n", b" ", b"\0\0", b"\r\n\n", b"\t", b"\x7F", b"PART 7\n"];
        text.extend(*dice.pick(before));
    }
    if !dice.one_in(4) {
        let headers: &[&[u8]] = &[b"%", b"%", b"%", b"%PART 7", b"%O1", b"%(A)", b"% N5"];
        let header = if is_odd { *dice.pick(headers) } else { b"%" };
        text.extend(header);
        text.extend(eob);
    }
    if !dice.one_in(4) {
        let numbers: &[&[u8]] = &[b"O1234(PART 7)", b"O1", b":7", b"o77", b" O7", b"/O7"];
        let number = if is_odd { *dice.pick(numbers) } else { b"O1234(PART 7)" };
        text.extend(number);
        text.extend(eob);
    }
    let longest = if dice.one_in(30) { 6_000 } else { 300 };
    let length = text.len() + dice.length(longest);
    while text.len() < length {
        match kind {
            Kind::Bytes => text.push(dice.byte()),
            Kind::Odd => {
                text.extend(odd(dice));
                let eob = if dice.one_in(8) { *dice.pick(eobs) } else { eob };
                text.extend(eob);
            }
            Kind::Plain if dice.one_in(4) => {
                text.extend(words::block(dice).bytes());
                text.extend(eob);
            }
            Kind::Plain => {
                let (n, x) = (10 * dice.below(6), dice.below(1_000));
                text.extend(format!("N{n}G1X{x}").bytes());
                text.extend(eob);
            }
        }
    }
    if !dice.one_in(3) {
        text.extend(b"M30");
        if !dice.one_in(8) {
            text.extend(eob);
        }
    }
    end(kind, eob, &mut text, dice);
    text
}

/// Many blocks: new numbers come to their end, or lines pass 65,536.
fn large(dice: &mut Dice) -> Vec<u8> {
    if dice.one_in(2) {
        return [b"%\n".to_vec(), b"N1\n".repeat(dice.between(99, 300) as usize)].concat();
    }
    let mut text = b"%\n".to_vec();
    text.resize(dice.between(66_000, 70_000) as usize, b'\n');
    text.extend(b"G1@\n%");
    text
}

/// The closing `%` and what is behind it.
fn end(kind: Kind, eob: &[u8], text: &mut Vec<u8>, dice: &mut Dice) {
    if dice.one_in(4) {
        return;
    }
    text.extend(b"%");
    if dice.one_in(2) {
        text.extend(eob);
    }
    if kind == Kind::Odd && dice.one_in(2) {
        let behind: &[&[u8]] =
            &[b"\x1A", b" \t\0\x7F\n", b"\n\nset up", b"%", b"\n%\nO2\n%", b"\x01", b"X"];
        text.extend(*dice.pick(behind));
    }
}

/// A block of any kind.
fn odd(dice: &mut Dice) -> Vec<u8> {
    let before: &[&str] = &["", "", "", "/", "//", "/2", " ", " / ", "/3 ", "/23", "\t", "2"];
    let after: &[&str] = &[
        "",
        "G1X5",
        "(N7 STAYS)",
        "(a)",
        "(A",
        "A(BC)D",
        "G1;",
        "X_Y",
        "50%",
        "(50%)",
        "G1\0X",
        "g2y3",
        "A)B",
        "\"",
        "\x7F",
        "~",
        "@",
        "[#100=1]",
        "((A))",
        "{50}",
        "{50%}",
        ";X2;Y@",
        "\t&",
        "N5",
        "\u{fc}",
        "\x13",
    ];
    let number = match dice.below(8) {
        0..=3 => format!("N{}", 10 * dice.below(6)),
        4 if dice.one_in(2) => "N".to_owned(),
        4 => format!("N{}", words::number(10 * dice.below(6), dice)),
        5 => format!("n00{}", 10 * dice.below(5)),
        _ => String::new(),
    };
    let rest = if dice.one_in(2) { "G1X5" } else { *dice.pick(after) };
    // What cannot be sent ends most programs; it is rare.
    let is_refused = rest.contains(['_', ';', '%', '"', '~', '@', '\u{fc}', '\x13']);
    let rest = if is_refused && dice.one_in(3) { "X1" } else { rest };
    format!("{}{number}{rest}", dice.pick(before)).into_bytes()
}
