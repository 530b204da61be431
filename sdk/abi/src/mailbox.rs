//! The mailbox: three regions of the plug-in's memory.

use crate::limits::{INPUT_BYTES, OUTPUT_BYTES, WORDS_BYTES};
use thiserror::Error;

/// Set in the result of `softplug_v1_step` when there is more output than fits;
/// the other bits are the length of what is there.
///
/// ```
/// use softplug_abi::MORE_OUTPUT;
///
/// let result: i32 = 0x4000_0200;
/// assert!(result & MORE_OUTPUT != 0);
/// assert_eq!(result & !MORE_OUTPUT, 512);
/// ```
pub const MORE_OUTPUT: i32 = 0x4000_0000;

/// A region of the plug-in's memory.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Region {
    /// Address of the first byte.
    pub address: u32,
    /// Length in bytes.
    pub capacity: u32,
}

impl Region {
    fn end(self) -> u64 {
        u64::from(self.address) + u64::from(self.capacity)
    }

    fn overlaps(self, other: Self) -> bool {
        u64::from(self.address) < other.end() && u64::from(other.address) < self.end()
    }
}

/// The mailbox descriptor: what `softplug_v1` points to.
///
/// Six u32: input address and capacity, output address and capacity, last
/// words' address and capacity. The region of last words begins with the
/// text's length (u32), the text (UTF-8) follows.
///
/// ```
/// use softplug_abi::{Mailbox, MailboxError};
///
/// let mut descriptor = [0; Mailbox::BYTES];
/// for (at, word) in [1_024_u32, 512, 2_048, 4_096, 8_192, 256].into_iter().enumerate() {
///     descriptor[4 * at..][..4].copy_from_slice(&word.to_le_bytes());
/// }
/// let mailbox = Mailbox::decode(descriptor, 65_536)?;
/// assert_eq!((mailbox.output.address, mailbox.output.capacity), (2_048, 4_096));
/// // The last words would not fit a memory of 8,400 bytes.
/// let error = Mailbox::decode(descriptor, 8_400).unwrap_err();
/// assert_eq!(error, MailboxError::OutOfMemory("last words"));
/// # Ok::<(), MailboxError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Mailbox {
    /// Where the host writes payloads of events.
    pub input: Region,
    /// Where the plug-in writes actions.
    pub output: Region,
    /// Where a panic leaves its text and place.
    pub words: Region,
}

/// Why a mailbox cannot be used.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum MailboxError {
    /// A region lies outside the memory.
    #[error("the {0} region lies outside the memory")]
    OutOfMemory(&'static str),
    /// A region is smaller or larger than the ABI allows.
    #[error("the {0} region has {1} bytes, outside the ABI's limits")]
    Size(&'static str, u32),
    /// Two regions share bytes.
    #[error("the {0} region and the {1} region overlap")]
    Overlap(&'static str, &'static str),
}

impl Mailbox {
    /// Length of the descriptor in bytes.
    pub const BYTES: usize = 24;

    /// Reads a descriptor and checks it against a memory of `memory_bytes`.
    pub fn decode(descriptor: [u8; Self::BYTES], memory_bytes: u64) -> Result<Self, MailboxError> {
        let mut words = [0_u32; 6];
        for (word, chunk) in words.iter_mut().zip(descriptor.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*chunk);
        }
        let [in_ptr, in_cap, out_ptr, out_cap, words_ptr, words_cap] = words;
        let mailbox = Self {
            input: Region { address: in_ptr, capacity: in_cap },
            output: Region { address: out_ptr, capacity: out_cap },
            words: Region { address: words_ptr, capacity: words_cap },
        };
        mailbox.check(memory_bytes)?;
        Ok(mailbox)
    }

    fn check(&self, memory_bytes: u64) -> Result<(), MailboxError> {
        let regions = [
            ("input", self.input, INPUT_BYTES),
            ("output", self.output, OUTPUT_BYTES),
            ("last words", self.words, WORDS_BYTES),
        ];
        for (name, region, limits) in &regions {
            if !limits.contains(&region.capacity) {
                return Err(MailboxError::Size(name, region.capacity));
            }
            if region.end() > memory_bytes {
                return Err(MailboxError::OutOfMemory(name));
            }
        }
        for (first, second) in [(0, 1), (0, 2), (1, 2)] {
            if regions[first].1.overlaps(regions[second].1) {
                return Err(MailboxError::Overlap(regions[first].0, regions[second].0));
            }
        }
        Ok(())
    }
}
