//! What a simulated machine keeps of what it saw: the bytes, and counts.

use sha2::{Digest, Sha256};

/// What a control keeps of the bytes that it received.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::kept::{Keep, Received};
/// use softplug_machines::xon_xoff::{Control, ControlOptions};
///
/// let options = ControlOptions { keep: Keep::Digest, ..ControlOptions::default() };
/// let mut control = Control::new(options)?;
/// control.receive(Micros(1_042), b'%');
/// let received = control.report().received;
/// assert!(matches!(received, Received::Digest { count: 1, .. }) && received.matches(b"%"));
/// # Ok::<(), softplug_machines::xon_xoff::ControlOptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Keep {
    /// All of them.
    Bytes,
    /// Their count and SHA-256, for transfers of any length.
    Digest,
}

/// The bytes received, as far as they were kept.
///
/// ```
/// use softplug_machines::kept::Received;
///
/// let received = Received::Bytes(b"G1X1\n".to_vec());
/// assert_eq!(received.count(), 5);
/// assert!(received.matches(b"G1X1\n") && !received.matches(b"G1X2\n"));
/// ```
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
///
/// ```
/// use softplug_machines::kept::Counts;
///
/// // Characters that still came after each of five XOFFs.
/// let counts = Counts(vec![0, 1, 1, 2, 9]);
/// assert_eq!((counts.percentile(50), counts.percentile(80), counts.max()), (1, 2, 9));
/// ```
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
pub(crate) enum Store {
    Bytes(Vec<u8>),
    Digest { count: u64, sha256: Box<Sha256> },
}

impl Store {
    pub(crate) fn new(keep: Keep) -> Self {
        match keep {
            Keep::Bytes => Self::Bytes(Vec::new()),
            Keep::Digest => Self::Digest { count: 0, sha256: Box::default() },
        }
    }

    pub(crate) fn push(&mut self, byte: u8) {
        match self {
            Self::Bytes(bytes) => bytes.push(byte),
            Self::Digest { count, sha256 } => {
                *count += 1;
                sha256.update([byte]);
            }
        }
    }

    pub(crate) fn received(&self) -> Received {
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
