//! A link's plug-in memory: two slots on a file or an MTD device.

use std::fs;
use std::io;
use std::os::unix::fs::FileTypeExt;

use softplug_unit_protocol::{Digest, SlotState, ToServer};
use softplug_unit_slots::{
    Begun, Boot, Content, Device, FileDevice, Geometry, Module, MtdDevice, Options, PassedOver,
    Refusal, Run, Signature, Slot, Slots, State, Trust,
};
use thiserror::Error;

use crate::config::{MemoryConfig, SignatureConfig};
use crate::holder;

/// Times that a plug-in on trial may be started.
const ATTEMPTS: u8 = 3;
/// Blocks and granules of a file, as of common NOR flash.
const ERASE: u32 = 4_096;
const GRANULE: u32 = 4;

/// A device of either kind.
#[derive(Debug)]
enum AnyDevice {
    File(FileDevice),
    Mtd(MtdDevice),
}

impl Device for AnyDevice {
    type Error = io::Error;

    fn geometry(&self) -> Geometry {
        match self {
            Self::File(device) => device.geometry(),
            Self::Mtd(device) => device.geometry(),
        }
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> io::Result<()> {
        match self {
            Self::File(device) => device.read(at, into),
            Self::Mtd(device) => device.read(at, into),
        }
    }

    fn erase(&mut self, at: u32, length: u32) -> io::Result<()> {
        match self {
            Self::File(device) => device.erase(at, length),
            Self::Mtd(device) => device.erase(at, length),
        }
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::File(device) => device.program(at, bytes),
            Self::Mtd(device) => device.program(at, bytes),
        }
    }
}

/// Why a memory does not do what it is asked for.
pub(crate) type MemoryError = softplug_unit_slots::Error<io::Error>;

/// Why there is no memory.
#[derive(Debug, Error)]
pub(crate) enum NoMemory {
    /// Somebody has it open already, as this sentence says.
    #[error("{0}")]
    Held(String),
    /// Its file or device cannot be used.
    #[error(transparent)]
    Device(io::Error),
    /// It cannot be used as two slots.
    #[error(transparent)]
    Slots(#[from] MemoryError),
}

/// A plug-in that is to run.
#[derive(Debug)]
pub(crate) struct Bootable {
    pub(crate) digest: Digest,
    pub(crate) bytes: Vec<u8>,
    pub(crate) is_on_trial: bool,
}

/// How a download stands.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Download {
    /// So many bytes are there.
    Until(u32),
    /// All of it was there already, in this slot.
    Whole(u8),
}

pub(crate) struct Memory {
    slots: Slots<'static, AnyDevice>,
    most_erases: u32,
    /// Why the last boot did not run what the slots hold.
    passed_over: [Option<PassedOver>; 2],
}

impl Memory {
    pub(crate) fn open(config: &MemoryConfig, trusted: &SignatureConfig) -> Result<Self, NoMemory> {
        let device = device(config).map_err(|error| match error.kind() {
            io::ErrorKind::ResourceBusy => NoMemory::Held(holder::of(&config.path)),
            _ => NoMemory::Device(error),
        })?;
        // There are as many memories as links, and they last as long as the process.
        let keys: &'static [[u8; 32]] = Box::leak(trusted.keys.clone().into_boxed_slice());
        let trust = if trusted.unsigned { Trust::unsigned_too(keys) } else { Trust::signed(keys) };
        let most_erases = config.most_erases;
        let options = Options { trust, attempts: ATTEMPTS, most_erases };
        let slots = Slots::open(device, options)?;
        Ok(Self { slots, most_erases, passed_over: [None; 2] })
    }

    /// What is to run. An attempt of a trial is counted.
    pub(crate) fn boot(&mut self) -> Result<Option<Bootable>, MemoryError> {
        let boot = self.slots.boot();
        self.passed_over = boot.passed_over;
        self.bootable(&boot)
    }

    /// Why what the slots hold does not run, if they hold anything.
    pub(crate) fn passed_over(&self) -> Option<String> {
        let reasons = Slot::BOTH.into_iter().zip(self.passed_over).filter_map(|(slot, reason)| {
            let reason = reason.filter(|reason| *reason != PassedOver::NoModule)?;
            Some(format!("slot {slot} is not run: {reason}"))
        });
        let reasons: Vec<String> = reasons.chain(self.foreign()).collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    fn bootable(&mut self, boot: &Boot) -> Result<Option<Bootable>, MemoryError> {
        for (slot, reason) in ["A", "B"].into_iter().zip(boot.passed_over) {
            match reason {
                Some(
                    reason
                    @ (PassedOver::Unfit(_) | PassedOver::Failed(_) | PassedOver::NotCounted),
                ) => {
                    tracing::warn!(slot, %reason, "a slot is not run");
                }
                Some(reason) => tracing::debug!(slot, %reason, "a slot is not run"),
                None => {}
            }
        }
        let Some(module) = boot.run.module() else { return Ok(None) };
        let bytes = self.read(&module)?;
        let is_on_trial = matches!(boot.run, Run::Trial { .. });
        Ok(Some(Bootable { digest: module.digest, bytes, is_on_trial }))
    }

    fn read(&mut self, module: &Module) -> Result<Vec<u8>, MemoryError> {
        let mut bytes = vec![0; module.length as usize];
        self.slots.read(module.slot, 0, &mut bytes)?;
        Ok(bytes)
    }

    pub(crate) fn begin(
        &mut self,
        length: u32,
        digest: Digest,
        signature: &[u8],
    ) -> Result<Download, MemoryError> {
        let signature = (!signature.is_empty()).then(|| Signature::from_bytes(signature));
        let signature = signature.transpose()?;
        match self.slots.begin(length, digest, signature)? {
            Begun::Fresh { .. } => Ok(Download::Until(0)),
            Begun::UnderWay { received, .. } => Ok(Download::Until(received)),
            Begun::AlreadyThere { slot, .. } => Ok(Download::Whole(slot.number())),
        }
    }

    /// Takes a piece; gives how many bytes are there.
    pub(crate) fn piece(&mut self, at: u32, bytes: &[u8]) -> Result<u32, MemoryError> {
        self.slots.write(at, bytes)
    }

    /// Verifies what was downloaded. Gives its slot.
    pub(crate) fn install(&mut self) -> Result<u8, MemoryError> {
        self.slots.finish().map(Slot::number)
    }

    /// The module with this digest is to run now: what was downloaded goes on trial, what was
    /// confirmed before is gone back to.
    pub(crate) fn change_to(&mut self, digest: Digest) -> Result<Bootable, MemoryError> {
        let boot = self.slots.change_to(&digest)?;
        Ok(self.bootable(&boot)?.ok_or(Refusal::NotSound)?)
    }

    /// What runs has proved itself.
    pub(crate) fn confirm(&mut self) {
        if let Err(error) = self.slots.confirm() {
            tracing::error!(%error, "a trial cannot be confirmed");
        }
    }

    /// What is on trial does not do.
    pub(crate) fn fail(&mut self) {
        if let Err(error) = self.slots.fail() {
            tracing::error!(%error, "a trial cannot be ended");
        }
    }

    /// What a query is told.
    pub(crate) fn tell(&self, link: u8) -> [ToServer<'static>; 2] {
        Slot::BOTH.map(|slot| {
            let held = self.slots.held(slot);
            ToServer::Slot {
                link,
                slot: slot.number(),
                state: held.map_or(SlotState::Empty, |held| shown(held.state)),
                length: held.map_or(0, |held| held.length),
                digest: held.map_or([0; 32], |held| held.digest),
                erased: self.slots.erases(slot),
                erasable: self.most_erases,
            }
        })
    }

    /// A slot that holds something else than this format.
    pub(crate) fn foreign(&self) -> Option<String> {
        Slot::BOTH.into_iter().find_map(|slot| match self.slots.look(slot) {
            Content::Module(_) | Content::Empty => None,
            content => Some(format!("slot {slot} holds something else: {content:?}")),
        })
    }
}

fn device(config: &MemoryConfig) -> io::Result<AnyDevice> {
    match fs::metadata(&config.path).map(|found| found.file_type()) {
        Ok(kind) if kind.is_char_device() => {
            return MtdDevice::open(&config.path).map(AnyDevice::Mtd);
        }
        Ok(kind) if !kind.is_file() => {
            return Err(io::Error::other("it is neither a file nor an MTD character device"));
        }
        _ => {}
    }
    if let Some(folder) = config.path.parent() {
        fs::create_dir_all(folder)?;
    }
    let geometry = Geometry { size: config.size, erase: ERASE, granule: GRANULE };
    FileDevice::open(&config.path, geometry).map(AnyDevice::File)
}

fn shown(state: State) -> SlotState {
    match state {
        State::Writing => SlotState::Writing,
        State::Written => SlotState::Written,
        State::Trial { .. } => SlotState::OnTrial,
        State::Confirmed => SlotState::Confirmed,
        State::Failed(_) => SlotState::Failed,
    }
}
