//! Which module runs: trials, their end, and the way back.

use super::{Module, Slots};
use crate::access;
use crate::device::Device;
use crate::error::{Error, Refusal};
use crate::record::{Failure, Record, State};
use crate::slot::Slot;

/// What to run now, and why nothing else.
///
/// The example of [`Slots`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Boot {
    /// What to run.
    pub run: Run,
    /// Why slot A and slot B are not run; none for the one that is.
    pub passed_over: [Option<PassedOver>; 2],
}

/// What to run.
///
/// The example of [`Slots`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Run {
    /// The module on trial. [`Slots::confirm`] or [`Slots::fail`] end the trial.
    Trial {
        /// It.
        module: Module,
        /// Which attempt this is, from 1.
        attempt: u8,
        /// The last one.
        of: u8,
    },
    /// The newest module that was confirmed and is sound.
    Confirmed(Module),
    /// There is none: the unit waits for a download.
    Nothing,
}

impl Run {
    /// The module, if there is one.
    pub const fn module(self) -> Option<Module> {
        match self {
            Self::Trial { module, .. } | Self::Confirmed(module) => Some(module),
            Self::Nothing => None,
        }
    }
}

/// Why a slot is not run.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PassedOver {
    /// It holds no module; [`Slots::look`] says what.
    #[error("it holds no module")]
    NoModule,
    /// Its download was never finished.
    #[error("its download was not finished")]
    Unfinished,
    /// Its trial was never started.
    #[error("its trial was not started")]
    NotTried,
    /// It has failed.
    #[error("it has failed: {0}")]
    Failed(Failure),
    /// Its module cannot be run.
    #[error(transparent)]
    Unfit(#[from] Unfit),
    /// The attempt could not be written down: it might be run for ever.
    #[error("the attempt could not be counted: its memory failed")]
    NotCounted,
    /// The other slot comes first.
    #[error("the other slot comes first")]
    Older,
}

/// Why a module cannot be run.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Unfit {
    /// The device cannot read it.
    #[error("its module cannot be read")]
    Unreadable,
    /// It is another one than was downloaded: the memory has decayed, or was changed.
    #[error("its module no longer has its digest: the memory has decayed or was changed")]
    Digest,
    /// The unit does not take its signature, now.
    #[error("its module is not trusted: {0}")]
    Refused(Refusal),
}

impl<D: Device> Slots<'_, D> {
    /// What to run now: at the start of the unit, or when it changes over without one. A download that is under way
    /// ends. What ran before must not run any more.
    ///
    /// A module on trial comes first, and each boot is one of its attempts, which is written down before it is given. Then
    /// the newest module that was confirmed. Digest and signature of whatever is given are looked at.
    pub fn boot(&mut self) -> Boot {
        self.download = None;
        self.running = None;
        for slot in Slot::BOTH {
            self.look_again(slot);
        }
        let mut passed_over = Slot::BOTH.map(|slot| match self.state(slot) {
            None => Some(PassedOver::NoModule),
            Some(State::Writing) => Some(PassedOver::Unfinished),
            Some(State::Written) => Some(PassedOver::NotTried),
            Some(State::Failed(failure)) => Some(PassedOver::Failed(failure)),
            Some(State::Trial { .. } | State::Confirmed) => Some(PassedOver::Older),
        });
        if let Some(slot) = self.on_trial() {
            match self.attempt(slot) {
                Ok(run) => return self.give(slot, run, passed_over),
                Err(reason) => passed_over[slot.index()] = Some(reason),
            }
        }
        for slot in self.confirmed() {
            match self.inspect(slot) {
                Ok(()) => {
                    let run = self.module(slot).map_or(Run::Nothing, Run::Confirmed);
                    return self.give(slot, run, passed_over);
                }
                Err(unfit) => passed_over[slot.index()] = Some(unfit.into()),
            }
        }
        Boot { run: Run::Nothing, passed_over }
    }

    /// Puts the module that was downloaded last on trial, from the next boot on. Gives its slot; if it is on trial already,
    /// nothing is written.
    ///
    /// # Errors
    /// [`Refusal::NothingToTry`], or the device failed.
    pub fn start_trial(&mut self) -> Result<Slot, Error<D::Error>> {
        if let Some(slot) = self.on_trial() {
            return Ok(slot);
        }
        let written = |slot: &Slot| self.state(*slot) == Some(State::Written);
        let slot = self.newest().filter(written).ok_or(Refusal::NothingToTry)?;
        self.append(slot, Record::Trial { of: self.options.attempts })?;
        Ok(slot)
    }

    /// Ends the trial well: this module runs from now on. Gives its slot; if it was confirmed already, nothing is written.
    ///
    /// # Errors
    /// [`Refusal::NotOnTrial`] if the last boot did not give a module on trial, or the device failed: the trial
    /// goes on then.
    pub fn confirm(&mut self) -> Result<Slot, Error<D::Error>> {
        let slot = self.running.ok_or(Refusal::NotOnTrial)?;
        match self.state(slot) {
            Some(State::Confirmed) => Ok(slot),
            Some(State::Trial { .. }) => {
                self.append(slot, Record::Confirmed)?;
                Ok(slot)
            }
            _ => Err(Refusal::NotOnTrial.into()),
        }
    }

    /// Ends the trial badly, run or not. Gives the slot, which must not run any more: [`Slots::boot`] says what does. After
    /// the trial of a unit's first plug-in that is nothing.
    ///
    /// # Errors
    /// [`Refusal::NotOnTrial`], or the device failed: the trial goes on then, until its attempts are used up.
    pub fn fail(&mut self) -> Result<Slot, Error<D::Error>> {
        let slot = self.on_trial().ok_or(Refusal::NotOnTrial)?;
        self.append(slot, Record::Failed(Failure::Told))?;
        self.running = self.running.filter(|running| *running != slot);
        Ok(slot)
    }

    /// Goes back from the confirmed module that runs to the one before it. Gives the slot that failed by this, which must not run
    /// any more: [`Slots::boot`] gives the other one.
    ///
    /// # Errors
    /// [`Refusal::NoOther`] if the other slot holds nothing confirmed and sound, or nothing confirmed runs; or the device
    /// failed.
    pub fn go_back(&mut self) -> Result<Slot, Error<D::Error>> {
        let confirmed = |slot: &Slot| self.state(*slot) == Some(State::Confirmed);
        let slot = self.running.filter(confirmed).ok_or(Refusal::NoOther)?;
        let other = Some(slot.other()).filter(confirmed).ok_or(Refusal::NoOther)?;
        if self.inspect(other).is_err() {
            return Err(Refusal::NoOther.into());
        }
        self.make_firm(other)?;
        self.append(slot, Record::Failed(Failure::Told))?;
        self.running = None;
        Ok(slot)
    }

    /// What runs from now on is the module with this digest, and nothing else: one that was downloaded goes on trial, one that
    /// was confirmed before is gone back to. It is what [`Slots::boot`] gives then. What ran before must not run any more.
    ///
    /// # Errors
    /// [`Refusal::NotHeld`], [`Refusal::Unfinished`] or [`Refusal::FailedBefore`]: nothing has changed. [`Refusal::NotSound`]: it
    /// cannot run, and boot says what does. Or there is no way back, or the device failed.
    pub fn change_to(&mut self, digest: &[u8; 32]) -> Result<Boot, Error<D::Error>> {
        // Both may hold it: what was downloaded last is the one that was verified last.
        let holding = Slot::BOTH.into_iter().filter_map(|slot| self.held(slot));
        let holding = holding.filter(|held| held.digest == *digest);
        let is_usable = |state| !matches!(state, State::Writing | State::Failed(_));
        let found = holding.max_by_key(|held| (is_usable(held.state), held.generation));
        match found.ok_or(Refusal::NotHeld)?.state {
            State::Written => {
                self.start_trial()?;
            }
            State::Confirmed if self.runs_another(digest) => {
                self.go_back()?;
            }
            State::Confirmed | State::Trial { .. } => {}
            State::Writing => return Err(Refusal::Unfinished.into()),
            State::Failed(failure) => return Err(Refusal::FailedBefore(failure).into()),
        }
        let boot = self.boot();
        match boot.run.module() {
            Some(module) if module.digest == *digest => Ok(boot),
            _ => Err(Refusal::NotSound.into()),
        }
    }

    fn runs_another(&self, digest: &[u8; 32]) -> bool {
        self.running.and_then(|slot| self.held(slot)).is_some_and(|held| held.digest != *digest)
    }

    /// Whether a slot's module has its digest and a signature that the unit takes.
    pub(crate) fn inspect(&mut self, slot: Slot) -> Result<(), Unfit> {
        let header = self.current(slot).ok_or(Unfit::Unreadable)?.header;
        let at = self.layout.module(slot);
        let digest = access::digest(&mut self.device, at, header.length);
        if digest.map_err(|_| Unfit::Unreadable)? != header.digest {
            return Err(Unfit::Digest);
        }
        let trust = self.options.trust;
        trust
            .check(header.length, &header.digest, header.signature.as_ref())
            .map_err(Unfit::Refused)
    }

    /// One more attempt of a trial, if there is one left.
    fn attempt(&mut self, slot: Slot) -> Result<Run, PassedOver> {
        if let Some(State::Trial { attempts, of }) = self.state(slot)
            && attempts >= of
        {
            return Err(self.give_up(slot, Failure::AttemptsUsedUp));
        }
        // Counted before anything else: whatever happens then cannot happen for ever.
        self.append(slot, Record::Attempt).map_err(|_| PassedOver::NotCounted)?;
        match self.inspect(slot) {
            Ok(()) => {}
            Err(unfit @ Unfit::Unreadable) => return Err(unfit.into()),
            Err(Unfit::Digest | Unfit::Refused(_)) => {
                return Err(self.give_up(slot, Failure::Unfit));
            }
        }
        match (self.state(slot), self.module(slot)) {
            (Some(State::Trial { attempts, of }), Some(module)) => {
                Ok(Run::Trial { module, attempt: attempts, of })
            }
            (Some(State::Failed(failure)), _) => Err(PassedOver::Failed(failure)),
            _ => Err(PassedOver::NotCounted),
        }
    }

    /// If it cannot be written down now, the next boot comes to the same end.
    fn give_up(&mut self, slot: Slot, failure: Failure) -> PassedOver {
        let _ = self.append(slot, Record::Failed(failure));
        PassedOver::Failed(failure)
    }

    fn give(&mut self, slot: Slot, run: Run, mut passed_over: [Option<PassedOver>; 2]) -> Boot {
        self.running = Some(slot);
        passed_over[slot.index()] = None;
        Boot { run, passed_over }
    }

    fn module(&self, slot: Slot) -> Option<Module> {
        let held = self.held(slot)?;
        let at = self.layout.module(slot);
        Some(Module { slot, at, length: held.length, digest: held.digest })
    }
}
