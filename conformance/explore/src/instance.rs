//! An instance of which there can be many in one sandbox.

use crate::hash::Hash128;
use crate::image::Image;
use crate::leftovers::Leftovers;
use crate::sandbox::{Sandbox, StepFault};
use softplug_abi::{Event, Instance, Micros, Output};
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A sandbox that several instances take turns in.
pub(crate) type Shared = Arc<Mutex<Sandbox>>;

/// An instance that lives in a shared sandbox while it is stepped, and as an image between.
pub(crate) struct Explored {
    sandbox: Shared,
    input_capacity: usize,
    image: Arc<Image>,
    /// What it left besides; it is no part of its state.
    left: Arc<Leftovers>,
    /// When the image was made: its times are as they were ahead then.
    at: Micros,
    /// It has been stepped since the image was made: the sandbox has its state.
    lives_with: Option<u64>,
    answer: Vec<u8>,
}

impl Explored {
    /// A new instance.
    pub(crate) fn new(sandbox: &Shared) -> Self {
        let (input_capacity, image) = {
            let inside = locked(sandbox);
            (inside.input_capacity(), Arc::clone(inside.new_image()))
        };
        let sandbox = Arc::clone(sandbox);
        Self {
            sandbox,
            input_capacity,
            image,
            left: Arc::default(),
            at: Micros::ZERO,
            lives_with: None,
            answer: Vec::new(),
        }
    }

    /// Leaves the sandbox to others.
    pub(crate) fn settle(&mut self, now: Micros) -> Result<(), StepFault> {
        let Some(ticket) = self.lives_with.take() else { return Ok(()) };
        let mut sandbox = locked(&self.sandbox);
        if !sandbox.is_held_by(ticket) {
            return Err(StepFault::TwoAtOnce);
        }
        (self.image, self.left) = sandbox.capture(now)?;
        self.at = now;
        Ok(())
    }

    /// Hashes all that decides what this instance does from `now` on. It must have settled.
    pub(crate) fn hash(&self, now: Micros, state: &mut Hash128) {
        self.image.hash.hash(state);
        if self.image.has_times() {
            (now.0 - self.at.0).hash(state);
        }
    }

    /// Goes on in another sandbox of the same module.
    pub(crate) fn move_to(&mut self, sandbox: &Shared) {
        debug_assert!(self.lives_with.is_none(), "it has settled");
        self.sandbox = Arc::clone(sandbox);
    }

    pub(crate) fn sandbox(&self) -> &Shared {
        &self.sandbox
    }
}

pub(crate) fn locked(sandbox: &Shared) -> MutexGuard<'_, Sandbox> {
    sandbox.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Clone for Explored {
    /// A second instance in the same state. The first must have settled.
    fn clone(&self) -> Self {
        debug_assert!(self.lives_with.is_none(), "it has settled");
        Self {
            sandbox: Arc::clone(&self.sandbox),
            input_capacity: self.input_capacity,
            image: Arc::clone(&self.image),
            left: Arc::clone(&self.left),
            at: self.at,
            lives_with: None,
            answer: Vec::new(),
        }
    }
}

impl Instance for Explored {
    type Fault = StepFault;

    fn input_capacity(&self) -> usize {
        self.input_capacity
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, StepFault> {
        let mut sandbox = locked(&self.sandbox);
        match self.lives_with {
            Some(ticket) if !sandbox.is_held_by(ticket) => return Err(StepFault::TwoAtOnce),
            Some(_) => {}
            None => self.lives_with = Some(sandbox.load(&self.image, &self.left, self.at)?),
        }
        let more = sandbox.step(event, now, &mut self.answer)?;
        Ok(Output { actions: &self.answer, more })
    }
}

impl std::fmt::Debug for Explored {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Explored").field("image", &self.image.hash).finish_non_exhaustive()
    }
}
