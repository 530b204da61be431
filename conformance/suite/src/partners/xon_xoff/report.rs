//! What a simulated control saw: the bytes, the alarms, the holds.

use sha2::{Digest, Sha256};
use softplug_abi::Micros;

use super::options::Keep;

/// A control's account of a transfer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ControlReport {
    /// The data that reached the buffer, executed or not.
    pub received: Received,
    /// Bytes of data that arrived on the line, lost ones included.
    pub arrived: u64,
    /// Bytes that the program's execution took out of the buffer.
    pub consumed: u64,
    /// Every lost byte.
    pub alarms: Vec<Alarm>,
    /// How often the line was held: repeated XOFFs count once.
    pub holds: u32,
    /// How long the line was held, from the last bit of XOFF to that of XON.
    pub held: Micros,
    /// For each hold, the characters that ended after XOFF had left.
    pub characters_after_xoff: Counts,
    /// Time from the start of the first byte of data to the end of the last,
    /// without that in which the line was held.
    pub allowed: Micros,
    /// How often the buffer ran empty in mid-program on an open line. Always 0
    /// where the rate of execution is 0: an empty buffer is then the rule.
    pub starved: u32,
    /// How long it was empty then.
    pub starved_for: Micros,
    /// The most bytes that stood in the buffer.
    pub largest_level: usize,
    /// The largest lateness of the control itself: how long after an event was
    /// due it was handled. Zero in virtual time.
    pub late: Micros,
    /// XONs that have left.
    pub xons: u32,
    /// XOFFs that have left.
    pub xoffs: u32,
    /// Bytes of its own program, or of its echo, that have left.
    pub punched: u64,
    /// Bytes of it that have not.
    pub punch_waiting: u64,
    /// For each time the other side stopped the control, the characters that
    /// still left.
    pub punched_after_xoff: Counts,
}

impl ControlReport {
    /// Bytes of data per second of the time in which sending was allowed; those
    /// that ended after XOFF are left out.
    pub fn rate_while_allowed(&self) -> f64 {
        if self.allowed <= Micros::ZERO {
            return 0.0;
        }
        let late: u64 = self.characters_after_xoff.0.iter().copied().map(u64::from).sum();
        self.arrived.saturating_sub(late) as f64 / self.allowed.as_secs_f64()
    }
}

/// A byte was lost in the control: its alarm.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Alarm {
    /// When.
    pub at: Micros,
    /// Which byte of the data, from 0.
    pub position: u64,
    /// Where it was lost.
    pub kind: AlarmKind,
    /// The control's own largest lateness up to then: an alarm in real time
    /// proves nothing against the sender when this is large.
    pub late: Micros,
}

/// Where a byte was lost.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum AlarmKind {
    /// The receive buffer was full: the sender did not stop in time.
    BufferOverflow,
    /// The receive FIFO was full: the control reacts too slowly for the line.
    Overrun,
}

/// The bytes received, as far as they were kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Received {
    /// All of them.
    Bytes(Vec<u8>),
    /// Their count and digest.
    Digest {
        /// How many.
        count: u64,
        /// SHA-256 of them.
        sha256: [u8; 32],
    },
}

impl Received {
    /// How many bytes.
    pub fn count(&self) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes.len() as u64,
            Self::Digest { count, .. } => *count,
        }
    }

    /// Whether they are the same as `bytes`.
    pub fn matches(&self, bytes: &[u8]) -> bool {
        match self {
            Self::Bytes(received) => received == bytes,
            Self::Digest { count, sha256 } => {
                *count == bytes.len() as u64 && *sha256 == <[u8; 32]>::from(Sha256::digest(bytes))
            }
        }
    }
}

/// A count per occasion, and its distribution.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Counts(pub Vec<u32>);

impl Counts {
    /// The largest; 0 where there is none.
    pub fn max(&self) -> u32 {
        self.0.iter().copied().max().unwrap_or(0)
    }

    /// The smallest count that at least `percent` of all do not exceed; 0 where
    /// there is none.
    pub fn percentile(&self, percent: u32) -> u32 {
        if self.0.is_empty() {
            return 0;
        }
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let rank = (sorted.len() as u64 * u64::from(percent.min(100))).div_ceil(100).max(1);
        sorted[rank as usize - 1]
    }
}

/// The bytes received so far, in the form that is kept.
#[derive(Debug)]
pub(super) enum Store {
    Bytes(Vec<u8>),
    Digest { count: u64, sha256: Box<Sha256> },
}

impl Store {
    pub(super) fn new(keep: Keep) -> Self {
        match keep {
            Keep::Bytes => Self::Bytes(Vec::new()),
            Keep::Digest => Self::Digest { count: 0, sha256: Box::default() },
        }
    }

    pub(super) fn push(&mut self, byte: u8) {
        match self {
            Self::Bytes(bytes) => bytes.push(byte),
            Self::Digest { count, sha256 } => {
                *count += 1;
                sha256.update([byte]);
            }
        }
    }

    pub(super) fn received(&self) -> Received {
        match self {
            Self::Bytes(bytes) => Received::Bytes(bytes.clone()),
            Self::Digest { count, sha256 } => {
                Received::Digest { count: *count, sha256: Sha256::clone(sha256).finalize().into() }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_counts_that_occurred() {
        let counts = Counts((1..=200).rev().collect());
        assert_eq!((counts.percentile(50), counts.percentile(99), counts.max()), (100, 198, 200));
        assert_eq!((counts.percentile(0), counts.percentile(100)), (1, 200));
        let none = Counts::default();
        assert_eq!((none.percentile(99), none.max()), (0, 0));
        assert_eq!(Counts(vec![7]).percentile(50), 7);
    }

    #[test]
    fn a_digest_tells_the_same_as_the_bytes() {
        for keep in [Keep::Bytes, Keep::Digest] {
            let mut store = Store::new(keep);
            b"G1X1\n".iter().for_each(|&byte| store.push(byte));
            let received = store.received();
            assert_eq!(received.count(), 5);
            assert!(received.matches(b"G1X1\n"));
            assert!(!received.matches(b"G1X2\n"));
            assert!(!received.matches(b"G1X1"));
        }
    }
}
