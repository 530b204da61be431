//! An instance is put in the place of another one, and goes on with its state.

use super::Link;
use super::saving::{SavedState, answer_of};
use crate::LinkHost;
use crate::fault::{LinkFault, RuleBroken};
use alloc::vec::Vec;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, Actions, Event, EventKind, Instance, Micros, restore_pieces};

/// What goes on if a successor fails on probation.
///
/// The example of [`Reverted`](crate::Reverted) shows one.
#[derive(Clone, Debug)]
pub struct Spare<I> {
    /// A new instance of the plug-in that runs now. It gets the settings that
    /// the link has now.
    pub instance: I,
    /// The formats in which it accepts the successor's state, as its manifest lists them; none
    /// if that is a plug-in of another name.
    pub accepts: Vec<u16>,
}

/// Which rooms an opening tells that resumes.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Rooms {
    /// All that there is. Only when nothing is due: growth that is not told as an
    /// event would be missed by a plug-in that waits for it.
    Whole,
    /// What was told so far; the rest is still told as it is due.
    Known,
}

impl<I: Instance> Link<I> {
    /// Gives settings, state and the opening to an instance that is not in place
    /// yet. Returns its answer to the opening, of which nothing was applied and
    /// all can be.
    pub(crate) fn resumed(
        &self,
        instance: &mut I,
        settings: &SettingValues,
        state: &SavedState,
        rooms: Rooms,
        host: &mut dyn LinkHost,
    ) -> Result<Vec<u8>, LinkFault<I::Fault>> {
        let now = self.now();
        let capacity = instance.input_capacity();
        let mut give = |event: &Event<'_>| give_quiet(instance, event, now, host);
        settings.pieces(capacity, &mut give)?;
        restore_pieces(state.format, &state.bytes, capacity, &mut give)?;
        let mut trial = self.core.clone();
        let opening = match rooms {
            Rooms::Known => self.standing(),
            Rooms::Whole => {
                trial.restate_rooms();
                self.opening(true)
            }
        };
        let answer = answer_of(instance, &opening, now)?;
        trial
            .apply_all(now, &answer, &mut Silent)
            .map_err(|source| LinkFault::Rule { event: EventKind::Open, source })?;
        Ok(answer)
    }

    /// Puts an instance that was [`resumed`](Self::resumed) in place. Returns the
    /// one that was there.
    pub(crate) fn seat(
        &mut self,
        instance: I,
        settings: SettingValues,
        answer: &[u8],
        rooms: Rooms,
        host: &mut dyn LinkHost,
    ) -> I {
        self.taken_over_with = self.under_way();
        if rooms == Rooms::Whole {
            self.core.restate_rooms();
        }
        self.options.settings = settings;
        let old = self.put(instance);
        let applied = self.core.apply_all(self.now, answer, host);
        debug_assert_eq!(applied, Ok(()), "a trial has shown that it can be applied");
        old
    }
}

/// Gives an event that may be answered by notes and state names only.
pub(crate) fn give_quiet<I: Instance>(
    instance: &mut I,
    event: &Event<'_>,
    now: Micros,
    host: &mut dyn LinkHost,
) -> Result<(), LinkFault<I::Fault>> {
    let answer = answer_of(instance, event, now)?;
    for action in Actions::new(&answer).flatten() {
        if !matches!(action, Action::Note { .. } | Action::State { .. }) {
            let source = RuleBroken::ActedOnState;
            return Err(LinkFault::Rule { event: event.kind(), source });
        }
        host.handle(now, &action);
    }
    Ok(())
}

/// Hears nothing: for a trial.
pub(crate) struct Silent;

impl LinkHost for Silent {
    fn handle(&mut self, _now: Micros, _action: &Action<'_>) {}
}
