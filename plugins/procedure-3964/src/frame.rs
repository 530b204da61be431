//! A block on the wire: doubled DLE, the end `DLE ETX`, the block check.

use crate::Options;
use softplug_plugin::State;
use softplug_plugin::parts::Block;

pub(crate) const STX: u8 = 0x02;
pub(crate) const ETX: u8 = 0x03;
pub(crate) const DLE: u8 = 0x10;
pub(crate) const NAK: u8 = 0x15;

/// Whether data would end a block too early, were its DLE not doubled.
pub(crate) fn holds_end(data: &[u8]) -> bool {
    data.windows(2).any(|pair| matches!(pair, [DLE, ETX]))
}

/// Whether data hold a byte that has more bits than a character of the line.
pub(crate) fn holds_wider(data: &[u8], data_bits: u8) -> bool {
    data_bits < 8 && data.iter().any(|byte| byte >> data_bits != 0)
}

/// Where in a block the encoder or the decoder stands.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Part {
    /// Data.
    #[default]
    Data,
    /// A DLE has gone; the encoder doubles it, the decoder waits for its partner.
    AfterDle,
    /// The DLE of the end has gone.
    Etx,
    /// The block check is next.
    Bcc,
    /// All has gone.
    End,
}

/// From data to what follows STX on the wire, byte by byte.
#[derive(Copy, Clone, Debug, Default, State)]
pub(crate) struct Encoder {
    part: Part,
    /// How many data bytes have gone.
    at: u16,
    bcc: u8,
}

impl Encoder {
    /// The next byte of the block; `None` behind its last one.
    pub(crate) fn next(&mut self, options: &Options, data: &[u8]) -> Option<u8> {
        let byte = match self.part {
            Part::Data => {
                let byte = data.get(usize::from(self.at)).copied();
                self.at += 1;
                match byte {
                    Some(DLE) if options.doubling => self.part = Part::AfterDle,
                    Some(_) => {}
                    None => self.part = Part::Etx,
                }
                byte.unwrap_or(DLE)
            }
            Part::AfterDle => {
                self.part = Part::Data;
                DLE
            }
            Part::Etx => {
                self.part = if options.bcc { Part::Bcc } else { Part::End };
                ETX
            }
            // Where the data ended is no longer needed, and tells the first from the second.
            // Raw: it is not doubled even if it is a DLE.
            Part::Bcc => {
                self.part = Part::End;
                self.bcc
            }
            Part::End => return None,
        };
        self.bcc ^= byte;
        Some(byte)
    }

    /// Whether the whole block was given out.
    pub(crate) fn is_at_end(self) -> bool {
        self.part == Part::End
    }
}

/// What a received byte was.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Step {
    /// Part of the block.
    Inside,
    /// Data beyond the limit.
    TooLong,
    /// A DLE before it that means nothing.
    LoneDle,
    /// The last byte, and whether the block check was right.
    End(bool),
}

/// From what follows STX on the wire to data, byte by byte.
#[derive(Copy, Clone, Debug, Default, State)]
pub(crate) struct Decoder {
    part: Part,
    bcc: u8,
}

impl Decoder {
    /// Takes a byte; data goes into `block`, up to `limit` bytes.
    pub(crate) fn take<const N: usize>(
        &mut self,
        options: &Options,
        block: &mut Block<N>,
        limit: u16,
        byte: u8,
    ) -> Step {
        let bcc = self.bcc;
        self.bcc ^= byte;
        let mut data = |byte| {
            if block.len() < limit.into() && block.push(byte) {
                Step::Inside
            } else {
                Step::TooLong
            }
        };
        match (self.part, byte) {
            (Part::Bcc, _) => return Step::End(byte == bcc),
            (Part::End, _) => return Step::Inside,
            (Part::AfterDle, ETX) if options.bcc => {
                self.part = Part::Bcc;
                return Step::Inside;
            }
            (Part::AfterDle, ETX) => return Step::End(true),
            (Part::AfterDle, _) if options.doubling => {
                self.part = Part::Data;
                if byte != DLE {
                    return Step::LoneDle;
                }
            }
            // Not doubled: a DLE is data unless ETX follows, and the next one may
            // begin the end.
            (Part::AfterDle, DLE) => {}
            (Part::AfterDle, _) => {
                self.part = Part::Data;
                if data(DLE) == Step::TooLong {
                    return Step::TooLong;
                }
            }
            (_, DLE) => {
                self.part = Part::AfterDle;
                return Step::Inside;
            }
            _ => {}
        }
        data(byte)
    }

    /// Passes over all that still comes.
    pub(crate) fn close(&mut self) {
        self.part = Part::End;
    }

    /// Whether the last byte was a DLE whose partner has not come.
    pub(crate) fn is_after_dle(self) -> bool {
        self.part == Part::AfterDle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const R3964: Options = Options { bcc: true, doubling: true, ..plain() };
    const PLAIN_3964: Options = Options { doubling: true, ..plain() };
    const UNDOUBLED: Options = Options { bcc: true, ..plain() };

    const fn plain() -> Options {
        Options {
            bcc: false,
            handshake: true,
            doubling: false,
            priority: crate::Priority::Low,
            qvz: 0,
            zvz: 220,
            bwz: 4_000,
            buffer_wait: 400,
            setup_attempts: 6,
            transmission_attempts: 6,
            block_size: 1_024,
            split: false,
            nak_at_start: false,
            nak_on_garbage: true,
            layer: crate::Layer::None,
            reaction_timeout: 20_000,
        }
    }

    fn encode(options: &Options, data: &[u8]) -> Vec<u8> {
        let mut encoder = Encoder::default();
        let wire = std::iter::from_fn(|| encoder.next(options, data)).collect();
        assert!(encoder.is_at_end());
        wire
    }

    /// The data, what the last byte was, and how many bytes were taken.
    fn decode(options: &Options, limit: u16, wire: &[u8]) -> (Vec<u8>, Step, usize) {
        let mut decoder = Decoder::default();
        let mut block = Block::<1_024>::new();
        for (at, byte) in wire.iter().enumerate() {
            let step = decoder.take(options, &mut block, limit, *byte);
            if step != Step::Inside {
                return (block.as_slice().to_vec(), step, at + 1);
            }
        }
        (block.as_slice().to_vec(), Step::Inside, wire.len())
    }

    /// Data, and what stands on the wire for it after the set-up.
    const VECTORS: &[(&[u8], &[u8])] = &[
        (&[0x31, 0x32, 0x33], &[0x31, 0x32, 0x33, 0x10, 0x03, 0x23]),
        (&[], &[0x10, 0x03, 0x13]),
        (&[0x10], &[0x10, 0x10, 0x10, 0x03, 0x13]),
        (&[0x10, 0x41, 0x10], &[0x10, 0x10, 0x41, 0x10, 0x10, 0x10, 0x03, 0x52]),
        (&[0x10, 0x03], &[0x10, 0x10, 0x03, 0x10, 0x03, 0x10]),
        (&[0x02, 0x03, 0x10, 0x15], &[0x02, 0x03, 0x10, 0x10, 0x15, 0x10, 0x03, 0x07]),
        (&[0x41, 0x42], &[0x41, 0x42, 0x10, 0x03, 0x10]),
        (&[0x11], &[0x11, 0x10, 0x03, 0x02]),
        (&[0x06], &[0x06, 0x10, 0x03, 0x15]),
        (&[0x13], &[0x13, 0x10, 0x03, 0x00]),
        // Recorded from a Buderus KM271.
        (
            &[0x04, 0x00, 0x07, 0x01, 0xC3, 0x2C, 0xC0, 0x79],
            &[0x04, 0x00, 0x07, 0x01, 0xC3, 0x2C, 0xC0, 0x79, 0x10, 0x03, 0x47],
        ),
        // RK512: FETCH of DB 5 from word 10, 7 words; SEND of a word; reactions.
        (
            &[0, 0, 0x45, 0x44, 0x05, 0x0A, 0x00, 0x07, 0xFF, 0xFF],
            &[0, 0, 0x45, 0x44, 0x05, 0x0A, 0x00, 0x07, 0xFF, 0xFF, 0x10, 0x03, 0x1A],
        ),
        (
            &[0, 0, 0x41, 0x44, 0x10, 0x01, 0x00, 0x01, 0xFF, 0xFF, 0x12, 0x34],
            &[
                0, 0, 0x41, 0x44, 0x10, 0x10, 0x01, 0x00, 0x01, 0xFF, 0xFF, 0x12, 0x34, 0x10, 0x03,
                0x30,
            ],
        ),
        (&[0, 0, 0, 0], &[0, 0, 0, 0, 0x10, 0x03, 0x13]),
        (
            &[0, 0, 0, 0, 0x12, 0x34, 0x10, 0x03],
            &[0, 0, 0, 0, 0x12, 0x34, 0x10, 0x10, 0x03, 0x10, 0x03, 0x36],
        ),
    ];

    #[test]
    fn vectors_hold_in_both_directions() {
        for (data, wire) in VECTORS {
            assert_eq!(encode(&R3964, data), *wire, "{data:02X?}");
            let whole = (data.to_vec(), Step::End(true), wire.len());
            assert_eq!(decode(&R3964, 1_024, wire), whole, "{wire:02X?}");
            // 3964 is the same without the last byte.
            let wire = &wire[..wire.len() - 1];
            assert_eq!(encode(&PLAIN_3964, data), wire, "{data:02X?}");
            let whole = (data.to_vec(), Step::End(true), wire.len());
            assert_eq!(decode(&PLAIN_3964, 1_024, wire), whole, "{wire:02X?}");
        }
    }

    #[test]
    fn every_wrong_block_check_is_seen() {
        for bcc in 0..=u8::MAX {
            let (_, step, _) = decode(&R3964, 1_024, &[0x31, 0x32, 0x33, 0x10, 0x03, bcc]);
            assert_eq!(step, Step::End(bcc == 0x23), "{bcc:02X}");
        }
    }

    #[test]
    fn a_dle_with_a_wrong_partner_is_no_data() {
        for partner in (0..=u8::MAX).filter(|byte| ![DLE, ETX].contains(byte)) {
            let (data, step, _) = decode(&R3964, 1_024, &[0x41, DLE, partner]);
            assert_eq!((data, step), (vec![0x41], Step::LoneDle), "{partner:02X}");
        }
    }

    #[test]
    fn data_beyond_the_limit_is_too_long_however_it_is_doubled() {
        for (limit, data, length) in [(3, &[1, 2, 3][..], 6), (2, &[0x10, 0x10], 7)] {
            let mut wire = encode(&R3964, data);
            assert_eq!(decode(&R3964, limit, &wire), (data.to_vec(), Step::End(true), length));
            wire.insert(0, 0x41);
            let (kept, step, _) = decode(&R3964, limit, &wire);
            assert_eq!((kept.len(), step), (usize::from(limit), Step::TooLong));
        }
    }

    proptest! {
        #[test]
        fn any_data_comes_back(data in prop::collection::vec(any::<u8>(), 0..1_024)) {
            for options in [&R3964, &PLAIN_3964] {
                let wire = encode(options, &data);
                let length = wire.len();
                prop_assert_eq!(
                    decode(options, 1_024, &wire),
                    (data.clone(), Step::End(true), length)
                );
            }
        }

        #[test]
        fn undoubled_data_comes_back_unless_it_holds_the_end(
            mut data in prop::collection::vec(prop_oneof![Just(DLE), Just(ETX), any::<u8>()], 0..64),
        ) {
            for at in 1..data.len() {
                if data[at - 1..=at] == [DLE, ETX] {
                    data[at] = DLE;
                }
            }
            let wire = encode(&UNDOUBLED, &data);
            prop_assert_eq!(wire.len(), data.len() + 3);
            prop_assert_eq!(
                decode(&UNDOUBLED, 1_024, &wire),
                (data.clone(), Step::End(true), wire.len())
            );
        }
    }
}
