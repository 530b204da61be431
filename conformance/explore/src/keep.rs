//! What is known of the states, in a file: a search that was ended goes on from there.
//!
//! A header, then one record for each level. What was being written when the search was ended
//! is cut off when it goes on.

use crate::ExploreError;
use crate::choice::{Choice, Damage};
use crate::graph::{Graph, Level, Node};
use crate::hash::Hash128;
use softplug_abi::Micros;
use std::fs::{File, OpenOptions, TryLockError};
use std::hash::Hash;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 16] = b"softplug-states1";
/// Magic, and what is explored.
const HEADER: usize = 32;
/// A record's length and checksum.
const FRAME: usize = 24;
/// More is no record.
const MOST: u64 = 1 << 32;

/// The file of one search.
pub(crate) struct Keep {
    path: PathBuf,
    file: File,
}

impl Keep {
    /// A new file for a search with this key.
    pub(crate) fn create(path: &Path, key: u128) -> Result<Self, ExploreError> {
        let options =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let file = options.map_err(|error| failed(path, &error))?;
        lock(path, &file)?;
        file.set_len(0).map_err(|error| failed(path, &error))?;
        let mut keep = Self { path: path.to_owned(), file };
        let header: Vec<u8> = MAGIC.iter().copied().chain(key.to_le_bytes()).collect();
        keep.write(&header)?;
        Ok(keep)
    }

    /// The file of an earlier search with the same key, and the levels that stand in it.
    pub(crate) fn open(path: &Path, key: u128) -> Result<(Self, Vec<Level>), ExploreError> {
        let options = OpenOptions::new().read(true).write(true).open(path);
        let mut file = options.map_err(|error| failed(path, &error))?;
        lock(path, &file)?;
        let wrong = |reason: &str| {
            Err(ExploreError::Kept { path: path.to_owned(), reason: reason.to_owned() })
        };
        let mut header = [0; HEADER];
        if file.read_exact(&mut header).is_err() || header[..16] != *MAGIC {
            return wrong("these are no states of an exploration");
        }
        if header[16..] != key.to_le_bytes() {
            return wrong("another module, plan or number of faults was explored here");
        }
        let mut levels = Vec::new();
        let mut sound = HEADER as u64;
        while let Some(record) = record(&mut file) {
            let Some(level) = read_level(&record) else { break };
            sound += (FRAME + record.len()) as u64;
            levels.push(level);
        }
        let cut = file.set_len(sound).and_then(|()| file.seek(SeekFrom::End(0)));
        cut.map_err(|error| failed(path, &error))?;
        Ok((Self { path: path.to_owned(), file }, levels))
    }

    /// The level that was found last.
    pub(crate) fn level(&mut self, graph: &Graph) -> Result<(), ExploreError> {
        let record = write_level(&graph.latest());
        let mut whole = Vec::with_capacity(FRAME + record.len());
        whole.extend((record.len() as u64).to_le_bytes());
        whole.extend(checksum(&record).to_le_bytes());
        whole.extend(record);
        self.write(&whole)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), ExploreError> {
        self.file.write_all(bytes).map_err(|error| failed(&self.path, &error))
    }
}

/// One exploration at a time.
fn lock(path: &Path, file: &File) -> Result<(), ExploreError> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => {
            let reason = "another exploration is writing here: give it another folder".to_owned();
            Err(ExploreError::Kept { path: path.to_owned(), reason })
        }
        Err(TryLockError::Error(error)) => Err(failed(path, &error)),
    }
}

fn failed(path: &Path, error: &std::io::Error) -> ExploreError {
    ExploreError::Kept { path: path.to_owned(), reason: error.to_string() }
}

fn record(file: &mut File) -> Option<Vec<u8>> {
    let mut frame = [0; FRAME];
    file.read_exact(&mut frame).ok()?;
    let (length, sum) = frame.split_at(8);
    let length = u64::from_le_bytes(length.try_into().ok()?);
    let rest = file.metadata().ok()?.len().saturating_sub(file.stream_position().ok()?);
    if length > MOST.min(rest) {
        return None;
    }
    let mut record = vec![0; length as usize];
    file.read_exact(&mut record).ok()?;
    (checksum(&record).to_le_bytes() == sum).then_some(record)
}

fn checksum(record: &[u8]) -> u128 {
    let mut state = Hash128::new();
    record.hash(&mut state);
    state.finish_128()
}

fn write_level(level: &Level) -> Vec<u8> {
    let mut to = Vec::new();
    to.extend(level.transitions.to_le_bytes());
    to.extend((level.nodes.len() as u32).to_le_bytes());
    for (hash, Node { parent, choice, is_under_way }) in &level.nodes {
        to.extend(hash.to_le_bytes());
        to.extend(parent.to_le_bytes());
        to.extend(code(*choice));
        to.push(u8::from(*is_under_way));
    }
    to.extend((level.usual.len() as u32).to_le_bytes());
    for (from, next, time) in &level.usual {
        to.extend(from.to_le_bytes());
        to.extend(next.to_le_bytes());
        to.extend(time.0.to_le_bytes());
    }
    to.extend((level.unavoidable.len() as u32).to_le_bytes());
    for (name, count) in &level.unavoidable {
        to.push(name.len() as u8);
        to.extend(name.as_bytes());
        to.extend(count.to_le_bytes());
    }
    to
}

fn read_level(mut from: &[u8]) -> Option<Level> {
    let from = &mut from;
    let mut level = Level { transitions: u64::from_le_bytes(take(from)?), ..Level::default() };
    for _ in 0..u32::from_le_bytes(take(from)?) {
        let hash = u128::from_le_bytes(take(from)?);
        let parent = u32::from_le_bytes(take(from)?);
        let choice = choice(take(from)?)?;
        let [is_under_way] = take(from)?;
        level.nodes.push((hash, Node { parent, choice, is_under_way: is_under_way != 0 }));
    }
    for _ in 0..u32::from_le_bytes(take(from)?) {
        let before = u32::from_le_bytes(take(from)?);
        let next = u32::from_le_bytes(take(from)?);
        level.usual.push((before, next, Micros(i64::from_le_bytes(take(from)?))));
    }
    for _ in 0..u32::from_le_bytes(take(from)?) {
        let [length] = take(from)?;
        let (name, rest) = from.split_at_checked(usize::from(length))?;
        *from = rest;
        let name = String::from_utf8(name.to_vec()).ok()?;
        level.unavoidable.insert(name, u64::from_le_bytes(take(from)?));
    }
    from.is_empty().then_some(level)
}

fn take<const N: usize>(from: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = from.split_first_chunk()?;
    *from = rest;
    Some(*first)
}

/// What, which end, and which character.
fn code(choice: Choice) -> [u8; 3] {
    let (what, end, byte) = match choice {
        Choice::Next => (0, 0, 0),
        Choice::Begin(end) => (1, end, 0),
        Choice::Lost(end) => (2, end, 0),
        Choice::Doubled(end) => (3, end, 0),
        Choice::Altered(end, byte) => (4, end, byte),
        Choice::Damaged(end, Damage::Parity) => (5, end, 0),
        Choice::Damaged(end, Damage::Break) => (6, end, 0),
        Choice::AtTimer(end) => (7, end, 0),
        Choice::AfterTimer(end) => (8, end, 0),
        Choice::Inserted(end, byte) => (9, end, byte),
        Choice::Abort(end) => (10, end, 0),
        Choice::AbortDelivery(end) => (11, end, 0),
        Choice::Pause(end) => (12, end, 0),
        Choice::Resume(end) => (13, end, 0),
        Choice::Force(end) => (14, end, 0),
        Choice::Down(end) => (15, end, 0),
        Choice::Up(end) => (16, end, 0),
        Choice::Swap(end) => (17, end, 0),
        Choice::Keep(end) => (18, end, 0),
        Choice::PutAway(end) => (19, end, 0),
        Choice::Late(end) => (20, end, 0),
    };
    [what, end as u8, byte]
}

fn choice([what, end, byte]: [u8; 3]) -> Option<Choice> {
    let end = usize::from(end);
    if end > 1 {
        return None;
    }
    Some(match what {
        0 => Choice::Next,
        1 => Choice::Begin(end),
        2 => Choice::Lost(end),
        3 => Choice::Doubled(end),
        4 => Choice::Altered(end, byte),
        5 => Choice::Damaged(end, Damage::Parity),
        6 => Choice::Damaged(end, Damage::Break),
        7 => Choice::AtTimer(end),
        8 => Choice::AfterTimer(end),
        9 => Choice::Inserted(end, byte),
        10 => Choice::Abort(end),
        11 => Choice::AbortDelivery(end),
        12 => Choice::Pause(end),
        13 => Choice::Resume(end),
        14 => Choice::Force(end),
        15 => Choice::Down(end),
        16 => Choice::Up(end),
        17 => Choice::Swap(end),
        18 => Choice::Keep(end),
        19 => Choice::PutAway(end),
        20 => Choice::Late(end),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level() -> Level {
        let choices = [Choice::Next, Choice::Altered(1, 0x10), Choice::Swap(0)];
        let node = |choice| Node { parent: 7, choice, is_under_way: true };
        Level {
            transitions: 90,
            nodes: choices.map(|choice| (5, node(choice))).to_vec(),
            usual: vec![(7, 9, Micros(1_000))],
            unavoidable: [("doubled".to_owned(), 3)].into(),
        }
    }

    #[test]
    fn a_level_is_read_as_it_was_written() {
        assert_eq!(read_level(&write_level(&level())), Some(level()));
    }

    #[test]
    fn every_choice_is_read_as_it_was_written() {
        for what in 0..21 {
            let known = choice([what, 1, 0x10]).unwrap();
            assert_eq!(choice(code(known)), Some(known));
        }
        assert_eq!((choice([21, 0, 0]), choice([2, 2, 0])), (None, None));
    }

    #[test]
    fn a_level_that_is_cut_is_none() {
        let whole = write_level(&level());
        for length in 0..whole.len() {
            assert_eq!(read_level(&whole[..length]), None, "{length}");
        }
    }
}
