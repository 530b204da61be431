//! Another plug-in takes over a link, in the middle of what it does.

use super::Link;
use super::probation::Probation;
use super::saving::{SavedState, saved_by};
use super::seat::{Rooms, Spare};
use crate::LinkHost;
use crate::fault::{LinkFault, RuleBroken};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::error::Error;
use softplug_abi::manifest::{SettingValues, StateFormats};
use softplug_abi::{EventKind, Instance, Malformed, Micros};
use thiserror::Error;

/// What takes over.
///
/// The example of [`Reverted`](crate::Reverted) shows one that fails, that of [`SwapError`] one
/// that is not taken.
#[derive(Clone, Debug)]
pub struct Successor<I> {
    /// A new instance.
    pub instance: I,
    /// A value for each of its settings.
    pub settings: SettingValues,
    /// The formats in which it accepts the running plug-in's state, as its manifest lists them;
    /// none if that is a plug-in of another name, whose formats mean something else.
    pub accepts: Vec<u16>,
    /// With one, the successor is on [probation](Link::on_probation).
    pub spare: Option<Spare<I>>,
}

/// Why the plug-in was not replaced. The old one goes on.
///
/// ```
/// use softplug_abi::{Event, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::Action;
/// use softplug_abi::manifest::SettingValues;
/// use softplug_link::{Link, LinkOptions, Recorder, Successor, SwapError};
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
/// let saving = || plugin(|event, actions| match event {
///     Event::Save => actions.push(&Action::Saved { format: 1, offset: 0, total: 1, bytes: &[7] }),
///     _ => Ok(()),
/// });
/// let mut link = Link::new(saving(), LinkOptions::default());
/// let mut host = Recorder::default();
/// link.open(Micros(0), &mut host)?;
/// // This one is newer, and no longer takes the old form of the state.
/// let (settings, accepts) = (SettingValues::default(), vec![2, 3]);
/// let successor = Successor { instance: saving(), settings, accepts, spare: None };
/// let refused = link.swap_to(Micros(1_000), successor, &mut host);
/// assert!(matches!(refused, Err(SwapError::Format { format: 1 })));
/// assert!(!link.has_ended());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Error)]
pub enum SwapError<F: Error + 'static> {
    /// The old plug-in could not save its state.
    #[error("the running plug-in did not save its state: {0}")]
    Save(#[source] LinkFault<F>),
    /// The old plug-in saves nothing.
    #[error("the running plug-in saves no state; swap it when the link is idle")]
    NoState,
    /// The new plug-in's manifest does not list the format.
    #[error(
        "the new plug-in does not accept a state of format {format}; swap it when the link is idle"
    )]
    Format {
        /// The format of the running plug-in's state.
        format: u16,
    },
    /// The running plug-in's manifest does not say that it saves this format.
    #[error("the plug-in saved a state of format {format}, which its manifest does not say")]
    Unsaid {
        /// The format of its state.
        format: u16,
    },
    /// The new plug-in saves nothing.
    #[error("the new plug-in saves no state, so that it cannot be on probation")]
    NoProbation,
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

impl<F: Error + 'static> From<LinkFault<F>> for SwapError<F> {
    /// What a successor did wrong before it was put in place.
    fn from(fault: LinkFault<F>) -> Self {
        match fault {
            LinkFault::Instance { event, source } => Self::Refused { event, source },
            LinkFault::Malformed { source, .. } => Self::Malformed(source),
            LinkFault::Rule { event, source } => Self::Rule { event, source },
            LinkFault::Ended => Self::Failed(fault),
        }
    }
}

impl<I: Instance> Link<I> {
    /// As [`swap`](Self::swap), of a plug-in whose manifest says this of its states: what it does must be that.
    ///
    /// # Errors
    /// As for [`swap_to`](Self::swap_to); [`SwapError::Unsaid`] if it saves another format.
    pub fn swap_as_said(
        &mut self,
        now: Micros,
        successor: I,
        said: &StateFormats,
        host: &mut dyn LinkHost,
    ) -> Result<I, SwapError<I::Fault>> {
        let state = self.save(now, host).map_err(SwapError::Save)?.ok_or(SwapError::NoState)?;
        let format = state.format;
        if said.saves != Some(format) {
            return Err(SwapError::Unsaid { format });
        }
        if !said.accepts.contains(&format) {
            return Err(SwapError::Format { format });
        }
        let settings = self.options.settings.clone();
        self.take_over(successor, settings, &state, None, host)
    }

    /// Replaces the plug-in by another instance of itself, which gets the
    /// settings of this link and the state. Queue, marks, hold and lines stay.
    /// Returns the plug-in that was replaced.
    ///
    /// # Errors
    /// As for [`swap_to`](Self::swap_to).
    pub fn swap(
        &mut self,
        now: Micros,
        successor: I,
        host: &mut dyn LinkHost,
    ) -> Result<I, SwapError<I::Fault>> {
        let state = self.save(now, host).map_err(SwapError::Save)?.ok_or(SwapError::NoState)?;
        let settings = self.options.settings.clone();
        self.take_over(successor, settings, &state, None, host)
    }

    /// Replaces the plug-in by another one, which gets its settings and the
    /// state. Queue, marks, hold and lines stay. Returns the plug-in that was
    /// replaced.
    ///
    /// # Errors
    /// In every case but [`SwapError::Failed`] and [`SwapError::Save`] the old
    /// plug-in goes on as if nothing had been asked.
    pub fn swap_to(
        &mut self,
        now: Micros,
        successor: Successor<I>,
        host: &mut dyn LinkHost,
    ) -> Result<I, SwapError<I::Fault>> {
        let state = self.save(now, host).map_err(SwapError::Save)?.ok_or(SwapError::NoState)?;
        let Successor { instance, settings, accepts, spare } = successor;
        if !accepts.contains(&state.format) {
            return Err(SwapError::Format { format: state.format });
        }
        self.take_over(instance, settings, &state, spare, host)
    }

    fn take_over(
        &mut self,
        mut successor: I,
        settings: SettingValues,
        state: &SavedState,
        spare: Option<Spare<I>>,
        host: &mut dyn LinkHost,
    ) -> Result<I, SwapError<I::Fault>> {
        let whole = Rooms::Whole;
        let answer = self.resumed(&mut successor, &settings, state, whole, host)?;
        let mut probation = None;
        if let Some(spare) = spare {
            let state = saved_by(&mut successor, self.now(), host)?;
            let state = state.ok_or(SwapError::NoProbation)?;
            let settings = self.options.settings.clone();
            probation = Some(Box::new(Probation::new(spare, settings, state)));
        }
        let old = self.seat(successor, settings, &answer, whole, host);
        self.probation = probation;
        let told = self.tell_modem_lines(host);
        told.and_then(|()| self.handle_timeout(self.now(), host)).map_err(SwapError::Failed)?;
        Ok(old)
    }
}
