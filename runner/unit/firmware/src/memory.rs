//! The link's plug-in memory: two slots in the board's flash.

use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::{String, ToString};
use softplug_unit_protocol::{Digest, SlotState, ToServer};
use softplug_unit_slots::{
    Begun, Device, Module, Options, Run, Signature, Slot, Slots, State, Trust,
};

/// Times that a plug-in on trial may be started.
const ATTEMPTS: u8 = 3;
/// Bytes of a signature in a message: the key's id, and the signature.
const SIGNATURE: usize = 32 + 64;

/// A plug-in that is to run.
#[derive(Copy, Clone)]
pub(crate) struct Bootable {
    pub(crate) module: Module,
    pub(crate) is_on_trial: bool,
}

/// How a download stands.
pub(crate) enum Download {
    /// So many bytes are there.
    Until(u32),
    /// All of it is there, in this slot.
    Whole(u8),
}

pub(crate) struct Memory<D> {
    slots: Slots<'static, D>,
    most_erases: u32,
    /// The module that the last boot gave.
    running: Option<Digest>,
}

impl<D: Device> Memory<D> {
    pub(crate) fn open(
        device: D,
        trust: Trust<'static>,
        most_erases: u32,
    ) -> Result<Self, softplug_unit_slots::Error<D::Error>> {
        let slots = Slots::open(device, Options { trust, attempts: ATTEMPTS, most_erases })?;
        Ok(Self { slots, most_erases, running: None })
    }

    /// What is to run. An attempt of a trial is counted.
    pub(crate) fn boot(&mut self) -> Option<Bootable> {
        let run = self.slots.boot().run;
        let module = run.module();
        self.running = module.map(|module| module.digest);
        Some(Bootable { module: module?, is_on_trial: matches!(run, Run::Trial { .. }) })
    }

    pub(crate) fn begin(
        &mut self,
        length: u32,
        digest: Digest,
        signature: &[u8],
    ) -> Result<Download, String> {
        let signature = match signature {
            [] => None,
            bytes => Some(signature_of(bytes)?),
        };
        match self.slots.begin(length, digest, signature).map_err(|error| error.to_string())? {
            Begun::Fresh { .. } => Ok(Download::Until(0)),
            Begun::UnderWay { received, .. } => Ok(Download::Until(received)),
            Begun::AlreadyThere { slot, .. } => Ok(Download::Whole(number(slot))),
        }
    }

    /// Takes a piece.
    pub(crate) fn piece(&mut self, at: u32, bytes: &[u8]) -> Result<Download, String> {
        self.slots.write(at, bytes).map(Download::Until).map_err(|error| error.to_string())
    }

    /// Verifies what was downloaded.
    pub(crate) fn install(&mut self) -> Result<Download, String> {
        let slot = self.slots.finish().map_err(|error| error.to_string())?;
        Ok(Download::Whole(number(slot)))
    }

    /// The module with this digest is to run now: what was downloaded goes on trial, what was
    /// confirmed before is gone back to.
    pub(crate) fn change_to(&mut self, digest: Digest) -> Result<Bootable, String> {
        let held = [Slot::A, Slot::B].map(|slot| self.slots.held(slot));
        // Both may hold it: what was downloaded last is the one that was verified last.
        let found = held.into_iter().flatten().filter(|held| held.digest == digest);
        let is_usable = |state| !matches!(state, State::Writing | State::Failed(_));
        let found = found.max_by_key(|held| (is_usable(held.state), held.generation));
        let state = found
            .map(|held| held.state)
            .ok_or_else(|| "no slot holds this plug-in: download it first".to_owned())?;
        match state {
            State::Written => {
                self.slots.start_trial().map_err(|error| error.to_string())?;
            }
            State::Confirmed if self.running.is_some_and(|running| running != digest) => {
                self.slots.go_back().map_err(|error| error.to_string())?;
            }
            State::Confirmed | State::Trial { .. } => {}
            State::Writing => return Err("its download is not finished".to_owned()),
            State::Failed(failure) => {
                return Err(format!("it has failed before ({failure}): download it anew"));
            }
        }
        let bootable = self.boot().ok_or("nothing in the memory can run")?;
        if bootable.module.digest != digest {
            return Err("the memory gives another plug-in: this one is not sound".to_owned());
        }
        Ok(bootable)
    }

    /// What runs has proved itself. If that cannot be written, the trial goes on.
    pub(crate) fn confirm(&mut self) {
        let _ = self.slots.confirm();
    }

    /// What is on trial does not do. If that cannot be written, its attempts will be used up.
    pub(crate) fn fail(&mut self) {
        let _ = self.slots.fail();
    }

    /// What a query is told.
    pub(crate) fn tell(&self) -> [ToServer<'static>; 2] {
        [Slot::A, Slot::B].map(|slot| {
            let held = self.slots.held(slot);
            ToServer::Slot {
                link: 0,
                slot: number(slot),
                state: held.map_or(SlotState::Empty, |held| shown(held.state)),
                length: held.map_or(0, |held| held.length),
                digest: held.map_or([0; 32], |held| held.digest),
                erased: self.slots.erases(slot),
                erasable: self.most_erases,
            }
        })
    }
}

fn signature_of(bytes: &[u8]) -> Result<Signature, String> {
    let wrong = || format!("a signature has {SIGNATURE} bytes, and this {}", bytes.len());
    let (key, rest) = bytes.split_first_chunk::<32>().ok_or_else(wrong)?;
    let signature: &[u8; 64] = rest.try_into().map_err(|_| wrong())?;
    Ok(Signature { key: *key, bytes: *signature })
}

fn number(slot: Slot) -> u8 {
    match slot {
        Slot::A => 0,
        Slot::B => 1,
    }
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
