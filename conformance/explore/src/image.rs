//! What an instance's memory and globals hold, as times do not matter: each time is kept as what
//! it is ahead of now.

use crate::hash::Hash128;
use std::hash::Hash;
use std::sync::Arc;

/// Bytes that are kept or shared as one.
pub(crate) const BLOCK: usize = 256;

/// How far the clock of the second instance is ahead of the first's. Whatever differs by just
/// this is a time, in 64 bits or in the lower 32.
pub(crate) const AHEAD: i64 = 0x3_5A5A_1357;

/// The blocks that differ from a new instance's, and the globals.
#[derive(Debug)]
pub(crate) struct Image {
    /// In the order of their place.
    pub(crate) blocks: Vec<(u16, Arc<Block>)>,
    pub(crate) globals: Vec<Word>,
    /// Equal for equal images; of all of it.
    pub(crate) hash: u128,
}

/// A global.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Word {
    pub(crate) value: i64,
    pub(crate) is_time: bool,
}

#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) bytes: [u8; BLOCK],
    /// Where times stand in it.
    pub(crate) times: Vec<Place>,
    pub(crate) hash: u128,
}

/// Where a time stands in a block.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Place {
    pub(crate) at: u8,
    pub(crate) is_wide: bool,
}

/// What differs is no time, or one that is written in a way that cannot be told from others.
#[derive(Debug)]
pub(crate) struct NoTime {
    /// In the block.
    pub(crate) at: usize,
}

impl Image {
    pub(crate) fn new(blocks: Vec<(u16, Arc<Block>)>, globals: Vec<Word>) -> Self {
        let mut state = Hash128::new();
        for (place, block) in &blocks {
            (place, block.hash).hash(&mut state);
        }
        globals.hash(&mut state);
        let hash = state.finish_128();
        Self { blocks, globals, hash }
    }
}

impl Block {
    /// The block of which two instances hold these, the second with its clock ahead.
    pub(crate) fn new(
        here: &[u8; BLOCK],
        ahead: &[u8; BLOCK],
        now: i64,
    ) -> Result<Self, NoTime> {
        let mut bytes = *here;
        let mut times = Vec::new();
        if here != ahead {
            for at in (0..BLOCK).step_by(8) {
                relative(&mut bytes[at..at + 8], &ahead[at..at + 8], now, at, &mut times)?;
            }
        }
        let mut state = Hash128::new();
        (bytes, &times).hash(&mut state);
        let hash = state.finish_128();
        Ok(Self { bytes, times, hash })
    }

    /// Writes the block as an instance holds it at `now`.
    pub(crate) fn write(&self, to: &mut [u8], now: i64) {
        to.copy_from_slice(&self.bytes);
        for Place { at, is_wide } in &self.times {
            let at = usize::from(*at);
            if *is_wide {
                let time = wide(&to[at..at + 8]).wrapping_add(now);
                to[at..at + 8].copy_from_slice(&time.to_le_bytes());
            } else {
                let time = narrow(&to[at..at + 4]).wrapping_add(now as i32);
                to[at..at + 4].copy_from_slice(&time.to_le_bytes());
            }
        }
    }
}

/// Makes the times in eight bytes relative.
fn relative(
    bytes: &mut [u8],
    ahead: &[u8],
    now: i64,
    at: usize,
    times: &mut Vec<Place>,
) -> Result<(), NoTime> {
    if bytes == ahead {
        return Ok(());
    }
    let time = wide(bytes);
    if wide(ahead).wrapping_sub(time) == AHEAD {
        bytes.copy_from_slice(&time.wrapping_sub(now).to_le_bytes());
        times.push(Place { at: at as u8, is_wide: true });
        return Ok(());
    }
    for half in [0, 4] {
        let (bytes, ahead) = (&mut bytes[half..half + 4], &ahead[half..half + 4]);
        if bytes == ahead {
            continue;
        }
        let time = narrow(bytes);
        if narrow(ahead).wrapping_sub(time) != AHEAD as i32 {
            return Err(NoTime { at: at + half });
        }
        bytes.copy_from_slice(&time.wrapping_sub(now as i32).to_le_bytes());
        times.push(Place { at: (at + half) as u8, is_wide: false });
    }
    Ok(())
}

fn wide(bytes: &[u8]) -> i64 {
    i64::from_le_bytes(bytes.try_into().expect("eight bytes"))
}

fn narrow(bytes: &[u8]) -> i32 {
    i32::from_le_bytes(bytes.try_into().expect("four bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: i64 = 7_000_000_000;

    fn block_with(at: usize, bytes: &[u8]) -> [u8; BLOCK] {
        let mut block = [0; BLOCK];
        block[at..at + bytes.len()].copy_from_slice(bytes);
        block
    }

    fn block_of(time: i64) -> Block {
        let here = block_with(16, &time.to_le_bytes());
        let ahead = block_with(16, &(time + AHEAD).to_le_bytes());
        Block::new(&here, &ahead, NOW).unwrap()
    }

    #[test]
    fn times_are_kept_as_what_they_are_ahead() {
        let block = block_of(NOW + 5_000);
        assert_eq!(block.times, [Place { at: 16, is_wide: true }]);
        let mut written = [0; BLOCK];
        block.write(&mut written, 90);
        assert_eq!(written, block_with(16, &5_090_i64.to_le_bytes()));
    }

    #[test]
    fn times_in_32_bits_are_found() {
        let here = block_with(20, &(NOW as i32).to_le_bytes());
        let ahead = block_with(20, &((NOW + AHEAD) as i32).to_le_bytes());
        let block = Block::new(&here, &ahead, NOW).unwrap();
        assert_eq!(block.times, [Place { at: 20, is_wide: false }]);
        assert_eq!(block.bytes, [0; BLOCK]);
    }

    #[test]
    fn a_time_is_not_the_number_that_it_is_ahead() {
        let number = block_with(16, &5_000_i64.to_le_bytes());
        let number = Block::new(&number, &number, NOW).unwrap();
        let time = block_of(NOW + 5_000);
        assert_eq!(number.bytes, time.bytes);
        assert_ne!(number.hash, time.hash);
    }

    #[test]
    fn what_is_computed_of_a_time_is_none() {
        let here = block_with(8, &(NOW / 1_000).to_le_bytes());
        let ahead = block_with(8, &((NOW + AHEAD) / 1_000).to_le_bytes());
        assert_eq!(Block::new(&here, &ahead, NOW).unwrap_err().at, 8);
    }
}
