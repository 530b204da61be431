//! A plug-in's state, out of it.

use super::Link;
use crate::LinkHost;
use crate::fault::{LinkFault, RuleBroken};
use alloc::vec::Vec;
use softplug_abi::limits::{OUTPUT_ROUNDS, STATE_BYTES};
use softplug_abi::{Action, Actions, Event, EventKind, Instance, Micros};

/// A plug-in's state, as it saved it.
///
/// ```
/// use softplug_abi::{Event, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::Action;
/// use softplug_link::{Link, LinkOptions, Recorder, SavedState};
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
/// let saving = plugin(|event, actions| match event {
///     Event::Save => actions.push(&Action::Saved { format: 1, offset: 0, total: 1, bytes: &[7] }),
///     _ => Ok(()),
/// });
/// let mut link = Link::new(saving, LinkOptions::default());
/// let mut host = Recorder::default();
/// link.open(Micros(0), &mut host)?;
/// let state = link.save(Micros(1_000), &mut host)?;
/// assert_eq!(state, Some(SavedState { format: 1, bytes: vec![7] }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SavedState {
    /// The format; a plug-in's manifest lists those that it accepts.
    pub format: u16,
    /// The state, at most 64 KiB.
    pub bytes: Vec<u8>,
}

impl<I: Instance> Link<I> {
    /// Asks the plug-in for its state. Changes nothing.
    ///
    /// # Errors
    /// A fault of the plug-in; `Ok(None)` if it saves nothing.
    pub fn save(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<Option<SavedState>, LinkFault<I::Fault>> {
        if !self.is_open() {
            return Ok(None);
        }
        if self.has_ended() {
            return Err(LinkFault::Ended);
        }
        self.handle_timeout(now, host)?;
        if let Some(probation) = &self.probation {
            return Ok(Some(probation.state().clone()));
        }
        self.begin_request();
        match saved_by(&mut self.instance, self.now, host) {
            Ok(saved) => Ok(saved),
            Err(fault) => self.ended_by(Err(fault), host).map(|()| None),
        }
    }
}

/// The state of an instance for which no event is pending.
pub(crate) fn saved_by<I: Instance>(
    instance: &mut I,
    now: Micros,
    host: &mut dyn LinkHost,
) -> Result<Option<SavedState>, LinkFault<I::Fault>> {
    let broken = |source| LinkFault::Rule { event: EventKind::Save, source };
    let answer = answer_of(instance, &Event::Save, now)?;
    let mut saving = Saving::default();
    for action in Actions::new(&answer).flatten() {
        match action {
            Action::Saved { format, offset, total, bytes } => {
                saving.take(format, offset, total, bytes).map_err(broken)?;
            }
            Action::Note { .. } | Action::State { .. } => host.handle(now, &action),
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Hold
            | Action::Release
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::DeliveryBegin { .. }
            | Action::Deliver { .. }
            | Action::DeliveryName { .. }
            | Action::DeliveryEnd { .. }
            | Action::JobDone { .. }
            | Action::JobFailed { .. }
            | Action::CheckResult { .. }
            | Action::Request { .. }
            | Action::Withdraw { .. } => return Err(broken(RuleBroken::ActedOnState)),
        }
    }
    saving.finish().map_err(broken)
}

/// All that an instance answers to an event, its rounds of `continue` included.
/// Every record of it can be read.
pub(crate) fn answer_of<I: Instance>(
    instance: &mut I,
    event: &Event<'_>,
    now: Micros,
) -> Result<Vec<u8>, LinkFault<I::Fault>> {
    let kind = event.kind();
    let mut answer = Vec::new();
    let mut asked = event;
    for _ in 0..=OUTPUT_ROUNDS {
        let output =
            instance.step(asked, now).map_err(|source| LinkFault::instance(event, source))?;
        // Each round for itself: no record may stand across two.
        if let Some(Err(source)) = Actions::new(output.actions).find(Result::is_err) {
            return Err(LinkFault::Malformed { event: kind, source });
        }
        answer.extend_from_slice(output.actions);
        if !output.more {
            return Ok(answer);
        }
        asked = &Event::Continue;
    }
    Err(LinkFault::Rule { event: kind, source: RuleBroken::OutputWithoutEnd })
}

/// The pieces so far.
#[derive(Default)]
struct Saving {
    /// Format and total length.
    whole: Option<(u16, u32)>,
    bytes: Vec<u8>,
}

impl Saving {
    fn take(
        &mut self,
        format: u16,
        offset: u32,
        total: u32,
        bytes: &[u8],
    ) -> Result<(), RuleBroken> {
        let is_whole = self.whole.is_some_and(|(_, total)| total as usize == self.bytes.len());
        let follows = !is_whole
            && offset as usize == self.bytes.len()
            && total <= STATE_BYTES
            && self.whole.is_none_or(|known| known == (format, total));
        if !follows {
            return Err(RuleBroken::StatePieces);
        }
        self.whole = Some((format, total));
        self.bytes.extend(bytes);
        Ok(())
    }

    fn finish(self) -> Result<Option<SavedState>, RuleBroken> {
        let Some((format, total)) = self.whole else { return Ok(None) };
        if self.bytes.len() != total as usize {
            return Err(RuleBroken::StatePieces);
        }
        Ok(Some(SavedState { format, bytes: self.bytes }))
    }
}
