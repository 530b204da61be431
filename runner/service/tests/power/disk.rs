//! A storage in memory that forgets what was not synced when the power fails.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard};

use redb::StorageBackend;

use super::Dice;

/// Disks write these as a whole or not at all.
const SECTOR: usize = 512;

#[derive(Clone, Debug)]
pub(crate) struct Disk(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    /// What survives for sure.
    durable: Vec<u8>,
    /// What is read.
    current: Vec<u8>,
    /// Writes since the last sync.
    pending: Vec<Change>,
    dice: Dice,
    /// So many operations until the power fails.
    left: Option<u64>,
    may_grow: bool,
}

#[derive(Debug)]
enum Change {
    Length(usize),
    Sector(usize, Vec<u8>),
}

impl Disk {
    pub(crate) fn new(dice: Dice) -> Self {
        Self::with(Vec::new(), dice)
    }

    fn with(bytes: Vec<u8>, dice: Dice) -> Self {
        let (durable, current) = (bytes.clone(), bytes);
        let state =
            State { durable, current, pending: Vec::new(), dice, left: None, may_grow: true };
        Self(Arc::new(Mutex::new(state)))
    }

    /// The power fails after so many operations: nothing works from then on.
    pub(crate) fn fail_after(&self, operations: u64) {
        self.state().left = Some(operations);
    }

    pub(crate) fn allow_no_growth(&self) {
        self.state().may_grow = false;
    }

    pub(crate) fn allow_growth(&self) {
        self.state().may_grow = true;
    }

    /// What a start after the loss finds: of what was not synced any part, in any order.
    pub(crate) fn after_power_loss(&self) -> Self {
        let mut state = self.state();
        let mut bytes = std::mem::take(&mut state.durable);
        let pending = std::mem::take(&mut state.pending);
        let mut dice = state.dice.clone();
        // From nothing to everything, so that all mixtures come up.
        let share = dice.below(101);
        for change in pending {
            if dice.below(100) >= share {
                continue;
            }
            match change {
                Change::Length(length) => bytes.resize(length, 0),
                Change::Sector(at, sector) => {
                    let end = at + sector.len();
                    if bytes.len() < end {
                        bytes.resize(end, 0);
                    }
                    bytes[at..end].copy_from_slice(&sector);
                }
            }
        }
        Self::with(bytes, dice)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    fn powered(&self) -> io::Result<MutexGuard<'_, State>> {
        let mut state = self.state();
        match &mut state.left {
            Some(0) => return Err(io::Error::other("the power is off")),
            Some(left) => *left -= 1,
            None => {}
        }
        Ok(state)
    }
}

impl StorageBackend for Disk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.powered()?.current.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let state = self.powered()?;
        let from = offset as usize;
        let bytes = state.current.get(from..from + out.len());
        out.copy_from_slice(bytes.ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn set_len(&self, length: u64) -> io::Result<()> {
        let mut state = self.powered()?;
        let length = length as usize;
        if length > state.current.len() && !state.may_grow {
            return Err(io::ErrorKind::StorageFull.into());
        }
        state.current.resize(length, 0);
        state.pending.push(Change::Length(length));
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        let mut state = self.powered()?;
        let State { durable, current, .. } = &mut *state;
        durable.clone_from(current);
        state.pending.clear();
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        let mut state = self.powered()?;
        let from = offset as usize;
        let to = state.current.get_mut(from..from + data.len());
        to.ok_or(io::ErrorKind::UnexpectedEof)?.copy_from_slice(data);
        // By sectors of the disk, however the write lies.
        let mut at = from;
        while at < from + data.len() {
            let end = (at / SECTOR * SECTOR + SECTOR).min(from + data.len());
            let sector = data[at - from..end - from].to_vec();
            state.pending.push(Change::Sector(at, sector));
            at = end;
        }
        Ok(())
    }
}
