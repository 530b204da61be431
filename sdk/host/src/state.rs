//! Settings into a session, and its state out of it and into another.

use crate::{Misbehaviour, Session, SessionFault};
use softplug_abi::limits::STATE_BYTES;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, Actions, Event, EventKind, Instance, Micros, restore_pieces};

/// A plug-in's state, as one of its instances wrote it.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_host::{Host, HostOptions, SavedState};
///
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// // A plug-in that adds 3 to each byte makes way for a fresh instance.
/// let plugin = Host::new(HostOptions::default())?.load_bytes(&wasm)?;
/// let mut old = plugin.instantiate()?;
/// old.configure(&plugin.manifest().resolve_settings([("shift", "3")])?, Micros::ZERO)?;
/// let state = old.save(Micros(1_000))?;
/// assert_eq!(state, SavedState { format: 1, bytes: vec![3] });
///
/// let mut new = plugin.instantiate()?;
/// new.restore(&state, Micros(1_000))?;
/// assert_eq!(new.save(Micros(1_000))?, state);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SavedState {
    /// The format, as the manifest names it.
    pub format: u16,
    /// The state, at most 64 KiB.
    pub bytes: Vec<u8>,
}

impl Session {
    /// Gives the plug-in its settings, in as many pieces as it takes. To be done
    /// once, before the link is opened.
    ///
    /// # Errors
    /// The plug-in refuses a setting, or ends.
    pub fn configure(&mut self, values: &SettingValues, now: Micros) -> Result<(), SessionFault> {
        let capacity = self.input_capacity();
        values.pieces(capacity, |event| self.quietly(event, now))
    }

    /// Has the plug-in write its state, which changes nothing in it. To be done
    /// only when no event is pending.
    ///
    /// # Errors
    /// The plug-in does not save, or ends: also by pieces that do not make one
    /// whole.
    pub fn save(&mut self, now: Micros) -> Result<SavedState, SessionFault> {
        let Some(format) = self.plugin().manifest().state.saves else {
            return Err(SessionFault::DoesNotSave);
        };
        let mut gathered = Gathered { format, total: None, bytes: Vec::new() };
        self.every_action(&Event::Save, now, |action| gathered.take(&action))?;
        match gathered.total {
            Some(total) if gathered.bytes.len() == total as usize => {
                Ok(SavedState { format, bytes: gathered.bytes })
            }
            Some(_) => {
                Err(self.end(EventKind::Save, Misbehaviour::SavedPiece("the end is missing")))
            }
            None => Err(self.end(EventKind::Save, Misbehaviour::SavedPiece("there is none"))),
        }
    }

    /// Gives a new instance the state of another. Open it as resumed afterwards.
    ///
    /// # Errors
    /// The plug-in does not accept the state's format or content, or ends.
    pub fn restore(&mut self, state: &SavedState, now: Micros) -> Result<(), SessionFault> {
        let SavedState { format, ref bytes } = *state;
        if !self.plugin().manifest().state.accepts.contains(&format) {
            return Err(SessionFault::FormatNotAccepted { format });
        }
        if bytes.len() > STATE_BYTES as usize {
            return Err(SessionFault::StateTooLarge { bytes: bytes.len() });
        }
        restore_pieces(format, bytes, self.input_capacity(), |event| self.quietly(event, now))
    }

    /// A step after which nothing is to be done.
    fn quietly(&mut self, event: &Event<'_>, now: Micros) -> Result<(), SessionFault> {
        self.every_action(event, now, |action| match action {
            Action::Note { .. } | Action::State { .. } => {
                tracing::debug!(?action, "said outside of a link");
                Ok(())
            }
            _ => Err(Misbehaviour::Action),
        })
    }

    /// Steps until there is no more output; an action that `take` refuses ends
    /// the session.
    fn every_action(
        &mut self,
        event: &Event<'_>,
        now: Micros,
        mut take: impl FnMut(Action<'_>) -> Result<(), Misbehaviour>,
    ) -> Result<(), SessionFault> {
        let kind = event.kind();
        let mut output = self.step(event, now)?;
        // Ends at the latest when the session has counted too many rounds.
        loop {
            let taken = Actions::new(output.actions).try_for_each(|action| take(action?));
            let more = output.more;
            if let Err(reason) = taken {
                return Err(self.end(kind, reason));
            }
            if !more {
                return Ok(());
            }
            output = self.step(&Event::Continue, now)?;
        }
    }
}

/// The pieces of a saved state so far.
struct Gathered {
    format: u16,
    total: Option<u32>,
    bytes: Vec<u8>,
}

impl Gathered {
    /// The decoder has checked that the piece lies inside its total, and the
    /// total inside the ABI's bound.
    fn take(&mut self, action: &Action<'_>) -> Result<(), Misbehaviour> {
        let Action::Saved { format, offset, total, bytes } = *action else {
            return Err(Misbehaviour::Action);
        };
        let wrong = |what| Err(Misbehaviour::SavedPiece(what));
        if format != self.format {
            return wrong("its format is not the one in the manifest");
        }
        if *self.total.get_or_insert(total) != total {
            return wrong("the total has changed");
        }
        if offset as usize != self.bytes.len() {
            return wrong("it does not follow the piece before");
        }
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }
}
