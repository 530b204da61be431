//! Other letters and digits in the place of those that passed.
//!
//! Class by class: capital by capital, small letter by small letter, digit by
//! digit. Of each class there are two stand-ins, one with an even number of ones
//! and one with an odd: parity in the eighth bit and the length of everything
//! stay right. Where the block check of 3964R is known to be, it is changed by
//! what the data was changed by: right stays right, and wrong stays wrong.

const STX: u8 = 0x02;
const ETX: u8 = 0x03;
const DLE: u8 = 0x10;
const NAK: u8 = 0x15;
/// Bytes of an RK512 telegram's head, whose letters are commands.
const HEAD: usize = 10;

/// Which way bytes go.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Way {
    Given,
    Sent,
}

/// What a profile puts around its data.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Framing {
    None,
    /// Blocks of 3964; with the check of 3964R or without.
    Blocks {
        check: bool,
        heads: bool,
    },
}

/// Redacts both directions of a line.
#[derive(Debug)]
pub(super) struct Redactor {
    framing: Framing,
    blocks: [Block; 2],
}

/// Where one direction is in a block of 3964.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Block {
    Idle,
    /// STX was sent.
    Asked,
    Data {
        place: usize,
        first: u8,
        after_dle: bool,
        delta: u8,
    },
    Check {
        delta: u8,
    },
}

impl Redactor {
    pub(super) fn new(profile: &str) -> Self {
        let framing = match profile {
            "r3964" | "r3964-simplified" => Framing::Blocks { check: true, heads: false },
            "rk512" => Framing::Blocks { check: true, heads: true },
            "3964" => Framing::Blocks { check: false, heads: false },
            _ => Framing::None,
        };
        Self { framing, blocks: [Block::Idle; 2] }
    }

    /// Says at the top of the trace what was done to it.
    pub(super) fn notice(&self) -> &'static str {
        match self.framing {
            Framing::Blocks { check: true, .. } => {
                " Redacted: letters and digits stand for others of their class. Block checks were changed along."
            }
            _ => {
                " Redacted: letters and digits stand for others of their class. Sums over the data no longer fit."
            }
        }
    }

    /// What is written for this byte.
    pub(super) fn byte(&mut self, way: Way, byte: u8) -> u8 {
        match self.framing {
            Framing::None => stand_in(byte),
            Framing::Blocks { check, heads } => self.in_block(way, byte, check, heads),
        }
    }

    fn in_block(&mut self, way: Way, byte: u8, check: bool, heads: bool) -> u8 {
        let (own, other) = (way as usize, 1 - way as usize);
        if byte == NAK && matches!(self.blocks[own], Block::Idle | Block::Asked) {
            // The receiver ends the block, or refuses it.
            self.blocks[other] = Block::Idle;
        }
        let start = Block::Data { place: 0, first: byte, after_dle: false, delta: 0 };
        if byte == DLE && self.blocks[other] == Block::Asked {
            self.blocks[other] = Block::Data { place: 0, first: 0, after_dle: false, delta: 0 };
            return byte;
        }
        match self.blocks[own] {
            Block::Idle | Block::Asked if byte == STX => {
                self.blocks[own] = Block::Asked;
                byte
            }
            Block::Idle if matches!(byte, DLE | NAK) => byte,
            Block::Idle => stand_in(byte),
            // Without a handshake the data follows at once.
            Block::Asked => {
                self.blocks[own] = start;
                self.in_block(way, byte, check, heads)
            }
            Block::Check { delta } => {
                self.blocks[own] = Block::Idle;
                byte ^ delta
            }
            Block::Data { after_dle: true, delta, .. } if byte == ETX => {
                self.blocks[own] = if check { Block::Check { delta } } else { Block::Idle };
                byte
            }
            Block::Data { place, first, after_dle, delta } => {
                let first = if place == 0 { byte } else { first };
                let is_head = heads && place < HEAD && matches!(first, 0x00 | 0xFF);
                let new = if is_head { byte } else { stand_in(byte) };
                self.blocks[own] = Block::Data {
                    place: place + 1,
                    first,
                    after_dle: byte == DLE && !after_dle,
                    delta: delta ^ byte ^ new,
                };
                new
            }
        }
    }
}

/// Of the same class, with as many ones modulo two.
fn stand_in(byte: u8) -> u8 {
    let (even, odd) = match byte & 0x7F {
        b'A'..=b'Z' => (b'U', b'X'),
        b'a'..=b'z' => (b'x', b'u'),
        b'0'..=b'9' => (b'0', b'1'),
        _ => return byte,
    };
    let low = if (byte & 0x7F).count_ones().is_multiple_of(2) { even } else { odd };
    low | byte & 0x80
}

#[cfg(test)]
mod tests {
    use super::*;

    fn redact(profile: &str, passed: &[(Way, &[u8])]) -> Vec<Vec<u8>> {
        let mut redactor = Redactor::new(profile);
        let mut all = |(way, bytes): &(Way, &[u8])| {
            bytes.iter().map(|byte| redactor.byte(*way, *byte)).collect()
        };
        passed.iter().map(&mut all).collect()
    }

    #[test]
    fn classes_lengths_controls_and_parity_stay() {
        for byte in 0..=255_u8 {
            let new = stand_in(byte);
            assert_eq!(new.count_ones() % 2, byte.count_ones() % 2, "{byte:02X}");
            assert_eq!(new & 0x80, byte & 0x80);
            let class = |byte: u8| {
                let low = byte & 0x7F;
                let is = [low.is_ascii_uppercase(), low.is_ascii_lowercase(), low.is_ascii_digit()];
                is.iter().position(|is| *is)
            };
            assert_eq!(class(new), class(byte));
            if class(byte).is_none() {
                assert_eq!(new, byte);
            }
        }
        let program = b"%\r\nO1234 (SECRET part)\r\nG1 X-12.5\r\n\x13\x11%";
        let new = &redact("xon-xoff", &[(Way::Sent, program)])[0];
        assert_eq!(new.len(), program.len());
        assert_ne!(&new[..], &program[..]);
        assert!(new.starts_with(b"%\r\n") && new.ends_with(b"\r\n\x13\x11%"));
        let text = String::from_utf8_lossy(new);
        assert!(!text.contains("SECRET") && !text.contains("part"), "{text}");
    }

    fn check(data: &[u8]) -> u8 {
        data.iter().fold(0, |sum, byte| sum ^ byte)
    }

    #[test]
    fn a_right_block_check_stays_right_and_a_wrong_one_wrong() {
        let mut block = b"AB\x10\x1012\x10\x03".to_vec();
        let right = check(&block);
        for wrong in [0, 0x55] {
            block.truncate(8);
            block.push(right ^ wrong);
            let passed: &[(Way, &[u8])] = &[
                (Way::Sent, b"\x02"),
                (Way::Sent, b"\x02"),
                (Way::Given, b"\x10"),
                (Way::Sent, &block),
                (Way::Given, b"\x10"),
            ];
            let new = redact("r3964", passed);
            let (data, sum) = new[3].split_at(8);
            assert_eq!(data, b"UU\x10\x1011\x10\x03".as_slice());
            assert_eq!(sum[0] ^ check(data), wrong);
            assert_eq!(
                (&new[0][..], &new[2][..], &new[4][..]),
                (&b"\x02"[..], &b"\x10"[..], &b"\x10"[..])
            );
        }
    }

    #[test]
    fn an_rk512_head_keeps_its_letters() {
        let block = b"\x00\x00AD\x05\x0A\x00\x02\xFF\xFFab\x10\x03";
        let mut with_check = block.to_vec();
        with_check.push(check(block));
        let passed: &[(Way, &[u8])] =
            &[(Way::Given, b"\x02"), (Way::Sent, b"\x10"), (Way::Given, &with_check)];
        let new = &redact("rk512", passed)[2];
        assert_eq!(&new[..10], &block[..10]);
        assert_ne!(&new[10..12], b"ab");
        assert_eq!(check(&new[..14]), new[14]);
    }
}
