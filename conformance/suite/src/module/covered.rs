//! A plug-in that is judged while a copy of it says what it executes.

use super::executed::{Executed, WatchedSession, Watcher};
use crate::run::subject::{Fuel, Sandboxed, Subject, SubjectError};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, Instance, Micros, Output};
use softplug_host::{Session, SessionFault};

/// Each event goes to both. What counts is what the plug-in does; of its copy nothing is asked
/// but what it has executed. So whatever gives the events, a model and a link, works once.
pub(crate) struct Covered {
    judged: Sandboxed,
    watcher: Option<Watcher>,
}

impl Covered {
    /// Without a copy nothing is found out.
    pub(crate) fn new(judged: &Sandboxed, watcher: Option<Watcher>) -> Self {
        Self { judged: judged.clone(), watcher }
    }

    /// What was executed since it was asked last.
    pub(crate) fn take(&self) -> Executed {
        self.watcher.as_ref().map(Watcher::take).unwrap_or_default()
    }
}

impl Subject for Covered {
    type Instance = CoveredSession;

    fn instantiate(&self) -> Result<CoveredSession, SubjectError> {
        let copy = self.watcher.as_ref().map(Watcher::instantiate).transpose()?;
        Ok(CoveredSession { judged: self.judged.instantiate()?, copy })
    }

    fn manifest(&self) -> &Manifest {
        self.judged.manifest()
    }

    fn label(&self) -> &str {
        self.judged.label()
    }

    fn fuel(instance: &CoveredSession) -> Fuel {
        Sandboxed::fuel(&instance.judged)
    }
}

/// An instance and its copy.
pub(crate) struct CoveredSession {
    judged: Session,
    copy: Option<WatchedSession>,
}

impl Instance for CoveredSession {
    type Fault = SessionFault;

    fn input_capacity(&self) -> usize {
        self.judged.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, SessionFault> {
        // One that has failed fails again.
        let _ = self.copy.as_mut().map(|copy| copy.step(event, now));
        self.judged.step(event, now)
    }
}
