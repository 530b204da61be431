//! Another plug-in takes over a link, in the middle of what it does.

use crate::core::Answering;
use crate::fault::{LinkFault, RuleBroken};
use crate::{Link, Outside};
use softplug_abi::limits::OUTPUT_ROUNDS;
use softplug_abi::{Action, Actions, Event, EventKind, Instance, Malformed, Micros};
use std::error::Error;
use thiserror::Error;

/// A plug-in's state, as it saved it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SavedState {
    /// The format; a plug-in's manifest lists those that it accepts.
    pub format: u16,
    /// The state, at most 64 KiB.
    pub bytes: Vec<u8>,
}

/// Why the plug-in was not replaced. The old one goes on.
#[derive(Debug, Error)]
pub enum SwapError<F: Error + 'static> {
    /// The old plug-in could not save its state.
    #[error("the running plug-in did not save its state: {0}")]
    Save(#[source] LinkFault<F>),
    /// The old plug-in saves nothing.
    #[error("the running plug-in saves no state; swap it when the link is idle")]
    NoState,
    /// The new plug-in did not take settings or state.
    #[error("the new plug-in did not take over on the event \"{event}\": {source}")]
    Refused {
        /// The event that it did not take.
        event: EventKind,
        /// What the instance says.
        #[source]
        source: F,
    },
    /// The new plug-in's first actions cannot be read.
    #[error("the new plug-in's first actions cannot be read: {0}")]
    Malformed(#[source] Malformed),
    /// The new plug-in did more than take settings or state.
    #[error("the new plug-in's answer to the event \"{event}\" breaks a rule: {source}")]
    Rule {
        /// The event that it answers.
        event: EventKind,
        /// Which rule.
        #[source]
        source: RuleBroken,
    },
    /// The new plug-in was put in place and failed at once.
    #[error("the new plug-in failed as it took over: {0}")]
    Failed(#[source] LinkFault<F>),
}

impl<I: Instance> Link<I> {
    /// Asks the plug-in for its state. Changes nothing.
    ///
    /// # Errors
    /// A fault of the plug-in; `Ok(None)` if it saves nothing.
    pub fn save(
        &mut self,
        now: Micros,
        outside: &mut dyn Outside,
    ) -> Result<Option<SavedState>, LinkFault<I::Fault>> {
        if !self.is_open() {
            return Ok(None);
        }
        self.run(now, outside)?;
        self.begin_request();
        self.core.saved.clear();
        self.core.saving = None;
        self.step_as(&Event::Save, Answering::Save, outside)?;
        let bytes = std::mem::take(&mut self.core.saved);
        let Some((format, total)) = self.core.saving else { return Ok(None) };
        if bytes.len() != total as usize {
            let cut_off =
                LinkFault::Rule { event: EventKind::Save, source: RuleBroken::StatePieces };
            self.ended_by(Err(cut_off), outside)?;
        }
        Ok(Some(SavedState { format, bytes }))
    }

    /// Replaces the plug-in by `successor`, which gets the settings of
    /// this link and the state. Queue, marks, hold and lines stay. Returns the
    /// plug-in that was replaced.
    ///
    /// # Errors
    /// In every case but [`SwapError::Failed`] the old plug-in goes on as if
    /// nothing had been asked.
    pub fn swap(
        &mut self,
        now: Micros,
        successor: I,
        outside: &mut dyn Outside,
    ) -> Result<I, SwapError<I::Fault>> {
        let state = self.save(now, outside).map_err(SwapError::Save)?.ok_or(SwapError::NoState)?;
        let now = self.now();
        let mut successor = successor;
        self.prepare(now, &mut successor, &state, outside)?;
        let opening = self.opening(true);
        let first = successor
            .step(&opening, now)
            .map_err(|source| SwapError::Refused { event: opening.kind(), source })?;
        let more = first.more;
        let actions = first.actions.to_vec();
        if let Some(Err(malformed)) = Actions::new(&actions).find(Result::is_err) {
            return Err(SwapError::Malformed(malformed));
        }
        self.core.restate_rooms();
        let old = self.put(successor);
        self.resume_with(&actions, more, outside).map_err(SwapError::Failed)?;
        Ok(old)
    }

    /// Settings and state.
    fn prepare(
        &self,
        now: Micros,
        successor: &mut I,
        state: &SavedState,
        outside: &mut dyn Outside,
    ) -> Result<(), SwapError<I::Fault>> {
        let capacity = successor.input_capacity();
        let mut give = |event: &Event<'_>| give_quiet(successor, event, now, outside);
        self.options.settings.pieces(capacity, &mut give)?;
        let total = state.bytes.len() as u32;
        let most = capacity - 12;
        let mut offset = 0;
        loop {
            let end = state.bytes.len().min(offset + most);
            let bytes = &state.bytes[offset..end];
            give(&Event::Restore { format: state.format, offset: offset as u32, total, bytes })?;
            if end == state.bytes.len() {
                return Ok(());
            }
            offset = end;
        }
    }
}

/// Gives an event that may be answered by notes and state names only.
fn give_quiet<I: Instance>(
    instance: &mut I,
    event: &Event<'_>,
    now: Micros,
    outside: &mut dyn Outside,
) -> Result<(), SwapError<I::Fault>> {
    let kind = event.kind();
    let mut asked = event;
    for _ in 0..=OUTPUT_ROUNDS {
        let refused = |source| SwapError::Refused { event: kind, source };
        let output = instance.step(asked, now).map_err(refused)?;
        for action in Actions::new(output.actions) {
            let action = action.map_err(SwapError::Malformed)?;
            if !matches!(action, Action::Note { .. } | Action::State { .. }) {
                let source = RuleBroken::ActedOnState;
                return Err(SwapError::Rule { event: kind, source });
            }
            outside.handle(now, &action);
        }
        if !output.more {
            return Ok(());
        }
        asked = &Event::Continue;
    }
    Err(SwapError::Rule { event: kind, source: RuleBroken::OutputWithoutEnd })
}
