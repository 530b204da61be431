//! The link's plug-in memory: two slots in the board's flash.

use softplug_unit_protocol::{Digest, SlotState, ToServer};
use softplug_unit_slots::{
    Begun, Boot, Device, Error, Module, Options, Refusal, Run, Signature, Slot, Slots, State, Trust,
};

/// Times that a plug-in on trial may be started.
const ATTEMPTS: u8 = 3;

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
}

impl<D: Device> Memory<D> {
    pub(crate) fn open(
        device: D,
        trust: Trust<'static>,
        most_erases: u32,
    ) -> Result<Self, Error<D::Error>> {
        let slots = Slots::open(device, Options { trust, attempts: ATTEMPTS, most_erases })?;
        Ok(Self { slots, most_erases })
    }

    /// What is to run. An attempt of a trial is counted.
    pub(crate) fn boot(&mut self) -> Option<Bootable> {
        bootable(&self.slots.boot())
    }

    pub(crate) fn begin(
        &mut self,
        length: u32,
        digest: Digest,
        signature: &[u8],
    ) -> Result<Download, Error<D::Error>> {
        let signature = (!signature.is_empty()).then(|| Signature::from_bytes(signature));
        let signature = signature.transpose()?;
        match self.slots.begin(length, digest, signature)? {
            Begun::Fresh { .. } => Ok(Download::Until(0)),
            Begun::UnderWay { received, .. } => Ok(Download::Until(received)),
            Begun::AlreadyThere { slot, .. } => Ok(Download::Whole(slot.number())),
        }
    }

    /// Takes a piece.
    pub(crate) fn piece(&mut self, at: u32, bytes: &[u8]) -> Result<Download, Error<D::Error>> {
        self.slots.write(at, bytes).map(Download::Until)
    }

    /// Verifies what was downloaded.
    pub(crate) fn install(&mut self) -> Result<Download, Error<D::Error>> {
        let slot = self.slots.finish()?;
        Ok(Download::Whole(slot.number()))
    }

    /// The module with this digest is to run now: what was downloaded goes on trial, what was
    /// confirmed before is gone back to.
    pub(crate) fn change_to(&mut self, digest: Digest) -> Result<Bootable, Error<D::Error>> {
        let boot = self.slots.change_to(&digest)?;
        Ok(bootable(&boot).ok_or(Refusal::NotSound)?)
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
        Slot::BOTH.map(|slot| {
            let held = self.slots.held(slot);
            ToServer::Slot {
                link: 0,
                slot: slot.number(),
                state: held.map_or(SlotState::Empty, |held| shown(held.state)),
                length: held.map_or(0, |held| held.length),
                digest: held.map_or([0; 32], |held| held.digest),
                erased: self.slots.erases(slot),
                erasable: self.most_erases,
            }
        })
    }
}

fn bootable(boot: &Boot) -> Option<Bootable> {
    let is_on_trial = matches!(boot.run, Run::Trial { .. });
    Some(Bootable { module: boot.run.module()?, is_on_trial })
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
