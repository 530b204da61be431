//! Programs, as files have them and as controls punch them.

use super::Guess;
use crate::dice::Dice;
use crate::fanuc_rs232::select::Start;
use crate::fanuc_rs232::tape;
use crate::words;

/// Behind a G or so, each of them.
const LETTERS: &str = "GABCDEFHIJKLMNOPQRSTUVWXYZ0123456789";

impl Guess<'_> {
    /// A file, mostly one that can be sent.
    pub(super) fn program(&self, length: usize, dice: &mut Dice) -> Vec<u8> {
        let ends: [&[u8]; 5] = [b"\n", b"\r\n", b"\r", b"\n\r\r", b"\n\r"];
        let end = *dice.pick(&ends);
        let befores: [&[u8]; 8] = [b"%", b"%", b"%", b"%PART 7", b"", b" \0", b"\r\n %", b"X"];
        let before = *dice.pick(&befores);
        let is_odd = dice.one_in(10);
        let mut file = before.to_vec();
        if !before.is_empty() {
            file.extend(end);
        }
        if dice.one_in(10) {
            file.extend(end);
        }
        if !dice.one_in(3) {
            file.extend(number_line(dice));
            file.extend(end);
        }
        let mut number = 0;
        while file.len() < length {
            number += 10;
            file.extend(file_block(number, is_odd, dice));
            if is_odd && dice.one_in(3) {
                file.extend(self.replaced(dice));
            }
            file.extend(end);
        }
        if dice.one_in(6) {
            file.extend(b"M30");
        }
        let behinds: [&[u8]; 14] = [
            b"%",
            b"%",
            b"%",
            b"%",
            b"%\r\n\x1A",
            b"%\n \t\0",
            b"",
            b"",
            b"%X",
            b"%\r\nO2\n%",
            b"%%",
            b"%\n\x1A\nO2\n",
            b"%\0\x1A \x1AX",
            b"%\n\n\x7F\n(A)",
        ];
        file.extend(*dice.pick(&behinds));
        if dice.one_in(100) {
            file.clear();
        }
        // When a job without a program is done the page does not say.
        let tape = tape::encode(&file, &Start::default(), &self.model.rules);
        if tape.is_ok_and(|tape| tape.closed == self.model.rules.leader) {
            file.extend(b"M30");
        }
        file
    }

    /// Characters that `replace` knows, what is closed behind them, and maybe a fault.
    fn replaced(&self, dice: &mut Dice) -> Vec<u8> {
        let mut text = Vec::new();
        for _ in 0..dice.between(1, 4) {
            let pairs = &self.model.rules.replace;
            if !pairs.is_empty() {
                text.push(dice.pick(pairs).0);
            }
            text.extend(*dice.pick(&[b"".as_slice(), b"X", b"50%", b")", b"N5", b"("]));
        }
        if dice.one_in(3) {
            text.push(*dice.pick(b"\x01%;\xE4"));
        }
        text
    }

    /// What a control punches, from `%` to `%`, mostly.
    pub(super) fn tape(&self, dice: &mut Dice) -> Vec<u8> {
        let heads: [&[u8]; 6] = [b"%\n", b"%\n", b"%\n", b"%HEAD\n", b"%", b"X%\n"];
        let mut tape = dice.pick(&heads).to_vec();
        for _ in 0..dice.length(30) {
            tape.extend(self.block(dice));
            tape.push(b'\n');
        }
        let tails: [&[u8]; 8] =
            [b"%\n", b"%\n", b"%", b"%", b"%\n\n", b"", b"M30%", b"%\n%\nO2\n%"];
        tape.extend(*dice.pick(&tails));
        tape
    }

    /// A block that a control punches, without its EOB.
    pub(super) fn block(&self, dice: &mut Dice) -> Vec<u8> {
        let numbers = ["00", "123456789", "4294967296", "999999999999999999", "A\x7F"];
        let name = match dice.below(16) {
            0..=1 => (*dice.pick(&numbers)).to_owned(),
            2 => words::number(dice.below(2_000), dice),
            3 => {
                let spaces = |dice: &mut Dice| " ".repeat(dice.below(4) as usize);
                format!("{}{}{}", spaces(dice), dice.below(2_000), spaces(dice))
            }
            4 => words::text(words::long(dice), dice),
            _ => dice.below(2_000).to_string(),
        };
        let program = self.model.rules.request_program;
        let asked = self.model.rules.request_pattern.replace('*', &name);
        match dice.below(24) {
            16 => format!("O{}{asked}", words::number(program, dice)),
            17 => format!("O{}", words::number(dice.below(9_999), dice)),
            18 => format!("({})", words::text(words::long(dice), dice)),
            19..=20 => words::block(dice),
            21 => {
                let own = self.model.rules.eia_codes.iter().map(|(own, _)| char::from(*own));
                format!("X{}", own.collect::<String>())
            }
            0 => format!("O{:04}{asked}", self.model.rules.request_program),
            1 => format!("O{}{asked}", self.model.rules.request_program),
            2 => asked,
            3 => format!("O{}(PART {})", dice.below(9_999), dice.below(9)),
            4 => format!(":{}", dice.below(99)),
            5 => "(COVER LEFT)".to_owned(),
            6 => "( A B )(C)".to_owned(),
            7 => (*dice.pick(&["(AB", "()", "O", "OX", " O3", "/O4", "(50%)", "A)", "((A)B)"]))
                .to_owned(),
            8 => String::new(),
            9 => format!("{}{}", &LETTERS[dice.below(26) as usize..], "+-/.,&"),
            _ => format!("N{}G1X{}.", dice.below(999), dice.below(9_999)),
        }
        .into_bytes()
    }
}

fn number_line(dice: &mut Dice) -> Vec<u8> {
    let lines: [&[u8]; 6] = [b"O1", b"O0012(PART 7)", b":7", b"o5", b"O1 ", b"(O7)"];
    dice.pick(&lines).to_vec()
}

fn file_block(number: u32, is_odd: bool, dice: &mut Dice) -> Vec<u8> {
    let mut block = match dice.below(126) / 9 {
        11 => words::block(dice),
        12 => format!("{}N{}", " ".repeat(dice.below(12) as usize), words::number(30, dice)),
        13 if is_odd || dice.one_in(4) => {
            format!("N{number}({})", words::text(words::long(dice), dice))
        }
        0 => format!("/N{number}G1"),
        1 => format!("N{number:05} G0 X{}", dice.below(999)),
        2 => " N5Y1".to_owned(),
        3 => format!("N{}", dice.below(60)),
        4 => String::new(),
        10 => "N99999M8".to_owned(),
        9 => format!("N{}{}", "0".repeat(dice.below(12) as usize), 10 * dice.below(6)),
        5 => format!("G1X{}Y-{}.5", dice.below(999), dice.below(9)),
        6 => "(COMMENT N5)M1".to_owned(),
        7 => format!("{}{}", &LETTERS[dice.below(26) as usize..], "+-/.,&"),
        _ => format!("N{number}G1X{}", dice.below(9_999)),
    }
    .into_bytes();
    if is_odd && dice.one_in(3) {
        let odd: [&[u8]; 17] = [
            b"g1",
            b";",
            b"(50%)",
            b"(AB",
            b"A)",
            b"\x00",
            b"\x7F",
            b"\xC3\xA4",
            b"_",
            b"A",
            b"#1=[2*3]",
            b"\x13",
            b"~&\t\x08",
            b"((A)B)",
            b"xy",
            b"\x80",
            b"\xFF",
        ];
        block.extend(*dice.pick(&odd));
    }
    block
}
