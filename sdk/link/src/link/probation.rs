//! A plug-in on probation: its state is saved after every event, and if it
//! fails, the one before it goes on from there.

use super::Link;
use super::requests::is_too_long;
use super::saving::{SavedState, answer_of, saved_by};
use super::seat::{Rooms, Silent, Spare};
use super::under_way::UnderWay;
use crate::LinkHost;
use crate::fault::{LinkFault, RuleBroken};
use alloc::boxed::Box;
use alloc::vec::Vec;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, Event, EventKind, Failure, Instance, Micros};

/// What a return needs.
#[derive(Debug)]
pub(crate) struct Probation<I> {
    spare: Spare<I>,
    /// The settings of the one before.
    settings: SettingValues,
    /// After the last event whose actions were applied.
    state: SavedState,
    events: u64,
}

/// A plug-in has failed on probation, and the one before it has gone on.
///
/// ```
/// use softplug_abi::{Event, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::manifest::SettingValues;
/// use softplug_abi::{Action, EventKind};
/// use softplug_link::{Link, LinkOptions, Recorder, Reverted, Spare, Successor, Taken};
///
/// # type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
/// # struct Plugin(Act, Vec<u8>);
/// # impl Instance for Plugin {
/// #     type Fault = NoSpace;
/// #     fn input_capacity(&self) -> usize {
/// #         512
/// #     }
/// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
/// #         self.1.resize(1_024, 0);
/// #         let mut actions = ActionWriter::new(&mut self.1);
/// #         (self.0)(event, &mut actions)?;
/// #         let length = actions.len();
/// #         Ok(Output { actions: &self.1[..length], more: false })
/// #     }
/// # }
/// # fn plugin(act: Act) -> Plugin {
/// #     Plugin(act, Vec::new())
/// # }
/// const SAVED: Action<'_> = Action::Saved { format: 1, offset: 0, total: 1, bytes: &[7] };
/// let echo = || plugin(|event, actions| match event {
///     Event::Received(bytes) => actions.transmit(bytes),
///     Event::Save => actions.push(&SAVED),
///     _ => Ok(()),
/// });
/// let broken = plugin(|event, actions| match event {
///     Event::Received(_) => Err(NoSpace),
///     Event::Save => actions.push(&SAVED),
///     _ => Ok(()),
/// });
/// let mut link = Link::new(echo(), LinkOptions::default());
/// let mut host = Recorder::default();
/// link.open(Micros(0), &mut host)?;
/// let spare = Some(Spare { instance: echo(), accepts: vec![1] });
/// let settings = SettingValues::default();
/// let successor = Successor { instance: broken, settings, accepts: vec![1], spare };
/// link.swap_to(Micros(1_000), successor, &mut host)?;
/// assert!(link.on_probation().is_some());
///
/// // It fails, the one before it goes on, and what came is not lost.
/// link.received(Micros(2_000), b"G1", &mut host)?;
/// let Reverted { at, event, .. } = link.take_reverted().expect("it has failed");
/// assert_eq!((at, event), (Micros(2_000), EventKind::Received));
/// assert_eq!(link.take(&mut [0; 64]), Taken::Bytes(2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Reverted<I: Instance> {
    /// When.
    pub at: Micros,
    /// The event that the plug-in failed on; the one before it was given it again.
    pub event: EventKind,
    /// How it failed.
    pub fault: LinkFault<I::Fault>,
    /// The plug-in that failed.
    pub failed: I,
    /// What was under way on the link when it had taken over.
    pub taken_over_with: UnderWay,
}

impl<I: Instance> Probation<I> {
    pub(crate) fn new(spare: Spare<I>, settings: SettingValues, state: SavedState) -> Self {
        Self { spare, settings, state, events: 0 }
    }

    pub(crate) fn capacity(&self) -> usize {
        self.spare.instance.input_capacity()
    }

    pub(crate) fn state(&self) -> &SavedState {
        &self.state
    }
}

impl<I: Instance> Link<I> {
    /// While a plug-in is on probation: how many events it has mastered.
    pub fn on_probation(&self) -> Option<u64> {
        self.probation.as_ref().map(|probation| probation.events)
    }

    /// Ends the probation: the plug-in stays, whatever comes.
    pub fn keep(&mut self) {
        self.probation = None;
    }

    /// What became of a plug-in that has failed on probation, told once.
    pub fn take_reverted(&mut self) -> Option<Reverted<I>> {
        self.reverted.take().map(|reverted| *reverted)
    }

    /// One event with all of its output. Nothing of it is applied before all of
    /// it is known to be good and the state after it is saved: the one before
    /// can take the event as if it had never been given.
    pub(crate) fn step_on_probation(
        &mut self,
        event: &Event<'_>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        let (answer, state) = match self.tried(event, host) {
            Ok(tried) => tried,
            Err(fault) => return self.go_back(event, fault, host),
        };
        if let Some(probation) = &mut self.probation {
            probation.state = state;
            probation.events += 1;
        }
        let applied = self.core.apply_all(self.now, &answer, host);
        let applied = applied.map_err(|source| LinkFault::Rule { event: event.kind(), source });
        self.ended_by(applied, host)
    }

    fn tried(
        &mut self,
        event: &Event<'_>,
        host: &mut dyn LinkHost,
    ) -> Result<(Vec<u8>, SavedState), LinkFault<I::Fault>> {
        let broken = |event, source| LinkFault::Rule { event, source };
        self.count_step(event)?;
        let answer = answer_of(&mut self.instance, event, self.now)?;
        let mut trial = self.core.clone();
        trial
            .apply_all(self.now, &answer, &mut Silent)
            .map_err(|source| broken(event.kind(), source))?;
        let state = saved_by(&mut self.instance, self.now, host)?;
        let state = state.ok_or_else(|| broken(EventKind::Save, RuleBroken::StatePieces))?;
        Ok((answer, state))
    }

    /// The one before goes on with the last state and that event. If it cannot,
    /// the link has ended.
    fn go_back(
        &mut self,
        event: &Event<'_>,
        fault: LinkFault<I::Fault>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        let Some(probation) = self.probation.take() else { return Err(fault) };
        let Probation { spare: Spare { mut instance, accepts }, settings, state, .. } = *probation;
        if !accepts.contains(&state.format) {
            return self.ended_by(Err(fault), host);
        }
        self.take_back(event);
        let Ok(answer) = self.resumed(&mut instance, &settings, &state, Rooms::Known, host) else {
            return self.ended_by(Err(fault), host);
        };
        let taken_over_with = core::mem::take(&mut self.taken_over_with);
        let failed = self.seat(instance, settings, &answer, Rooms::Known, host);
        let (at, kind) = (self.now, event.kind());
        self.reverted =
            Some(Box::new(Reverted { at, event: kind, fault, failed, taken_over_with }));
        self.begin_request();
        self.tell_modem_lines(host)?;
        self.give_again(event, host)
    }

    /// What the event told counts as not told yet. A plug-in may do nothing about
    /// room that an opening tells: it waits for the event.
    fn take_back(&mut self, event: &Event<'_>) {
        match event {
            Event::Discarded { bytes } => self.core.queue.undo_discarded(*bytes),
            Event::TransmitRoom { grown } => self.core.queue.shrink_room(*grown),
            Event::DeliveryRoom { grown } => self.core.shrink_delivery_room(*grown),
            Event::Settings { .. }
            | Event::Open { .. }
            | Event::Close
            | Event::Received(..)
            | Event::LineError { .. }
            | Event::ModemLines { .. }
            | Event::LinkDown(..)
            | Event::LinkUp
            | Event::Timer { .. }
            | Event::Mark { .. }
            | Event::JobBegin { .. }
            | Event::JobData { .. }
            | Event::JobEnd { .. }
            | Event::Pause { .. }
            | Event::Resume { .. }
            | Event::Abort { .. }
            | Event::ForceResume
            | Event::Answer { .. }
            | Event::Save
            | Event::Restore { .. }
            | Event::Continue => {}
        }
    }

    fn give_again(
        &mut self,
        event: &Event<'_>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        match event {
            Event::TransmitRoom { grown } => {
                self.core.queue.grow_room(*grown);
                self.step(event, host)
            }
            Event::DeliveryRoom { grown } => {
                self.core.grow_delivery_room(*grown);
                self.step(event, host)
            }
            // Modem lines followed the opening, timers were set anew, and answers to
            // discards are due again.
            Event::ModemLines { .. } | Event::Timer { .. } | Event::Discarded { .. } => Ok(()),
            Event::JobBegin { job, fields, .. }
                if is_too_long(fields.as_bytes(), self.instance.input_capacity()) =>
            {
                self.core.job = None;
                let failure = Failure::BadJob;
                host.handle(
                    self.now,
                    &Action::JobFailed { job: *job, failure, status: 0, sent: 0 },
                );
                Ok(())
            }
            Event::Settings { .. }
            | Event::Open { .. }
            | Event::Close
            | Event::Received(..)
            | Event::LineError { .. }
            | Event::LinkDown(..)
            | Event::LinkUp
            | Event::Mark { .. }
            | Event::JobBegin { .. }
            | Event::JobData { .. }
            | Event::JobEnd { .. }
            | Event::Pause { .. }
            | Event::Resume { .. }
            | Event::Abort { .. }
            | Event::ForceResume
            | Event::Answer { .. }
            | Event::Save
            | Event::Restore { .. }
            | Event::Continue => self.step(event, host),
        }
    }
}
