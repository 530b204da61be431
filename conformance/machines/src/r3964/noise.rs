//! A line that damages what goes over it, in both directions, with a log of
//! what it did.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::{LineErrorKind, LineParameters, Micros, ModemLines, Parity};

use crate::{Partner, Signal};

/// How often a line does what to a character, in a thousand each.
///
/// The example of [`Noisy`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Noise {
    /// Seed of the chance.
    pub seed: u64,
    /// One bit is turned; on a line with parity that shows.
    pub flip_one: u16,
    /// Two bits are turned, which parity does not show.
    pub flip_two: u16,
    /// The character is lost.
    pub drop: u16,
    /// It comes twice.
    pub double: u16,
    /// It and all behind it come later, by up to `longest_delay`.
    pub delay: u16,
    /// The longest delay.
    pub longest_delay: Micros,
    /// A character that nobody sent comes in front of it.
    pub insert: u16,
    /// It is read as damaged by a missing stop bit.
    pub framing: u16,
}

/// A character or break at an end of the line.
///
/// The example of [`Noisy`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Arrival {
    /// When.
    pub at: Micros,
    /// What.
    pub signal: Signal,
    /// When the other end had sent it; `None`: nobody sent this.
    pub sent_at: Option<Micros>,
    /// It is not what was sent.
    pub is_altered: bool,
}

/// A machine at the far end of such a line. What a driver gives to this, and
/// takes from it, goes over the line.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::r3964::{Arrival, Noise, Noisy, Options, Station};
/// use softplug_machines::{Partner, Signal};
///
/// // Every character comes with one wrong bit, and without parity that does not show.
/// let noise = Noise { seed: 1, flip_one: 1_000, ..Noise::default() };
/// let station = Station::new(Options::default())?;
/// let mut noisy = Noisy::new(station, LineParameters::new(9_600), noise);
/// noisy.receive(Micros(2_000), 0x02);
/// let Arrival { at, signal, is_altered, .. } = noisy.to_inner[0];
/// assert!(at == Micros(2_000) && is_altered && signal != Signal::Character(0x02));
/// assert_eq!(noisy.disturbances, [Micros(2_000)]);
/// # Ok::<(), softplug_machines::r3964::OptionsError>(())
/// ```
#[derive(Debug)]
pub struct Noisy<P> {
    /// The far end.
    pub inner: P,
    /// What has come to the far end.
    pub to_inner: Vec<Arrival>,
    /// What has come to the near end.
    pub to_outer: Vec<Arrival>,
    /// Times at which something was damaged, lost, doubled, delayed or put in.
    pub disturbances: Vec<Micros>,
    /// How long everything is under way, as over a network.
    pub transit: Micros,
    noise: Noise,
    line: LineParameters,
    random: ChaCha8Rng,
    inward: VecDeque<Arrival>,
    outward: VecDeque<Arrival>,
}

impl<P: Partner> Noisy<P> {
    /// A line to `inner`.
    pub fn new(inner: P, line: LineParameters, noise: Noise) -> Self {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&noise.seed.to_le_bytes());
        Self {
            inner,
            to_inner: Vec::new(),
            to_outer: Vec::new(),
            disturbances: Vec::new(),
            transit: Micros::ZERO,
            noise,
            line,
            random: ChaCha8Rng::from_seed(seed),
            inward: VecDeque::new(),
            outward: VecDeque::new(),
        }
    }

    /// The line is sound from now on.
    pub fn clear(&mut self) {
        self.noise = Noise::default();
    }

    fn happens(&mut self, per_mille: u16) -> bool {
        per_mille > 0 && self.random.next_u32() % 1_000 < u32::from(per_mille)
    }

    /// What becomes of a signal that was sent at `now`; behind what is under way.
    fn carry(&mut self, now: Micros, signal: Signal, behind: Option<Micros>) -> Vec<Arrival> {
        let earliest = behind.unwrap_or(now).max(now + self.transit);
        let sound = Arrival { at: earliest, signal, sent_at: Some(now), is_altered: false };
        let Signal::Character(byte) = signal else { return vec![sound] };
        let noise = self.noise;
        let before = self.disturbances.len();
        let mut arrivals = Vec::with_capacity(1);
        let mut at = earliest;
        if self.happens(noise.delay) {
            let most = noise.longest_delay.0.max(1).cast_unsigned();
            at = at + Micros((self.random.next_u64() % most).cast_signed());
            self.disturbances.push(now);
        }
        if self.happens(noise.insert) {
            let stray = [0x02, 0x03, 0x10, 0x15, self.random.next_u32() as u8];
            let byte = stray[self.random.next_u32() as usize % stray.len()];
            let signal = Signal::Character(byte);
            arrivals.push(Arrival { at, signal, sent_at: None, is_altered: true });
            self.disturbances.push(now);
        }
        if self.happens(noise.drop) {
            self.disturbances.push(now);
            return arrivals;
        }
        let mut arrival = Arrival { at, ..sound };
        if self.happens(noise.framing) {
            let kind = LineErrorKind::Framing;
            arrival.signal = Signal::LineError { kind, byte: Some(byte) };
            self.disturbances.push(now);
        } else if self.happens(noise.flip_one) {
            let byte = byte ^ self.bit();
            arrival.signal = if self.line.parity == Parity::None {
                Signal::Character(byte)
            } else {
                Signal::LineError { kind: LineErrorKind::Parity, byte: Some(byte) }
            };
            self.disturbances.push(now);
        } else if self.happens(noise.flip_two) {
            // The same bit twice is that one and the parity bit.
            let byte = byte ^ (self.bit() | self.bit());
            arrival.signal = Signal::Character(byte);
            self.disturbances.push(now);
        }
        arrival.is_altered = arrival.signal != signal;
        arrivals.push(arrival);
        if self.happens(noise.double) {
            arrivals.push(Arrival { sent_at: None, is_altered: true, ..arrival });
            self.disturbances.push(now);
        }
        // On a real line nothing overtakes, and what comes twice takes its time.
        let character = self.line.characters(1);
        if self.disturbances.len() > before {
            let mut earliest = earliest;
            for arrival in &mut arrivals {
                arrival.at = arrival.at.max(earliest);
                earliest = arrival.at + character;
            }
        }
        arrivals
    }

    fn bit(&mut self) -> u8 {
        1 << (self.random.next_u32() % u32::from(self.line.data_bits.clamp(1, 8)))
    }

    fn send(&mut self, now: Micros, signal: Signal) {
        let behind = self.inward.back().map(|last| last.at + self.line.characters(1));
        let arrivals = self.carry(now, signal, behind);
        self.inward.extend(arrivals);
        self.hand_over(now);
    }

    fn hand_over(&mut self, now: Micros) {
        while let Some(arrival) = self.inward.pop_front_if(|arrival| arrival.at <= now) {
            match arrival.signal {
                Signal::Character(byte) => self.inner.receive(now, byte),
                Signal::LineError { kind, byte } => self.inner.receive_damaged(now, kind, byte),
                Signal::ModemLines { lines, on } => self.inner.modem_lines(now, lines, on),
            }
            self.to_inner.push(arrival);
        }
    }
}

impl<P: Partner> Partner for Noisy<P> {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.send(now, Signal::Character(byte));
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, byte: Option<u8>) {
        self.send(now, Signal::LineError { kind, byte });
    }

    fn modem_lines(&mut self, now: Micros, lines: ModemLines, on: ModemLines) {
        self.inner.modem_lines(now, lines, on);
    }

    fn next_event(&self) -> Option<Micros> {
        let inward = self.inward.front().map(|arrival| arrival.at);
        let outward = self.outward.front().map(|arrival| arrival.at);
        [inward, outward, self.inner.next_event()].into_iter().flatten().min()
    }

    fn advance(&mut self, now: Micros) {
        self.hand_over(now);
        self.inner.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        loop {
            if let Signal::Character(byte) = self.poll_signal(now)? {
                return Some(byte);
            }
        }
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        while let Some(signal) = self.inner.poll_signal(now) {
            let behind = self.outward.back().map(|last| last.at + self.line.characters(1));
            let arrivals = self.carry(now, signal, behind);
            self.outward.extend(arrivals);
        }
        let arrival = self.outward.pop_front_if(|arrival| arrival.at <= now)?;
        self.to_outer.push(arrival);
        Some(arrival.signal)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Options, Station};
    use super::*;

    fn line(parity: Parity) -> LineParameters {
        LineParameters { parity, ..LineParameters::new(9_600) }
    }

    fn carried(parity: Parity, noise: Noise) -> (Vec<Arrival>, usize) {
        let station = Station::new(Options::default()).unwrap();
        let mut noisy = Noisy::new(station, line(parity), noise);
        for n in 0..1_000 {
            noisy.receive(Micros(n * 2_000), 0x55);
        }
        noisy.advance(Micros::from_secs(100));
        (noisy.to_inner, noisy.disturbances.len())
    }

    #[test]
    fn a_sound_line_alters_nothing() {
        let (arrivals, disturbances) = carried(Parity::None, Noise::default());
        assert_eq!(disturbances, 0);
        assert_eq!(arrivals.len(), 1_000);
        assert!(arrivals.iter().all(|arrival| {
            !arrival.is_altered
                && arrival.sent_at == Some(arrival.at)
                && arrival.signal == Signal::Character(0x55)
        }));
    }

    #[test]
    fn one_turned_bit_shows_with_parity_and_alters_without() {
        let noise = Noise { flip_one: 1_000, ..Noise::default() };
        let (with, _) = carried(Parity::Even, noise);
        let parity = |arrival: &Arrival| {
            matches!(arrival.signal, Signal::LineError { kind: LineErrorKind::Parity, .. })
        };
        assert!(with.iter().all(parity));
        let (without, disturbances) = carried(Parity::None, noise);
        assert_eq!(disturbances, 1_000);
        assert!(without.iter().all(|arrival| {
            matches!(arrival.signal, Signal::Character(byte) if (byte ^ 0x55).is_power_of_two())
        }));
    }

    #[test]
    fn lost_and_doubled_characters_are_logged() {
        let lost = carried(Parity::None, Noise { drop: 1_000, ..Noise::default() });
        assert_eq!((lost.0.len(), lost.1), (0, 1_000));
        let (doubled, disturbances) =
            carried(Parity::None, Noise { double: 500, ..Noise::default() });
        assert_eq!(doubled.len(), 1_000 + disturbances);
        let unsent = doubled.iter().filter(|arrival| arrival.sent_at.is_none()).count();
        assert_eq!(unsent, disturbances);
        assert!(doubled.is_sorted_by_key(|arrival| arrival.at));
    }
}
