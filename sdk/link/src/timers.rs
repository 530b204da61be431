//! A plug-in's timers.

use core::hash::{Hash, Hasher};
use softplug_abi::Micros;
use softplug_abi::limits::TIMERS;

/// One deadline for each id. Setting replaces; a cancelled or replaced timer
/// never fires.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timers {
    deadlines: [Option<Micros>; TIMERS as usize],
}

impl Timers {
    pub(crate) fn set(&mut self, id: u8, deadline: Micros) {
        self.deadlines[usize::from(id)] = Some(deadline);
    }

    pub(crate) fn cancel(&mut self, id: u8) {
        self.deadlines[usize::from(id)] = None;
    }

    pub(crate) fn clear(&mut self) {
        self.deadlines = Default::default();
    }

    pub(crate) fn poll_timeout(&self) -> Option<Micros> {
        self.deadlines.iter().flatten().min().copied()
    }

    /// How far off each is, of which none is in the past for long.
    pub(crate) fn hash_ahead(&self, now: Micros, state: &mut impl Hasher) {
        self.deadlines.map(|deadline| deadline.map(|deadline| deadline.0 - now.0)).hash(state);
    }

    /// Takes the timer that is due first, in the order of (deadline, id).
    pub(crate) fn take_due(&mut self, now: Micros) -> Option<(u8, Micros)> {
        let due = |(id, deadline): (usize, &Option<Micros>)| {
            deadline.filter(|deadline| *deadline <= now).map(|deadline| (deadline, id))
        };
        let (deadline, id) = self.deadlines.iter().enumerate().filter_map(due).min()?;
        self.deadlines[id] = None;
        Some((id as u8, deadline))
    }
}
