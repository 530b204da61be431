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

/// Blocks with their places, in order.
pub(crate) type Placed = Vec<(u16, Arc<Block>)>;

/// The blocks that differ from a new instance's, and the globals.
#[derive(Debug)]
pub(crate) struct Image {
    /// In the order of their place.
    pub(crate) blocks: Placed,
    /// Where times stand that begin in one block and end in the next.
    pub(crate) across: Vec<Time>,
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
    /// Where times stand in it, those that go across left out.
    pub(crate) times: Vec<Time>,
    /// A time begins or ends here that goes across.
    pub(crate) has_across: bool,
    pub(crate) hash: u128,
}

/// Where a time stands, in a block or in memory.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Time {
    pub(crate) at: u32,
    /// It has 64 bits, not 32.
    pub(crate) is_wide: bool,
}

/// What differs is no time.
#[derive(Debug)]
pub(crate) struct NoTime {
    /// In memory.
    pub(crate) address: usize,
}

impl Image {
    pub(crate) fn new(blocks: Placed, across: Vec<Time>, globals: Vec<Word>) -> Self {
        let mut state = Hash128::new();
        for (place, block) in &blocks {
            (place, block.hash).hash(&mut state);
        }
        (&across, &globals).hash(&mut state);
        let hash = state.finish_128();
        Self { blocks, across, globals, hash }
    }

    /// Whether it matters when it was made.
    pub(crate) fn has_times(&self) -> bool {
        self.blocks.iter().any(|(_, block)| !block.is_timeless())
            || self.globals.iter().any(|global| global.is_time)
    }
}

impl Block {
    fn new(bytes: [u8; BLOCK], times: Vec<Time>, has_across: bool) -> Self {
        let mut state = Hash128::new();
        (bytes, &times, has_across).hash(&mut state);
        let hash = state.finish_128();
        Self { bytes, times, has_across, hash }
    }

    /// Writes the block as an instance holds it at `now`; times that go across are left as they
    /// are kept.
    pub(crate) fn write(&self, to: &mut [u8], now: i64) {
        to.copy_from_slice(&self.bytes);
        self.times.iter().for_each(|time| time.add(to, now));
    }

    /// Whether it looks the same in memory at any time.
    pub(crate) fn is_timeless(&self) -> bool {
        self.times.is_empty() && !self.has_across
    }
}

impl Time {
    /// Adds to the time that stands here, in place.
    pub(crate) fn add(self, bytes: &mut [u8], time: i64) {
        let place = &mut bytes[self.at as usize..];
        if self.is_wide {
            let place = place.first_chunk_mut().expect("it lies within");
            *place = i64::from_le_bytes(*place).wrapping_add(time).to_le_bytes();
        } else {
            let place = place.first_chunk_mut().expect("it lies within");
            *place = i32::from_le_bytes(*place).wrapping_add(time as i32).to_le_bytes();
        }
    }

    fn width(self) -> usize {
        if self.is_wide { 8 } else { 4 }
    }

    /// The time whose lowest byte is the first that differs.
    fn find(here: &[u8], ahead: &[u8], address: usize) -> Result<Self, NoTime> {
        let at = address as u32;
        if let (Some(one), Some(other)) =
            (here[address..].first_chunk(), ahead[address..].first_chunk())
            && i64::from_le_bytes(*other).wrapping_sub(i64::from_le_bytes(*one)) == AHEAD
        {
            return Ok(Self { at, is_wide: true });
        }
        if let (Some(one), Some(other)) =
            (here[address..].first_chunk(), ahead[address..].first_chunk())
            && i32::from_le_bytes(*other).wrapping_sub(i32::from_le_bytes(*one)) == AHEAD as i32
        {
            return Ok(Self { at, is_wide: false });
        }
        Err(NoTime { address })
    }
}

/// Makes blocks of two memories, in the order of their addresses.
pub(crate) struct Blocks<'a> {
    here: &'a [u8],
    ahead: &'a [u8],
    now: i64,
    across: Vec<Time>,
}

impl<'a> Blocks<'a> {
    /// Of the second memory all times are [`AHEAD`].
    pub(crate) fn new(here: &'a [u8], ahead: &'a [u8], now: i64) -> Self {
        Self { here, ahead, now, across: Vec::new() }
    }

    /// Whether a time that began in a block before ends behind this address.
    pub(crate) fn goes_across(&self, address: usize) -> bool {
        self.across.last().is_some_and(|time| time.at as usize + time.width() > address)
    }

    /// The block that begins at this address.
    pub(crate) fn block(&mut self, address: usize) -> Result<Block, NoTime> {
        let end = address + BLOCK;
        let mut bytes: [u8; BLOCK] = *self.here[address..].first_chunk().expect("memory has pages");
        let mut times = Vec::new();
        let mut has_across = false;
        let mut at = address;
        if let Some(time) = self.across.last().filter(|_| self.goes_across(address)) {
            has_across = true;
            let (from, width) = (time.at as usize, time.width());
            let relative = self.relative(*time);
            at = from + width;
            bytes[..at - address].copy_from_slice(&relative[address - from..width]);
        }
        while let Some(first) = (at..end).find(|at| self.here[*at] != self.ahead[*at]) {
            let time = Time::find(self.here, self.ahead, first)?;
            let relative = self.relative(time);
            at = first + time.width();
            let within = at.min(end) - first;
            bytes[first - address..][..within].copy_from_slice(&relative[..within]);
            if at > end {
                has_across = true;
                self.across.push(time);
            } else {
                times.push(Time { at: (first - address) as u32, ..time });
            }
        }
        Ok(Block::new(bytes, times, has_across))
    }

    /// The bytes of a time as it is ahead of now.
    fn relative(&self, time: Time) -> [u8; 8] {
        let mut bytes = [0; 8];
        let width = time.width();
        bytes[..width].copy_from_slice(&self.here[time.at as usize..][..width]);
        Time { at: 0, ..time }.add(&mut bytes, -self.now);
        bytes
    }

    /// The times that go across two blocks.
    pub(crate) fn into_across(self) -> Vec<Time> {
        self.across
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: i64 = 7_000_000_000;

    /// Two blocks in which something stands at an address, of both instances.
    fn blocks(at: usize, here: &[u8], ahead: &[u8]) -> Result<(Image, Vec<u8>), NoTime> {
        let mut memories = [vec![0; 2 * BLOCK], vec![0; 2 * BLOCK]];
        memories[0][at..at + here.len()].copy_from_slice(here);
        memories[1][at..at + ahead.len()].copy_from_slice(ahead);
        let [here, ahead] = &memories;
        let mut blocks = Blocks::new(here, ahead, NOW);
        let first = blocks.block(0)?;
        let second = blocks.block(BLOCK)?;
        let both = vec![(0, Arc::new(first)), (1, Arc::new(second))];
        Ok((Image::new(both, blocks.into_across(), Vec::new()), here.clone()))
    }

    fn with_time(at: usize, time: i64) -> (Image, Vec<u8>) {
        blocks(at, &time.to_le_bytes(), &(time + AHEAD).to_le_bytes()).unwrap()
    }

    fn written(image: &Image, now: i64) -> Vec<u8> {
        let mut memory = vec![0; 2 * BLOCK];
        for (place, block) in &image.blocks {
            block.write(&mut memory[usize::from(*place) * BLOCK..][..BLOCK], now);
        }
        image.across.iter().for_each(|time| time.add(&mut memory, now));
        memory
    }

    #[test]
    fn times_come_back_wherever_they_stand() {
        for at in [0, 16, 17, BLOCK - 8, BLOCK - 7, BLOCK - 3, BLOCK - 1, BLOCK, BLOCK + 100] {
            let (image, memory) = with_time(at, NOW + 5_000);
            assert_eq!(written(&image, NOW), memory, "{at}");
            // Later, the same is as far ahead as it was.
            let (_, later) = with_time(at, NOW + 90 + 5_000);
            assert_eq!(written(&image, NOW + 90), later, "{at}");
        }
    }

    #[test]
    fn times_in_32_bits_are_found() {
        let (here, ahead) = ((NOW as i32 + 7), ((NOW + AHEAD) as i32 + 7));
        let (image, memory) = blocks(20, &here.to_le_bytes(), &ahead.to_le_bytes()).unwrap();
        assert_eq!(image.blocks[0].1.bytes[20..24], 7_i32.to_le_bytes());
        assert_eq!(written(&image, NOW), memory);
    }

    #[test]
    fn a_time_is_not_the_number_that_it_is_ahead() {
        let number = 5_000_i64.to_le_bytes();
        for at in [16, BLOCK - 4] {
            let (number, _) = blocks(at, &number, &number).unwrap();
            let (time, _) = with_time(at, NOW + 5_000);
            assert_eq!(number.blocks[0].1.bytes, time.blocks[0].1.bytes);
            assert_ne!(number.hash, time.hash);
        }
    }

    #[test]
    fn what_is_computed_of_a_time_is_none() {
        let (here, ahead) = (NOW / 1_000, (NOW + AHEAD) / 1_000);
        let error = blocks(8, &here.to_le_bytes(), &ahead.to_le_bytes()).unwrap_err();
        assert_eq!(error.address, 8);
    }
}
