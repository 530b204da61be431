//! The two codes of a punched tape, ISO and EIA, as this control reads and punches them.

use super::options::{CharacterSet, Code, Eob, Options, Parity};

/// What a character on the line is to the reader.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Meaning {
    /// A character of the text, in ASCII.
    Text(u8),
    /// The end of a block.
    EndOfBlock,
    /// A CR that ends no block, or the LF beside one that does: no text.
    Return,
    /// No hole at all.
    Blank,
    /// All holes: struck out.
    Delete,
    /// The number of holes is wrong.
    BadParity,
    /// A sound code that the control knows no character for.
    Stray,
}

/// The characters that have a code in ISO.
const ISO: &[u8] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ +-/.,&()%:#*=[]\x08\x09";

/// The characters that have a code in EIA, and below them their codes.
const EIA: &[u8; 48] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ +-/.,&()%\x08\x09";
const EIA_CODES: [u8; 48] = [
    0x20, 0x01, 0x02, 0x13, 0x04, 0x15, 0x16, 0x07, 0x08, 0x19, // 0 to 9
    0x61, 0x62, 0x73, 0x64, 0x75, 0x76, 0x67, 0x68, 0x79, 0x51, 0x52, 0x43, 0x54, // A to M
    0x45, 0x46, 0x57, 0x58, 0x49, 0x32, 0x23, 0x34, 0x25, 0x26, 0x37, 0x38, 0x29, // N to Z
    0x10, 0x70, 0x40, 0x31, 0x6B, 0x3B, 0x0E, 0x1A, 0x4A, 0x0B, 0x2A, 0x3E,
];
const EIA_EOB: u8 = 0x80;

/// One code with one way of parity, as tables.
#[derive(Clone, Debug)]
pub(super) struct Tape {
    code: Code,
    meanings: Box<[Meaning; 256]>,
    punched: Box<[Option<u8>; 256]>,
}

impl Tape {
    pub(super) fn new(options: &Options) -> Self {
        let mut tape = Self {
            code: options.code,
            meanings: Box::new([Meaning::Stray; 256]),
            punched: Box::new([None; 256]),
        };
        match options.code {
            Code::Iso => tape.fill_iso(options),
            Code::Eia => tape.fill_eia(options),
        }
        tape
    }

    pub(super) fn code(&self) -> Code {
        self.code
    }

    /// What a character from the line means.
    pub(super) fn read(&self, byte: u8) -> Meaning {
        self.meanings[usize::from(byte)]
    }

    /// The code of a character of the text; `None` if it has none.
    pub(super) fn punch(&self, character: u8) -> Option<u8> {
        self.punched[usize::from(character)]
    }

    /// The codes of an end of block.
    pub(super) fn punch_eob(&self, eob: Eob) -> Vec<u8> {
        let characters: &[u8] = match eob {
            _ if self.code == Code::Eia => return vec![EIA_EOB],
            Eob::Lf => b"\n",
            Eob::CrLf => b"\r\n",
            Eob::LfCrCr => b"\n\r\r",
            Eob::LfCr => b"\n\r",
            Eob::Cr => b"\r",
        };
        characters.iter().filter_map(|character| self.punch(*character)).collect()
    }

    fn fill_iso(&mut self, options: &Options) {
        for character in 0..128_u8 {
            let even = with_even_parity(character);
            let (sound, odd) = (even, even ^ 0x80);
            let meaning = match character {
                0 => Meaning::Blank,
                0x7F => Meaning::Delete,
                b'\n' if options.cr_ends_block => Meaning::Return,
                b'\r' if options.cr_ends_block => Meaning::EndOfBlock,
                b'\n' => Meaning::EndOfBlock,
                b'\r' => Meaning::Return,
                _ if ISO.contains(&character) => Meaning::Text(character),
                b' '..=b'~' if options.characters == CharacterSet::Printable => {
                    Meaning::Text(character)
                }
                _ => Meaning::Stray,
            };
            self.meanings[usize::from(sound)] = meaning;
            let (read, punched) = match options.parity {
                Parity::Software => (Meaning::BadParity, sound),
                // The port has checked it, or nobody does: bit 7 says nothing.
                Parity::Uart | Parity::None => (meaning, character),
            };
            self.meanings[usize::from(odd)] = read;
            self.punched[usize::from(character)] = Some(punched);
        }
    }

    fn fill_eia(&mut self, options: &Options) {
        for code in 0..=255_u8 {
            if code.count_ones() % 2 == 0 {
                self.meanings[usize::from(code)] = Meaning::BadParity;
            }
        }
        self.meanings[0] = Meaning::Blank;
        self.meanings[0x7F] = Meaning::Delete;
        self.meanings[usize::from(EIA_EOB)] = Meaning::EndOfBlock;
        let standard = EIA.iter().copied().zip(EIA_CODES);
        for (character, code) in standard.chain(options.eia_codes.iter().copied()) {
            self.meanings[usize::from(code)] = Meaning::Text(character);
            self.punched[usize::from(character)] = Some(code);
        }
        self.punched[0] = Some(0);
    }
}

/// The character with even parity in bit 7.
pub(super) fn with_even_parity(character: u8) -> u8 {
    character | ((character.count_ones() as u8 & 1) << 7)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_eia_code_has_an_odd_number_of_holes_and_stands_once() {
        let tape = Tape::new(&Options { code: Code::Eia, ..Options::default() });
        for (character, code) in EIA.iter().zip(EIA_CODES) {
            assert_eq!(code.count_ones() % 2, 1, "{character:#04x}");
            assert_eq!(tape.read(code), Meaning::Text(*character));
            assert_eq!(tape.punch(*character), Some(code));
        }
        assert_eq!(tape.read(0x80), Meaning::EndOfBlock);
        assert_eq!(tape.read(0x03), Meaning::BadParity);
        assert_eq!(tape.read(0x5B), Meaning::Stray);
        assert_eq!(tape.read(0x1F), Meaning::Stray);
        assert_eq!((tape.punch(b'#'), tape.punch(b'a')), (None, None));
        // The digits that look like control codes without parity.
        assert_eq!(tape.punch_eob(Eob::CrLf), [0x80]);
        assert_eq!([b'3', b'5', b'6'].map(|digit| tape.punch(digit)), [0x13, 0x15, 0x16].map(Some));
    }

    #[test]
    fn iso_makes_and_checks_even_parity() {
        let tape = Tape::new(&Options { parity: Parity::Software, ..Options::default() });
        let table = [(b'1', 0xB1), (b'O', 0xCF), (b' ', 0xA0), (b'%', 0xA5), (b':', 0x3A)];
        for (character, code) in table {
            assert_eq!(tape.punch(character), Some(code));
            assert_eq!(tape.read(code), Meaning::Text(character));
            assert_eq!(tape.read(code ^ 0x80), Meaning::BadParity);
        }
        assert_eq!(tape.punch_eob(Eob::LfCrCr), [0x0A, 0x8D, 0x8D]);
        assert_eq!(tape.read(with_even_parity(b'a')), Meaning::Stray);
        let tape = Tape::new(&Options { parity: Parity::None, ..Options::default() });
        assert_eq!((tape.read(0x31), tape.read(0xB1)), (Meaning::Text(b'1'), Meaning::Text(b'1')));
        let printable = Options { characters: CharacterSet::Printable, ..Options::default() };
        assert_eq!(Tape::new(&printable).read(b'a'), Meaning::Text(b'a'));
        let cr = Tape::new(&Options { cr_ends_block: true, ..Options::default() });
        assert_eq!((cr.read(b'\r'), cr.read(b'\n')), (Meaning::EndOfBlock, Meaning::Return));
    }
}
