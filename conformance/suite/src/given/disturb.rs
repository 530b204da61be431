//! Noise on a trace's line: the same trace, in which what the plug-in receives is
//! damaged.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::Parity;
use softplug_trace::{
    BadKind, Files, Given, Item, Line, Payload, PayloadError, Piece, Trace, What,
};

/// How often a character is damaged, in a thousand each. The same noise on the same
/// trace is always the same.
///
/// The example of [`disturb`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Noise {
    /// Seed of the chance.
    pub seed: u64,
    /// One bit is turned; on a line with parity that shows.
    pub flip: u16,
    /// The character is lost.
    pub drop: u16,
    /// A character that nobody sent comes in front of it.
    pub insert: u16,
}

/// A trace after noise.
///
/// The example of [`disturb`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Disturbed {
    /// What came of it. Lines of which nothing is left are comments.
    pub trace: Trace,
    /// Characters that were turned, lost or put in.
    pub count: u32,
}

/// Damages what a trace gives to the plug-in. What it demands stays as it was.
///
/// ```
/// use softplug_conformance::{Noise, disturb, load};
/// use softplug_trace::NoFiles;
///
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// // One bit of each character that comes: XOFF and XON.
/// let noise = Noise { seed: 7, flip: 1_000, ..Noise::default() };
/// let disturbed = disturb(&case.trace, &NoFiles, noise)?;
/// assert_eq!(disturbed.count, 2);
/// assert!(!disturbed.trace.format().contains("< 0.001500 13"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The trace names a file that is not there.
pub fn disturb(trace: &Trace, files: &impl Files, noise: Noise) -> Result<Disturbed, PayloadError> {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&noise.seed.to_le_bytes());
    let line = &trace.front.line;
    let mut static_noise = Static {
        noise,
        data_bits: u32::from(line.data_bits).clamp(1, 8),
        has_parity: line.parity != Parity::None,
        random: ChaCha8Rng::from_seed(seed),
        count: 0,
    };
    let mut trace = trace.clone();
    for line in &mut trace.body {
        let Line::Entry(entry) = line else { continue };
        let What::Given(Given::Receive(payload) | Given::Burst(payload)) = &mut entry.what else {
            continue;
        };
        let before = static_noise.count;
        let damaged = static_noise.carry(&payload.pieces(files)?);
        if static_noise.count == before {
            continue;
        }
        if damaged.is_absent() {
            *line = Line::Comment(format!(" lost: {entry}"));
        } else {
            *payload = damaged;
        }
    }
    Ok(Disturbed { trace, count: static_noise.count })
}

struct Static {
    noise: Noise,
    data_bits: u32,
    has_parity: bool,
    random: ChaCha8Rng,
    count: u32,
}

impl Static {
    fn happens(&mut self, per_mille: u16) -> bool {
        let happens = per_mille > 0 && self.random.next_u32() % 1_000 < u32::from(per_mille);
        self.count += u32::from(happens);
        happens
    }

    fn carry(&mut self, pieces: &[Piece]) -> Payload {
        let mut items = Vec::new();
        for piece in pieces {
            match piece {
                Piece::Bytes(bytes) => {
                    for byte in bytes {
                        self.character(*byte, &mut items);
                    }
                }
                Piece::Bad { kind, byte } => items.push(Item::Bad { kind: *kind, byte: *byte }),
            }
        }
        Payload::new(items)
    }

    fn character(&mut self, byte: u8, items: &mut Vec<Item>) {
        if self.happens(self.noise.insert) {
            let stray = (self.random.next_u32() & ((1 << self.data_bits) - 1)) as u8;
            items.push(Item::Hex(vec![stray]));
        }
        if self.happens(self.noise.drop) {
            return;
        }
        if !self.happens(self.noise.flip) {
            return items.push(Item::Hex(vec![byte]));
        }
        let byte = byte ^ (1 << (self.random.next_u32() % self.data_bits)) as u8;
        items.push(if self.has_parity {
            Item::Bad { kind: BadKind::Parity, byte }
        } else {
            Item::Hex(vec![byte])
        });
    }
}
